"""Drivers slow down for speed bumps, and stay slow until the rear of their vehicle has passed."""

from collections.abc import Iterator, Sequence

import numpy as np
import shapely

from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.land_features import SpeedBump
from simbev_ros.simulation.world.sumo.traffic import SumoTraffic

_REASON = "speed bump"
_BRAKING_MPS2 = 1.5
_MARGIN_M = 1.0  # before and after a bump, as in Autoware's behavior_velocity_speed_bump_module
_AHEAD_M = np.arange(0.0, 80.0, 1.0)
_SAME_LEVEL_M = 3.0


class SpeedBumps:
    """Limits the speed of vehicles at speed bumps."""

    def __init__(self, bumps: Sequence[SpeedBump], length_m: Float64Array, sumo: SumoTraffic, step_s: float) -> None:
        """For V vehicles off the bumps, with (V,) lengths."""
        hulls = [shapely.convex_hull(shapely.MultiPoint(bump.outline_m[:, :2])) for bump in bumps]
        self._bumps, self._tree = bumps, shapely.STRtree(shapely.buffer(hulls, _MARGIN_M))
        self._length_m, self._traffic, self._step_s = length_m, sumo, step_s
        self._held: dict[int, tuple[float, float]] = {}  # vehicle → speed on a bump, and distance that it lasts for
        self._limited: set[int] = set()

    def slow_down(self) -> None:
        """Limit the speeds of the vehicles near bumps; call it before each step of the traffic."""
        if not self._bumps:
            return
        limits_mps: dict[int, float] = {}
        for vehicle, ahead_m, speed_mps in self._bumps_ahead():
            if ahead_m == 0.0:
                self._held[vehicle] = speed_mps, float(self._length_m[vehicle])
            limit_mps = float(np.sqrt(speed_mps**2 + 2.0 * _BRAKING_MPS2 * ahead_m))
            limits_mps[vehicle] = min(limit_mps, limits_mps.get(vehicle, np.inf))
        for vehicle, (speed_mps, left_m) in self._held.items():
            limits_mps[vehicle] = min(speed_mps, limits_mps.get(vehicle, np.inf))
            self._held[vehicle] = speed_mps, left_m - self._traffic.speed_mps(vehicle) * self._step_s
        self._held = {vehicle: held for vehicle, held in self._held.items() if held[1] > 0.0}
        for vehicle in sorted(self._limited | limits_mps.keys()):
            self._traffic.limit_speed(vehicle, _REASON, limits_mps.get(vehicle))
        self._limited = set(limits_mps)

    def _bumps_ahead(self) -> Iterator[tuple[int, float, float]]:
        """Yield vehicles with bumps on their paths, with the distance to each bump and its speed."""
        distance_m = np.tile(_AHEAD_M, (len(self._length_m), 1))
        ahead_m = self._traffic.ahead_m(np.arange(len(distance_m)), distance_m, np.zeros_like(distance_m))
        paths = np.asarray(shapely.linestrings(ahead_m), object)
        for vehicle, number in self._tree.query(paths, predicate="intersects").T.tolist():
            crossed = overlay.intersection(paths[vehicle], self._tree.geometries[number])
            ends_m, bump = shapely.get_coordinates(crossed, include_z=True), self._bumps[number]
            if len(ends_m) and not abs(ends_m[0, 2] - bump.outline_m[:, 2].mean()) > _SAME_LEVEL_M:  # NaN: any height
                to_bump_m = shapely.line_locate_point(paths[vehicle], shapely.points(ends_m)).min()
                yield vehicle, float(to_bump_m), bump.speed_mps
