"""People step aside for vehicles that cut corners: SUMO's keep off lanes, but know nothing of what bodies sweep."""

import numpy as np
from scipy.spatial import cKDTree

from simbev_ros.types import Float64Array, Int64Array
from simbev_ros.world.motion import Bodies

_CLEARANCE_M = 0.6  # from the middle of a person to the side of a vehicle
_DEEP_M = 0.5  # who is further than this inside of a vehicle's way crosses it and cannot step aside
_AHEAD_S = 0.6
_STANDING_MPS = 0.3


class Berth:
    """Where vehicles' bodies are at SUMO's moment, and how people make room for them."""

    def __init__(self, bodies: Bodies, point_m: Float64Array, direction: Float64Array) -> None:
        """At rest.

        Args:
            bodies: The first V follow points.
            point_m: (V, 3) these points, map frame.
            direction: (V, 3) unit vectors in which the vehicles look.
        """
        vehicles = len(point_m)
        self._trail_m, self._lead_m = bodies.trail_m[:vehicles, None], bodies.lead_m[:vehicles, None]
        self._half_m = bodies.boxes.size_m[:vehicles, :2] / 2.0
        self._point_m = point_m
        self._rear_m = point_m - self._trail_m * direction

    def advance(self, point_m: Float64Array, pedestrian_m: Float64Array, tick_s: float) -> Float64Array:
        """(P, 3) places of people who want to be at (P, 3), one tick later, while vehicles' points are at (V, 3)."""
        pull_m = point_m - self._rear_m
        forward = pull_m / np.linalg.norm(pull_m, axis=1, keepdims=True)
        speed_mps = np.linalg.norm(point_m - self._point_m, axis=1) / tick_s
        self._point_m, self._rear_m = point_m, point_m - self._trail_m * forward
        drives = np.flatnonzero(speed_mps > _STANDING_MPS)
        if not len(drives) or not len(pedestrian_m):
            return pedestrian_m
        center_m = point_m - self._lead_m * forward
        reach_m = self._half_m[:, 0] + _CLEARANCE_M + speed_mps * _AHEAD_S
        near = cKDTree(pedestrian_m).query_ball_point(center_m[drives], (reach_m + self._half_m[:, 1])[drives])
        vehicle = np.repeat(drives, [len(each) for each in near])
        person: Int64Array = np.concatenate(near).astype(np.int64)
        gap_m = (pedestrian_m[person] - center_m[vehicle])[:, :2]
        ahead = forward[vehicle, :2] / np.linalg.norm(forward[vehicle, :2], axis=1, keepdims=True)
        left = np.column_stack([-ahead[:, 1], ahead[:, 0]])
        along_m, aside_m = np.sum(gap_m * ahead, axis=1), np.sum(gap_m * left, axis=1)
        short_m = self._half_m[vehicle, 1] + _CLEARANCE_M - np.abs(aside_m)
        beside = (along_m > -self._half_m[vehicle, 0] - _CLEARANCE_M) & (along_m < reach_m[vehicle])
        grazed = beside & (short_m > 0.0) & (short_m < _CLEARANCE_M + _DEEP_M)
        place_m = pedestrian_m.copy()
        step_m = (np.sign(aside_m) * short_m)[:, None] * left
        np.add.at(place_m, (person[grazed][:, None], [0, 1]), step_m[grazed])
        return place_m
