"""Jaywalking: pedestrians who cross streets away from crosswalks wait for a gap, and drivers brake for them."""

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
import shapely

from simbev_ros.foundation.types import BoolArray, Float64Array
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.scene.blueprints import blueprint_named
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.simulation.world.pedestrians.crossing_sites import CrossingSite
from simbev_ros.simulation.world.pedestrians.free_walk import FreeWalker
from simbev_ros.simulation.world.population import Population
from simbev_ros.simulation.world.sumo.traffic import TrafficSample

_COMFORTABLE_MPS2 = 2.5  # comfortable braking for a pedestrian on the road
_REACTION_S = 0.8
_STOP_GAP_M = 2.5  # from a stopped bumper to the crossing path
_MIN_GAP_M = 1.0  # in front of a vehicle that already stands there
_MIN_LATERAL_M = 1.2  # from the crossing path to a vehicle that blocks it
_CLEARED_M = 1.0  # this far beyond a carriageway, a pedestrian is clear of its traffic
_MAX_TURNING_MPS2 = 5.0  # limit with which pedestrians' bodies follow their points, so that they lag behind
_CURB_DISTANCE_M = 0.2
_BEYOND_CURB_M = 0.4  # beyond the far curb
_LOOK_PERIOD_S = 0.2  # interval at which pedestrians look for a gap, and drivers for pedestrians


@dataclass(slots=True)
class _Crossing:
    """A pedestrian who crosses a street.

    Attributes:
        site: Where it crosses.
        walker: The pedestrian.
        is_active: Whether it is on the way across.
        braking: Vehicles that brake for it.
    """

    site: CrossingSite
    walker: FreeWalker
    is_active: bool = False
    braking: set[int] = field(default_factory=set)

    @property
    def cleared_m(self) -> float:
        """Length of the path that the pedestrian's body has cleared."""
        start_m, end_m = self.site.ends_m[:, :2]
        walked_m = float((self.walker.position_m[:2] - start_m) @ (end_m - start_m)) / self.site.length_m
        return walked_m - _CLEARED_M - self.walker.speed_mps**2 / (2.0 * _MAX_TURNING_MPS2)


