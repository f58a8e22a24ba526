"""Keeping clear of what stands beside a lane, whose doors may open: the line is led aside, as far as the lane has room.

Where it has too little, the vehicle is slow enough to stop for a door.
"""

import numpy as np

from simbev_ros.reference_stack.arrays import Floats
from simbev_ros.reference_stack.driving.others import Occupied, Others
from simbev_ros.reference_stack.driving.route_line import RouteLine

_STANDING_MPS, _SEEN_M = 0.1, 80.0
_DOOR_M, _CLEAR_M, _BESIDE_M = 1.0, 1.6, 0.6  # an open door, the wanted distance, and what may be in the path
_SIDEWAYS_MPS, _SLOPES, _LEAD_M = 0.3, (0.03, 0.12), 3.0  # to the side: speed, by distance; completed this far before
_STEP_M = 0.02
_BRAKED_S = 0.8  # time that an opening door leaves for braking, after the reaction


class KeepingClear:
    """Leads one vehicle along one route.

    Args:
        route: The route.
        width_m: Width of the vehicle.
        room_m: (N,) how far it may be off the route's points to either side; None: it follows the route as it is.
        braking_mps2: Deceleration that the road allows.
    """

    def __init__(self, route: RouteLine, width_m: float, room_m: Floats | None, braking_mps2: float) -> None:
        self._is_still, room_m = room_m is None, np.zeros_like(route.distance_m) if room_m is None else room_m
        run_m = _SLOPES[0] * route.distance_m
        room_m = np.minimum.accumulate(room_m - run_m) + run_m
        room_m = np.minimum.accumulate((room_m + run_m)[::-1])[::-1] - run_m
        self._route, self._width_m, self._room_m = route, width_m, room_m
        self._careful_mps = 2.0 * braking_mps2 * _BRAKED_S
        self._left_m, self._limit_mps, self._line = np.zeros_like(room_m), np.full_like(room_m, np.inf), route

    def line_at(self, distance_m: float, speed_mps: float, others: Others) -> RouteLine:
        """The line to follow from a distance along the route on, where it is as before, at a speed."""
        if self._is_still:
            return self._route
        slope = float(np.clip(_SIDEWAYS_MPS / max(speed_mps, 0.1), *_SLOPES))
        others = others.chosen(np.linalg.norm(others.velocity_mps, axis=1) < _STANDING_MPS)
        window_m = (distance_m - 10.0, distance_m + _SEEN_M)
        now = Occupied.by(others, self._route, window_m, np.zeros(1), self._width_m)
        begin_m, end_m, near_m = now.begin_m[:, 0], now.end_m[:, 0], now.left_m[:, 0]
        gap_m = np.abs(near_m) - self._width_m / 2.0
        beside = (gap_m > -_BESIDE_M) & (gap_m < _CLEAR_M)
        along_m, sides_m = self._route.distance_m, np.zeros((2, len(self._room_m)))
        limit_mps = np.full(len(self._room_m), np.inf)
        for row in np.flatnonzero(beside).tolist():
            away_m = np.maximum(np.maximum(begin_m[row] - along_m, along_m - end_m[row]) - _LEAD_M, 0.0)
            side_m = sides_m[int(near_m[row] > 0.0)]
            np.maximum(side_m, _CLEAR_M - gap_m[row] - slope * away_m, out=side_m)
            is_tight = (away_m == 0.0) & (gap_m[row] + self._room_m < _DOOR_M)
            limit_mps[is_tight] = self._careful_mps
        left_m = np.clip(sides_m[0] - sides_m[1], -self._room_m, self._room_m)
        here_m, ahead_m = np.interp(distance_m, along_m, self._left_m), np.maximum(along_m - distance_m, 0.0)
        left_m = np.clip(left_m, here_m - slope * ahead_m, here_m + slope * ahead_m)
        left_m = np.where(along_m < distance_m, self._left_m, left_m)
        if np.abs(left_m - self._left_m).max() > _STEP_M or np.any(limit_mps != self._limit_mps):
            self._left_m, self._limit_mps, self._line = left_m, limit_mps, self._route.shifted(left_m, limit_mps)
        return self._line
