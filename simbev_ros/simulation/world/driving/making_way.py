"""Drivers make way for vehicles with emergency lights: they leave its lane, and do not cross its path.

SUMO's own device for blue lights moves others by half a meter within their lanes, which is too little to pass. Here,
the vehicles ahead on the same lane slow down and change to another one; where there is none, they drive on. Crossing
traffic stops before the path of the emergency vehicle, which itself ignores lights.
"""

from collections.abc import Sequence

import numpy as np

from simbev_ros.foundation.types import Float64Array, Int64Array
from simbev_ros.simulation.world.sumo.traffic import SumoTraffic

_REASON = "blue lights"
_AHEAD_M = np.arange(0.0, 62.0, 2.0)
_NOTICE_M = 50.0  # distance at which drivers ahead notice the lights
_OWN_PATH_M = 2.0  # from the path of the emergency vehicle: ahead of it, not beside it
_MAKES_WAY_MPS2 = 1.0
_SLOWEST_MPS = 4.0  # of those who move aside
_CROSS_STOP_M = 7.0  # from a front that stops to the path that it would cross
_MAX_BRAKING_MPS2 = 6.0
_MIN_CROSSING_SINE = 0.35
_STANDING_MPS = 0.5


class MakingWay:
    """Lets V vehicles make way for those of them that have emergency lights."""

    def __init__(self, emergency: Sequence[bool], traffic: SumoTraffic, tick_s: float) -> None:
        """For the vehicles of which (V,) have their emergency lights on."""
        self._emergency = np.flatnonzero(emergency)
        self._others = np.flatnonzero(~np.asarray(emergency, bool))
        self._traffic, self._tick_s = traffic, tick_s
        self._limited: set[int] = set()

    def make_way(self) -> None:
        """Move drivers aside and hold them back; call it before each step of the traffic."""
        if not len(self._emergency) or not len(self._others):
            return
        limits_mps: dict[int, float] = {}
        paths_m = self._paths_m(self._others)
        for emergency, path_m in zip(self._emergency.tolist(), self._paths_m(self._emergency), strict=True):
            drives = self._traffic.speed_mps(emergency) > _STANDING_MPS
            gap_m = np.linalg.norm(paths_m[:, 0, None, :2] - path_m[None, :, :2], axis=2)
            level = np.abs(paths_m[:, 0, 2] - path_m[0, 2]) < _NOTICE_M / 10.0
            nearest = gap_m.argmin(axis=1)
            on_path = level & (gap_m.min(axis=1) < _OWN_PATH_M) & (nearest > 0) & (_AHEAD_M[nearest] < _NOTICE_M)
            aligned = np.sum(_headings(paths_m)[:, 0] * _headings(path_m[None])[0, nearest], axis=1) > 0.7
            for row in np.flatnonzero(on_path & aligned).tolist():
                vehicle = int(self._others[row])
                if self._traffic.leave_lane(vehicle):
                    slower_mps = self._traffic.speed_mps(vehicle) - _MAKES_WAY_MPS2 * self._tick_s
                    limits_mps[vehicle] = max(slower_mps, _SLOWEST_MPS)
            for row in np.flatnonzero(drives & level & ~(on_path & aligned)).tolist():
                self._stop_before(int(self._others[row]), paths_m[row], path_m, limits_mps)
        for vehicle in sorted(self._limited | limits_mps.keys()):
            self._traffic.limit_speed(vehicle, _REASON, limits_mps.get(vehicle))
        self._limited = set(limits_mps)

    def _stop_before(
        self, vehicle: int, own_m: Float64Array, path_m: Float64Array, limits_mps: dict[int, float]
    ) -> None:
        """Let a driver stop before the path of an emergency vehicle that it would cross, if it can."""
        gap_m = np.linalg.norm(own_m[:, None, :2] - path_m[None, :, :2], axis=2)
        meets = np.argwhere(gap_m < _OWN_PATH_M)
        if not len(meets):
            return
        own, other = meets[0].tolist()
        ahead, across = _headings(own_m[None])[0, own], _headings(path_m[None])[0, other]
        sine = abs(float(ahead[0] * across[1] - ahead[1] * across[0]))
        left_m = float(_AHEAD_M[own]) - _CROSS_STOP_M
        speed_mps = self._traffic.speed_mps(vehicle)
        if sine < _MIN_CROSSING_SINE or speed_mps**2 > 2.0 * _MAX_BRAKING_MPS2 * left_m:
            return
        needed_mps2 = speed_mps**2 / (2.0 * max(left_m, 0.1))
        if needed_mps2 > _MAKES_WAY_MPS2 * 2.0 or left_m < 2.0:
            limits_mps[vehicle] = max(speed_mps - needed_mps2 * self._tick_s, 0.0)

    def _paths_m(self, vehicles: Int64Array) -> Float64Array:
        """(N, K, 3) positions ahead of vehicles, every 2 m."""
        distance_m = np.tile(_AHEAD_M, (len(vehicles), 1))
        return self._traffic.ahead_m(vehicles, distance_m, np.zeros_like(distance_m))


def _headings(path_m: Float64Array) -> Float64Array:
    """(N, K, 2) unit vectors along (N, K, 3) paths."""
    step_m = np.diff(path_m[..., :2], axis=1, append=2.0 * path_m[:, -1:, :2] - path_m[:, -2:-1, :2])
    return step_m / np.maximum(np.linalg.norm(step_m, axis=2, keepdims=True), 1e-9)