class Jaywalks:
    """All street crossings in a scene, decided at SUMO's moment, which is ahead of the published tables.

    Attributes:
        is_crossing: (P,) bool; whether each pedestrian is on the way across.
    """

    def __init__(self, spec: SceneSpec, population: Population, front_m: Float64Array) -> None:
        """Start without crossings.

        Args:
            spec: The scene.
            population: Vehicles and pedestrians.
            front_m: (V, 3) fronts of the vehicles.
        """
        self.is_crossing: BoolArray = np.zeros(len(population.pedestrians), bool)
        self._population, self._sumo = population, population.sumo
        self._tick_s = spec.tick_ns / NS_PER_S
        vehicles = [spec.vehicles[index] for index in population.vehicles]
        self._ignores_pedestrians = ["pedestrians" in vehicle.ignored for vehicle in vehicles]
        self._size_m = np.array([blueprint_named(vehicle.blueprint).size_m for vehicle in vehicles])
        self._look_ticks = max(1, round(_LOOK_PERIOD_S / self._tick_s))
        self._steps = 0
        self._front_m = front_m
        self._reach_m: Float64Array = np.zeros(len(front_m))
        self._crossings: dict[int, _Crossing] = {}

    def observe(self, sample: TrafficSample) -> None:
        """Take the traffic of this step. Call it once per step, before any pedestrian walks on."""
        speed_mps = np.linalg.norm(sample.front_m - self._front_m, axis=1) / self._tick_s
        self._reach_m = _stopping_distance_m(speed_mps) + self._size_m[:, 0] + _STOP_GAP_M
        self._steps += 1
        self._front_m = sample.front_m

    def cross(self, row: int, walker: FreeWalker, site: CrossingSite) -> Iterator[None]:
        """Walk to the curb, wait for a gap and cross; the crossing lasts until ``end_crossing``.

        Args:
            row: Index of the pedestrian.
            walker: The same pedestrian, off the network.
            site: The crossing site.
        """
        ahead = (site.ends_m[1] - site.ends_m[0]) / site.length_m
        near_curb_m, far_curb_m = site.curbs_m
        wait_distance_m = max(near_curb_m - walker.reach_m - _CURB_DISTANCE_M, 0.0)
        yield from walker.walk_to(site.ends_m[0] + wait_distance_m * ahead)
        while not (self._looks_now(row) and self._has_gap(site)):
            yield
        self._crossings[row] = _Crossing(site, walker)
        self.is_crossing[row] = self._crossings[row].is_active = True
        yield from walker.walk_to(site.ends_m[0] + (far_curb_m + _BEYOND_CURB_M) * ahead)

    def end_crossing(self, row: int) -> None:
        """End the crossing of a pedestrian who is on a sidewalk again."""
        if row in self._crossings:
            self.is_crossing[row] = self._crossings[row].is_active = False

    def brake_drivers(self) -> None:
        """Let careful drivers stop for crossing pedestrians. Call it once per step, after all pedestrians moved."""
        for row, crossing in list(self._crossings.items()):
            self._brake(row, crossing)
            if not crossing.is_active:
                del self._crossings[row]

    def _looks_now(self, row: int) -> bool:
        """Whether a pedestrian and its drivers look around at this step; staggered over the pedestrians."""
        return (self._steps + row) % self._look_ticks == 0

    def _vehicles_near(self, site: CrossingSite) -> list[int]:
        """Vehicles, ascending, that may be on a crossing path or cannot stop far from it."""
        start_m, end_m = site.ends_m[:, :2]
        gap_m = np.linalg.norm(self._front_m[:, :2] - (start_m + end_m) / 2.0, axis=1)
        return np.flatnonzero(gap_m < self._reach_m + site.length_m / 2.0).tolist()

    def _has_gap(self, site: CrossingSite) -> bool:
        """Whether no vehicle is on a crossing path, and every approaching one can stop before it in comfort."""
        path = shapely.LineString(site.ends_m[:, :2])
        for vehicle in self._vehicles_near(site):
            front_m = self._front_m[vehicle, :2]
            length_m, width_m, _ = self._size_m[vehicle].tolist()
            body = shapely.LineString([front_m, front_m - length_m * self._population.direction(vehicle)])
            needed_m = float(_stopping_distance_m(self._population.speed_mps(vehicle))) + _MIN_GAP_M
            if path.distance(body) < width_m / 2.0 + _MIN_LATERAL_M or self._distance_m(vehicle, site, 0.0) < needed_m:
                return False
        return True

    def _brake(self, row: int, crossing: _Crossing) -> None:
        """Let careful drivers stop for a pedestrian, and drive on when it has left their path."""
        braking: set[int] = set()
        candidates = sorted(crossing.braking) if not self._looks_now(row) else self._vehicles_near(crossing.site)
        for vehicle in candidates if crossing.is_active else ():
            distance_m = self._distance_m(vehicle, crossing.site, crossing.cleared_m) - _STOP_GAP_M
            if self._ignores_pedestrians[vehicle] or not np.isfinite(distance_m):
                continue
            speed_mps = self._population.speed_mps(vehicle)
            needed_mps2 = speed_mps**2 / (2.0 * max(distance_m, 1e-3))
            if vehicle in crossing.braking or needed_mps2 > _COMFORTABLE_MPS2 or distance_m < _STOP_GAP_M:
                braking.add(vehicle)
                self._sumo.limit_speed(vehicle, f"jaywalker {row}", max(speed_mps - needed_mps2 * self._tick_s, 0.0))
        for vehicle in sorted(crossing.braking - braking):
            self._sumo.limit_speed(vehicle, f"jaywalker {row}", None)
        crossing.braking = braking

    def _distance_m(self, vehicle: int, site: CrossingSite, cleared_m: float) -> float:
        """Driving distance of a vehicle to the crossed carriageways not yet cleared; infinite if it reaches none."""
        return min(
            (
                self._population.distance_m(vehicle, carriageway.edge, carriageway.position_m)
                for carriageway in site.carriageways
                if carriageway.cleared_m > cleared_m
            ),
            default=np.inf,
        )


def _stopping_distance_m(speed_mps: Float64Array | float) -> Float64Array:
    """Distance in which a driver stops in comfort."""
    return np.asarray(speed_mps**2 / (2.0 * _COMFORTABLE_MPS2) + _REACTION_S * speed_mps, np.float64)
