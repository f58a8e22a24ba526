"""People who cross streets away from crosswalks: they wait for a gap, and drivers brake for them."""

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
import shapely

from simbev_ros.scene.spec import NS_PER_S, SceneSpec
from simbev_ros.types import BoolArray, Float64Array
from simbev_ros.world.cast import blueprint_of
from simbev_ros.world.pedestrians.crossing_sites import CrossingPlace
from simbev_ros.world.pedestrians.free_walk import Stroller
from simbev_ros.world.sumo.traffic import Traffic, TrafficSample

_COMFORTABLE_MPS2 = 2.5  # of drivers who see somebody on the road
_REACTION_S = 0.8
_STOP_GAP_M = 2.5  # from a stopped bumper to the way across
_LEAST_GAP_M = 1.0  # in front of who stands there already
_BESIDE_M = 1.2  # from the way across to who blocks it
_BEHIND_M = 1.0  # beyond a carriageway, somebody is out of its drivers' way
_TURNING_MPS2 = 5.0  # bodies of people follow their points no harder, and so lag behind
_FROM_KERB_M = 0.2
_ACROSS_M = 0.4  # behind the far kerb
_LOOK_S = 0.2  # how often people look for a gap, and drivers for people


@dataclass(slots=True)
class _Crossing:
    """Somebody who crosses a street: where, whether it is on its way across, and which vehicles brake for it."""

    place: CrossingPlace
    stroller: Stroller
    started: bool = False
    braking: set[int] = field(default_factory=set)

    @property
    def behind_m(self) -> float:
        """How much of the way is behind its body."""
        start_m, end_m = self.place.ends_m[:, :2]
        walked_m = float((self.stroller.position_m[:2] - start_m) @ (end_m - start_m)) / self.place.length_m
        return walked_m - _BEHIND_M - self.stroller.speed_mps**2 / (2.0 * _TURNING_MPS2)


