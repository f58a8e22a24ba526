"""People keep off the bodies of vehicles: SUMO's keep off lanes, but know nothing of what bodies sweep.

Who is beside a vehicle's way, or just inside of it, stays beside until it has passed; who is in its middle goes on.
"""

import numpy as np
from scipy.spatial import cKDTree

from simbev_ros.types import Float64Array, Int64Array
from simbev_ros.world.kinematics.motion import Bodies

_CLEARANCE_M = 0.8  # from the middle of a person to the side of a vehicle
_AHEAD_S = 1.0
_INSIDE_M = 0.5
_SHARPEST_PER_M = 0.2
_STANDING_MPS = 0.3
_AIR_M = 0.15  # between a vehicle and who walks around it
_LEVEL_M = 2.0


class Berth:
    """Where vehicles' bodies are at SUMO's moment, and how people make room for them.

    Attributes:
        rear_m: (V, 3) the vehicles' rear axles.
        center_m: (V, 3) their middles.
        ahead: (V, 2) unit vectors in which they look.
    """

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
        self._reach_m = bodies.boxes.size_m[vehicles:, 0] / 2.0 + _AIR_M
        self._point_m = point_m
        self.rear_m = point_m - self._trail_m * direction
        self.center_m = point_m - self._lead_m * direction
        self.ahead: Float64Array = direction[:, :2] / np.linalg.norm(direction[:, :2], axis=1, keepdims=True)

    def rest(self, vehicle: Int64Array, center_m: Float64Array, yaw_rad: Float64Array) -> None:
        """Let (N,) vehicles that have had collisions be where they come to rest, at (N, 3), not where SUMO has them."""
        self.center_m[vehicle] = center_m
        self.ahead[vehicle] = np.column_stack([np.cos(yaw_rad), np.sin(yaw_rad)])

    def keep_off(self, pedestrian_m: Float64Array, most_m: Float64Array) -> Float64Array:
        """(P, 3) places of people beside vehicles' bodies, who are at (P, 3) now; by (P,) metres away at most."""
        reach_m = np.hypot(*self._half_m.T) + self._reach_m.max(initial=0.0)
        near = cKDTree(pedestrian_m[:, :2]).query_ball_point(self.center_m[:, :2], reach_m)
        vehicle = np.repeat(np.arange(len(near)), [len(each) for each in near])
        person = np.array([each for some in near for each in some], np.int64)
        ahead = self.ahead[vehicle]
        axes = np.stack([ahead, np.column_stack([-ahead[:, 1], ahead[:, 0]])], axis=1)
        gap_m = pedestrian_m[person] - self.center_m[vehicle]
        local_m = np.einsum("nai,ni->na", axes, gap_m[:, :2])
        deep_m = self._half_m[vehicle] + self._reach_m[person, None] - np.abs(local_m)
        axis = np.argmin(deep_m, axis=1)
        row = np.arange(len(axis))
        inside = np.flatnonzero((deep_m[row, axis] > 0.0) & (np.abs(gap_m[:, 2]) < _LEVEL_M))
        push_m = np.sign(local_m) * np.minimum(deep_m, most_m[person, None])
        place_m = pedestrian_m.copy()
        place_m[:, :2] += _sums((push_m[row, axis, None] * axes[row, axis])[inside], person[inside], len(place_m))
        return place_m

    def advance(
        self, point_m: Float64Array, pedestrian_m: Float64Array, wanted_m: Float64Array, tick_s: float
    ) -> Float64Array:
        """(P, 3) where people may want to be, one tick later.

        Args:
            point_m: (V, 3) the vehicles' points.
            pedestrian_m: (P, 3) where people are.
            wanted_m: (P, 3) where they want to be.
            tick_s: Length of the tick.
        """
        pull_m = point_m - self.rear_m
        forward = pull_m / np.linalg.norm(pull_m, axis=1, keepdims=True)
        was_m = self._point_m - self.rear_m
        turn_rad = (was_m[:, 0] * pull_m[:, 1] - was_m[:, 1] * pull_m[:, 0]) / self._trail_m[:, 0] ** 2
        step_m = np.linalg.norm(point_m - self._point_m, axis=1)
        bend_per_m = np.clip(turn_rad / np.maximum(step_m, 1e-9), -_SHARPEST_PER_M, _SHARPEST_PER_M)
        speed_mps = step_m / tick_s
        self._point_m, self.rear_m = point_m, point_m - self._trail_m * forward
        self.center_m = center_m = point_m - self._lead_m * forward
        self.ahead = forward[:, :2] / np.linalg.norm(forward[:, :2], axis=1, keepdims=True)
        drives = np.flatnonzero(speed_mps > _STANDING_MPS)
        if not len(drives) or not len(wanted_m):
            return wanted_m
        reach_m = self._half_m[:, 0] + _CLEARANCE_M + speed_mps * _AHEAD_S
        near = cKDTree(wanted_m).query_ball_point(center_m[drives], (reach_m + self._half_m[:, 1])[drives])
        vehicle = np.repeat(drives, [len(each) for each in near])
        person: Int64Array = np.concatenate(near).astype(np.int64)
        ahead = self.ahead[vehicle]
        left = np.column_stack([-ahead[:, 1], ahead[:, 0]])
        gap_m = (wanted_m[person] - center_m[vehicle])[:, :2]
        along_m = np.sum(gap_m * ahead, axis=1)
        way_aside_m = bend_per_m[vehicle] * np.maximum(along_m, 0.0) ** 2 / 2.0
        is_aside_m = np.sum((pedestrian_m[person] - center_m[vehicle])[:, :2] * left, axis=1) - way_aside_m
        side = np.sign(is_aside_m)
        short_m = self._half_m[vehicle, 1] + _CLEARANCE_M - side * (np.sum(gap_m * left, axis=1) - way_aside_m)
        near_it = (along_m > -self._half_m[vehicle, 0] - _CLEARANCE_M) & (along_m < reach_m[vehicle])
        grazed = near_it & (short_m > 0.0) & (np.abs(is_aside_m) > self._half_m[vehicle, 1] - _INSIDE_M)
        place_m = wanted_m.copy()
        step_m = (side * short_m)[:, None] * left
        place_m[:, :2] += _sums(step_m[grazed], person[grazed], len(place_m))
        return place_m


def _sums(step_m: Float64Array, person: Int64Array, people: int) -> Float64Array:
    """(P, 2) sums of (N, 2) steps of (N,) people."""
    return np.stack([np.bincount(person, column, people) for column in step_m.T], axis=1)
