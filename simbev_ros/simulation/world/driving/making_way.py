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
_LOOK_PERIOD_S, _NEAR_M = 0.2, 130.0  # others farther away than this from emergency vehicles do not care


class MakingWay:
    """Lets V vehicles make way for those of them that have emergency lights."""

    def __init__(self, emergency: Sequence[bool], traffic: SumoTraffic, tick_s: float) -> None:
        """For the vehicles of which (V,) have their emergency lights on."""
        self._emergency = np.flatnonzero(emergency)
        self._others = np.flatnonzero(~np.asarray(emergency, bool))
        self._traffic, self._tick_s = traffic, tick_s
        self._look_ticks = max(1, round(_LOOK_PERIOD_S / tick_s))
        self._steps = 0
        self._slowing: dict[int, tuple[float, float]] = {}  # vehicle → its deceleration and minimum speed

    def make_way(self) -> None:
        """Move drivers aside and hold them back; call it before each step of the traffic."""
        if not len(self._emergency) or not len(self._others):
            return
        if self._steps % self._look_ticks == 0:
            before, self._slowing = self._slowing, self._look()
            for vehicle in sorted(before.keys() - self._slowing.keys()):
                self._traffic.limit_speed(vehicle, _REASON, None)
        self._steps += 1
        for vehicle, (mps2, min_mps) in self._slowing.items():
            speed_mps = self._traffic.speed_mps(vehicle)
            self._traffic.limit_speed(vehicle, _REASON, max(speed_mps - mps2 * self._tick_s, min_mps))

    def _look(self) -> dict[int, tuple[float, float]]:
        """Move drivers aside who are in the way; returns who slows down now, and how."""
        slowing: dict[int, tuple[float, float]] = {}
        emergency_m = self._paths_m(self._emergency)
        fronts_m = self._paths_m(self._others, 1)[:, 0]
        is_near = np.linalg.norm(fronts_m[:, None, :2] - emergency_m[None, :, 0, :2], axis=2).min(axis=1) < _NEAR_M
        others = self._others[is_near]
        paths_m = self._paths_m(others)
        for emergency, path_m in zip(self._emergency.tolist(), emergency_m, strict=True):
            if not len(others):
                break
            drives = self._traffic.speed_mps(emergency) > _STANDING_MPS
            gap_m = np.linalg.norm(paths_m[:, 0, None, :2] - path_m[None, :, :2], axis=2)
            level = np.abs(paths_m[:, 0, 2] - path_m[0, 2]) < _NOTICE_M / 10.0
            nearest = gap_m.argmin(axis=1)
            on_path = level & (gap_m.min(axis=1) < _OWN_PATH_M) & (nearest > 0) & (_AHEAD_M[nearest] < _NOTICE_M)
            aligned = np.sum(_headings(paths_m)[:, 0] * _headings(path_m[None])[0, nearest], axis=1) > 0.7
            for row in np.flatnonzero(on_path & aligned).tolist():
                if self._traffic.leave_lane(vehicle := int(others[row])):
                    slowing[vehicle] = _MAKES_WAY_MPS2, _SLOWEST_MPS
            for row in np.flatnonzero(drives & level & ~(on_path & aligned)).tolist():
                vehicle = int(others[row])
                needed_mps2 = self._needed_mps2(vehicle, paths_m[row], path_m)
                if needed_mps2 is not None:
                    slowing[vehicle] = needed_mps2, 0.0
        return slowing

    def _needed_mps2(self, vehicle: int, own_m: Float64Array, path_m: Float64Array) -> float | None:
        """Deceleration to stop before the path of an emergency vehicle that a driver would cross.

        None: the driver does not cross it, cannot stop, or need not brake yet.
        """
        gap_m = np.linalg.norm(own_m[:, None, :2] - path_m[None, :, :2], axis=2)
        meets = np.argwhere(gap_m < _OWN_PATH_M)
        if not len(meets):
            return None
        own, other = meets[0].tolist()
        ahead, across = _headings(own_m[None])[0, own], _headings(path_m[None])[0, other]
        sine = abs(float(ahead[0] * across[1] - ahead[1] * across[0]))
        left_m = float(_AHEAD_M[own]) - _CROSS_STOP_M
        speed_mps = self._traffic.speed_mps(vehicle)
        if sine < _MIN_CROSSING_SINE or speed_mps**2 > 2.0 * _MAX_BRAKING_MPS2 * left_m:
            return None
        needed_mps2 = speed_mps**2 / (2.0 * max(left_m, 0.1))
        return needed_mps2 if needed_mps2 > 2.0 * _MAKES_WAY_MPS2 or left_m < 2.0 else None

    def _paths_m(self, vehicles: Int64Array, points: int = len(_AHEAD_M)) -> Float64Array:
        """(N, K, 3) positions ahead of vehicles, every 2 m."""
        distance_m = np.tile(_AHEAD_M[:points], (len(vehicles), 1))
        return self._traffic.ahead_m(vehicles, distance_m, np.zeros_like(distance_m))


def _headings(path_m: Float64Array) -> Float64Array:
    """(N, K, 2) unit vectors along (N, K, 3) paths."""
    step_m = np.diff(path_m[..., :2], axis=1, append=2.0 * path_m[:, -1:, :2] - path_m[:, -2:-1, :2])
    return step_m / np.maximum(np.linalg.norm(step_m, axis=2, keepdims=True), 1e-9)