class Jaywalks:
    """All crossings of streets in a scene. All is decided at SUMO's moment, which is ahead of the tables.

    Attributes:
        on_way: (P,) bool; who is on its way across.
    """

    def __init__(self, spec: SceneSpec, traffic: Traffic, front_m: Float64Array) -> None:
        """Nobody crosses yet.

        Args:
            spec: The scene.
            traffic: Where they walk.
            front_m: (V, 3) of its vehicles.
        """
        self.on_way: BoolArray = np.zeros(len(traffic.pedestrians), bool)
        self._traffic = traffic
        self._tick_s = spec.tick_ns / NS_PER_S
        vehicles = [spec.vehicles[index] for index in traffic.vehicles]
        self._reckless = [vehicle.reckless for vehicle in vehicles]
        self._size_m = np.array([blueprint_of(vehicle.blueprint).size_m for vehicle in vehicles])
        self._look_ticks = max(1, round(_LOOK_S / self._tick_s))
        self._steps = 0
        self._front_m = front_m
        self._reach_m: Float64Array = np.zeros(len(front_m))
        self._crossings: dict[int, _Crossing] = {}

    def observe(self, sample: TrafficSample) -> None:
        """Take note of the traffic now; to be called once for each step, before anybody walks on."""
        speed_mps = np.linalg.norm(sample.front_m - self._front_m, axis=1) / self._tick_s
        self._reach_m = _stopping_m(speed_mps) + self._size_m[:, 0] + _STOP_GAP_M
        self._steps += 1
        self._front_m = sample.front_m

    def cross(self, row: int, stroller: Stroller, place: CrossingPlace) -> Iterator[None]:
        """Walk to the kerb, wait for a gap and go across; somebody is on its way until ``end`` says that it is over.

        Args:
            row: Which of the pedestrians.
            stroller: The same one off the net.
            place: The way across.
        """
        ahead = (place.ends_m[1] - place.ends_m[0]) / place.length_m
        near_kerb_m, far_kerb_m = place.kerbs_m
        waits_m = max(near_kerb_m - stroller.reach_m - _FROM_KERB_M, 0.0)
        yield from stroller.go(place.ends_m[0] + waits_m * ahead)
        while not (self._looks(row) and self._is_free(place)):
            yield
        self._crossings[row] = _Crossing(place, stroller)
        self.on_way[row] = self._crossings[row].started = True
        yield from stroller.go(place.ends_m[0] + (far_kerb_m + _ACROSS_M) * ahead)

    def end(self, row: int) -> None:
        """Somebody is on a sidewalk again."""
        if row in self._crossings:
            self.on_way[row] = self._crossings[row].started = False

    def warn(self) -> None:
        """Let careful drivers stop before whom they must not hit; to be called when everybody has walked on."""
        for row, crossing in list(self._crossings.items()):
            self._brake(row, crossing)
            if not crossing.started:
                del self._crossings[row]

    def _looks(self, row: int) -> bool:
        """Whether somebody and its drivers look around now; not all do at once."""
        return (self._steps + row) % self._look_ticks == 0

    def _near(self, place: CrossingPlace) -> list[int]:
        """Vehicles that may be on a way or cannot stop far from it, ascending."""
        start_m, end_m = place.ends_m[:, :2]
        gap_m = np.linalg.norm(self._front_m[:, :2] - (start_m + end_m) / 2.0, axis=1)
        rows: list[int] = np.flatnonzero(gap_m < self._reach_m + place.length_m / 2.0).tolist()
        return rows

    def _is_free(self, place: CrossingPlace) -> bool:
        """Whether nobody is on a way across, and whoever comes can stop before it in comfort."""
        way = shapely.LineString(place.ends_m[:, :2])
        for vehicle in self._near(place):
            front_m = self._front_m[vehicle, :2]
            length_m, width_m, _ = self._size_m[vehicle].tolist()
            body = shapely.LineString([front_m, front_m - length_m * self._traffic.direction(vehicle)])
            needed_m = float(_stopping_m(self._traffic.speed_mps(vehicle))) + _LEAST_GAP_M
            if way.distance(body) < width_m / 2.0 + _BESIDE_M or self._distance_m(vehicle, place, 0.0) < needed_m:
                return False
        return True

    def _brake(self, row: int, crossing: _Crossing) -> None:
        """Let careful drivers stop before whom they must not hit, and drive on when it is out of their way."""
        braking: set[int] = set()
        seen = sorted(crossing.braking) if not self._looks(row) else self._near(crossing.place)
        for vehicle in seen if crossing.started else ():
            distance_m = self._distance_m(vehicle, crossing.place, crossing.behind_m) - _STOP_GAP_M
            if self._reckless[vehicle] or not np.isfinite(distance_m):
                continue
            speed_mps = self._traffic.speed_mps(vehicle)
            needed_mps2 = speed_mps**2 / (2.0 * max(distance_m, 1e-3))
            if vehicle in crossing.braking or needed_mps2 > _COMFORTABLE_MPS2 or distance_m < _STOP_GAP_M:
                braking.add(vehicle)
                self._traffic.limit(vehicle, f"jaywalker {row}", max(speed_mps - needed_mps2 * self._tick_s, 0.0))
        for vehicle in sorted(crossing.braking - braking):
            self._traffic.limit(vehicle, f"jaywalker {row}", None)
        crossing.braking = braking

    def _distance_m(self, vehicle: int, place: CrossingPlace, behind_m: float) -> float:
        """How far it is for a vehicle to those carriageways of a way that are not behind yet; infinite: not its way."""
        return min(
            (
                self._traffic.distance_m(vehicle, part.edge, part.position_m)
                for part in place.carriageways
                if part.until_m > behind_m
            ),
            default=np.inf,
        )


def _stopping_m(speed_mps: Float64Array | float) -> Float64Array:
    """Way in which a driver stops in comfort."""
    return np.asarray(speed_mps**2 / (2.0 * _COMFORTABLE_MPS2) + _REACTION_S * speed_mps, np.float64)
