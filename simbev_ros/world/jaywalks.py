"""People who cross streets away from crosswalks, and drivers who brake for them.

SUMO's people keep to its net. Where somebody is to cross a street, the world takes it off the net, walks it to the
kerb, lets it wait for a gap and walks it across; on the other side it goes back onto the net. All is decided at SUMO's
moment, which is ahead of the tables.
"""

from collections import deque
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np
import shapely

from simbev_ros.scene.spec import NS_PER_S, SceneSpec
from simbev_ros.types import BoolArray, Float64Array, Int64Array
from simbev_ros.world.cast import blueprint_of
from simbev_ros.world.crossing_places import CrossingPlace
from simbev_ros.world.itineraries import Leg
from simbev_ros.world.traffic import Traffic, TrafficSample

_COMFORTABLE_MPS2 = 2.5  # of drivers who see somebody on the road
_REACTION_S = 0.8
_STOP_GAP_M = 2.5  # from a stopped bumper to the way across
_LEAST_GAP_M = 1.0  # in front of who stands there already
_BESIDE_M = 1.2  # from the way across to who blocks it
_BEHIND_M = 1.0  # beyond a carriageway, somebody is out of its drivers' way
_TURNING_MPS2 = 5.0  # bodies of people follow their points no harder, and so lag behind
_FROM_KERB_M = 0.2
_ACROSS_M = 0.4  # behind the far kerb
_AT_PLACE_M = 0.5
_SIDEWALK_M = 3.0
_LOOK_S = 0.2  # how often people look for a gap, and drivers for people


@dataclass(slots=True)
class _Crossing:
    """Somebody off the net: where, whether it is on its way across, and which vehicles brake for it."""

    place: CrossingPlace
    position_m: Float64Array
    speed_mps: float
    reach_m: float  # from its middle to its foremost foot
    started: bool = False
    braking: set[int] = field(default_factory=set)

    @property
    def behind_m(self) -> float:
        """How much of the way is behind its body."""
        start_m, end_m = self.place.ends_m[:, :2]
        walked_m = float((self.position_m[:2] - start_m) @ (end_m - start_m)) / self.place.length_m
        return walked_m - _BEHIND_M - self.speed_mps**2 / (2.0 * _TURNING_MPS2)


class Jaywalks:
    """All jaywalks of a scene.

    Attributes:
        on_way: (P,) bool; who is on its way across.
    """

    def __init__(
        self, spec: SceneSpec, ways: Mapping[int, tuple[Leg, ...]], traffic: Traffic, front_m: Float64Array
    ) -> None:
        """At rest.

        Args:
            spec: The scene.
            ways: The legs of those of its pedestrians who cross streets.
            traffic: Where they walk.
            front_m: (V, 3) of its vehicles.
        """
        self.on_way: BoolArray = np.zeros(len(traffic.pedestrians), bool)
        self._traffic = traffic
        self._tick_s = spec.tick_ns / NS_PER_S
        people = [spec.pedestrians[index] for index in traffic.pedestrians]
        self._speed_mps = [person.max_speed_mps for person in people]
        self._half_length_m = [blueprint_of(person.blueprint).size_m[0] / 2.0 for person in people]
        self._legs = {row: deque(ways[index]) for row, index in enumerate(traffic.pedestrians) if index in ways}
        vehicles = [spec.vehicles[index] for index in traffic.vehicles]
        self._reckless = [vehicle.reckless for vehicle in vehicles]
        self._size_m = np.array([blueprint_of(vehicle.blueprint).size_m for vehicle in vehicles])
        self._look_ticks = max(1, round(_LOOK_S / self._tick_s))
        self._steps = 0
        self._front_m = front_m
        self._pedestrian_m: Float64Array = np.zeros((len(traffic.pedestrians), 3))
        self._reach_m: Float64Array = np.zeros(len(front_m))
        self._crossings: dict[int, tuple[_Crossing, Iterator[None]]] = {}
        self._plan()

    def advance(self, sample: TrafficSample, crashed: BoolArray) -> Float64Array:
        """(P, 3) where people are; to be called once for each step of the traffic.

        Args:
            sample: The traffic now.
            crashed: (P,) who has had a collision and goes nowhere any more.
        """
        speed_mps = np.linalg.norm(sample.front_m - self._front_m, axis=1) / self._tick_s
        self._reach_m = _stopping_m(speed_mps) + self._size_m[:, 0] + _STOP_GAP_M
        self._steps += 1
        self._front_m, self._pedestrian_m = sample.front_m, sample.pedestrian_m
        self._leave(crashed)
        place_m = sample.pedestrian_m.copy()
        for row, (crossing, steps) in list(self._crossings.items()):
            if not crashed[row]:
                next(steps, None)
            self._brake(row, crossing)
            place_m[row] = crossing.position_m
            self.on_way[row] = crossing.started
        return place_m

    def _plan(self) -> None:
        """Note down who will leave the net next, and where."""
        places = {row: legs[0].crossing for row, legs in self._legs.items() if row not in self._crossings}
        coming = {row: place for row, place in places.items() if place is not None}
        self._coming: Int64Array = np.array(list(coming), np.int64)
        self._leave_m = np.array([place.ends_m[0, :2] for place in coming.values()]).reshape(-1, 2)
        self._along = np.array([place.along for place in coming.values()]).reshape(-1, 2)

    def _leave(self, crashed: BoolArray) -> None:
        """Take those off the net who have come to where they cross."""
        gap_m = self._pedestrian_m[self._coming, :2] - self._leave_m
        along_m = np.abs(np.sum(gap_m * self._along, axis=1))
        there = (along_m < _AT_PLACE_M) & (np.linalg.norm(gap_m, axis=1) < _SIDEWALK_M) & ~crashed[self._coming]
        rows = self._coming[there].tolist()
        for row in rows:
            place = self._legs[row].popleft().crossing
            assert place is not None
            crossing = _Crossing(place, self._pedestrian_m[row], self._speed_mps[row], self._half_length_m[row])
            self._crossings[row] = crossing, self._cross(row, crossing)
            self._traffic.take_out(row)
        if rows:
            self._plan()

    def _cross(self, row: int, crossing: _Crossing) -> Iterator[None]:
        """All from leaving the net to walking on it again, tick by tick."""
        place = crossing.place
        ahead = (place.ends_m[1] - place.ends_m[0]) / place.length_m
        near_kerb_m, far_kerb_m = place.kerbs_m
        waits_m = max(near_kerb_m - crossing.reach_m - _FROM_KERB_M, 0.0)
        yield from self._go(crossing, place.ends_m[0] + waits_m * ahead)
        while not (self._looks(row) and self._is_free(place)):
            yield
        crossing.started = True
        yield from self._go(crossing, place.ends_m[0] + (far_kerb_m + _ACROSS_M) * ahead)
        leg = self._legs[row][0]
        self._traffic.put_back(row, leg.edges, place.far_position_m, leg.arrival_m)
        yield
        self._traffic.pace(row, 0.0)
        yield from self._go(crossing, self._pedestrian_m[row])
        self._traffic.pace(row, self._speed_mps[row])
        crossing.started = False
        del self._crossings[row]
        self._plan()

    def _go(self, crossing: _Crossing, goal_m: Float64Array) -> Iterator[None]:
        """Walk straight to a (3,) place."""
        way_m = crossing.speed_mps * self._tick_s
        while (left_m := float(np.linalg.norm(goal_m - crossing.position_m))) > way_m:
            crossing.position_m = crossing.position_m + way_m / left_m * (goal_m - crossing.position_m)
            yield
        crossing.position_m = goal_m
        yield

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
