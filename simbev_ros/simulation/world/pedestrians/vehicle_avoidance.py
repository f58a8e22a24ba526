"""Pedestrians keep off the bodies of vehicles: SUMO's pedestrians avoid lanes, but not the area that bodies sweep.

A pedestrian at the edge of a vehicle's path waits beside it until the vehicle has passed; one in the middle of the path
keeps walking.
"""

import numpy as np
from scipy.spatial import cKDTree

from simbev_ros.foundation.geometry.plan_view import left_of
from simbev_ros.foundation.types import BoolArray, Float64Array, Int64Array
from simbev_ros.simulation.world.kinematics.motion import Bodies
from simbev_ros.simulation.world.kinematics.towing import TowedUnits

_CLEARANCE_M = 0.8  # from the center of a pedestrian to the side of a vehicle
_LOOK_AHEAD_S = 1.0
_EDGE_M = 0.5
_MAX_CURVATURE_PER_M = 0.2
_STANDING_MPS = 0.3
_EVASION_CLEARANCE_M = 0.15  # between a vehicle and a pedestrian who walks around it
_CORNER_S, _WALKING_MPS = 0.08, 2.1  # runners keep farther away: their published paths, averages, cut corners
_LEVEL_TOLERANCE_M = 2.0


class VehicleAvoidance:
    """The vehicles' bodies at SUMO's moment, and how pedestrians keep clear of them.

    Attributes:
        rear_m: (V, 3) the vehicles' rear axles.
        center_m: (V + T, 3) their centers, then those of the units that they tow.
        ahead: (V + T, 2) unit vectors of their headings.
        is_reversing: (V,) whether each of them moves backward.
    """

    def __init__(
        self, bodies: Bodies, point_m: Float64Array, direction: Float64Array, max_mps: Float64Array | float = 0.0
    ) -> None:
        """Start at rest.

        Args:
            bodies: All bodies; the first V are the vehicles', and T towed units follow.
            point_m: (V, 3) their leading points, map frame.
            direction: (V, 3) unit vectors of their headings.
            max_mps: (P,) maximum speeds of the pedestrians.
        """
        vehicles = len(point_m)
        self._trail_m, self._lead_m = bodies.trail_m[:vehicles, None], bodies.lead_m[:vehicles, None]
        self._half_m = bodies.boxes.size_m[: bodies.boxes.vehicles, :2] / 2.0
        self._leader, self._towed_lead_m = bodies.towing.leader, bodies.lead_m[bodies.towed, None]
        clearance_m = _EVASION_CLEARANCE_M + _CORNER_S * np.maximum(max_mps - _WALKING_MPS, 0.0)
        self._reach_m = bodies.boxes.size_m[bodies.boxes.vehicles :, 0] / 2.0 + clearance_m
        self._point_m = point_m
        self.rear_m = point_m - self._trail_m * direction
        self._towed_units = TowedUnits(bodies.towing, point_m, direction)
        self._place(direction)
        self.is_reversing: BoolArray = np.zeros(vehicles, bool)

    def rest_crashed(self, vehicle: Int64Array, center_m: Float64Array, yaw_rad: Float64Array) -> None:
        """Keep (N,) crashed bodies where they come to rest, at (N, 3), instead of where SUMO has them."""
        self.center_m[vehicle] = center_m
        self.ahead[vehicle] = np.column_stack([np.cos(yaw_rad), np.sin(yaw_rad)])

    def avoid_bodies(self, pedestrian_m: Float64Array, max_m: Float64Array) -> Float64Array:
        """Push pedestrians, now at (P, 3), out of vehicles' bodies by at most (P,) meters; returns their positions."""
        reach_m = np.hypot(*self._half_m.T) + self._reach_m.max(initial=0.0)
        near = cKDTree(pedestrian_m[:, :2]).query_ball_point(self.center_m[:, :2], reach_m)
        vehicle = np.repeat(np.arange(len(near)), [len(each) for each in near])
        pedestrian = np.array([each for some in near for each in some], np.int64)
        ahead = self.ahead[vehicle]
        axes = np.stack([ahead, left_of(ahead)], axis=1)
        gap_m = pedestrian_m[pedestrian] - self.center_m[vehicle]
        local_m = np.einsum("nai,ni->na", axes, gap_m[:, :2])
        depth_m = self._half_m[vehicle] + self._reach_m[pedestrian, None] - np.abs(local_m)
        axis = np.argmin(depth_m, axis=1)
        row = np.arange(len(axis))
        inside = np.flatnonzero((depth_m[row, axis] > 0.0) & (np.abs(gap_m[:, 2]) < _LEVEL_TOLERANCE_M))
        push_m = np.sign(local_m) * np.minimum(depth_m, max_m[pedestrian, None])
        position_m = pedestrian_m.copy()
        position_m[:, :2] += _sum_by_pedestrian(
            (push_m[row, axis, None] * axes[row, axis])[inside], pedestrian[inside], len(position_m)
        )
        return position_m

    def avoid_paths(
        self,
        point_m: Float64Array,
        axle_m: Float64Array,
        may_reverse: BoolArray,
        pedestrian_m: Float64Array,
        desired_m: Float64Array,
        tick_s: float,
    ) -> Float64Array:
        """(P, 3) positions that pedestrians may desire one tick later: beside the paths of vehicles that they graze.

        Args:
            point_m: (V, 3) the vehicles' leading points.
            axle_m: (V, 3) rear axles that their drivers know; NaN: the axle is towed.
            may_reverse: (V,) whether their drivers may drive backward.
            pedestrian_m: (P, 3) current positions of the pedestrians.
            desired_m: (P, 3) their desired positions.
            tick_s: Length of the tick.
        """
        to_point_m = point_m - np.where(np.isnan(axle_m), self.rear_m, axle_m)
        forward = to_point_m / np.linalg.norm(to_point_m, axis=1, keepdims=True)
        old_to_point_m = self._point_m - self.rear_m
        turn_rad = (old_to_point_m[:, 0] * to_point_m[:, 1] - old_to_point_m[:, 1] * to_point_m[:, 0]) / self._trail_m[
            :, 0
        ] ** 2
        is_backward = np.einsum("vi,vi->v", point_m - self._point_m, forward) < 0.0
        self.is_reversing = is_backward & may_reverse
        step_m = np.linalg.norm(point_m - self._point_m, axis=1)
        curvature_per_m = np.clip(turn_rad / np.maximum(step_m, 1e-9), -_MAX_CURVATURE_PER_M, _MAX_CURVATURE_PER_M)
        speed_mps = step_m / tick_s
        self._point_m, self.rear_m = point_m, point_m - self._trail_m * forward
        self._towed_units.follow(point_m, forward)
        self._place(forward)
        center_m, leader = self.center_m, self._leader
        speed_mps, is_reversing = (np.append(each, each[leader]) for each in (speed_mps, self.is_reversing))
        curvature_per_m = np.append(curvature_per_m, np.zeros(len(leader)))
        driving = np.flatnonzero(speed_mps > _STANDING_MPS)
        if not len(driving) or not len(desired_m):
            return desired_m
        reach_m = self._half_m[:, 0] + _CLEARANCE_M + speed_mps * _LOOK_AHEAD_S
        near = cKDTree(desired_m).query_ball_point(center_m[driving], (reach_m + self._half_m[:, 1])[driving])
        vehicle = np.repeat(driving, [len(each) for each in near])
        pedestrian: Int64Array = np.concatenate(near).astype(np.int64)
        ahead = self.ahead[vehicle]
        left = left_of(ahead)
        travel = np.where(is_reversing[vehicle], -1.0, 1.0)
        gap_m = (desired_m[pedestrian] - center_m[vehicle])[:, :2]
        along_m = travel * np.sum(gap_m * ahead, axis=1)
        path_offset_m = travel * curvature_per_m[vehicle] * np.maximum(along_m, 0.0) ** 2 / 2.0
        offset_m = np.sum((pedestrian_m[pedestrian] - center_m[vehicle])[:, :2] * left, axis=1) - path_offset_m
        side = np.sign(offset_m)
        lacking_m = self._half_m[vehicle, 1] + _CLEARANCE_M - side * (np.sum(gap_m * left, axis=1) - path_offset_m)
        is_near = (along_m > -self._half_m[vehicle, 0] - _CLEARANCE_M) & (along_m < reach_m[vehicle])
        is_grazed = is_near & (lacking_m > 0.0) & (np.abs(offset_m) > self._half_m[vehicle, 1] - _EDGE_M)
        position_m = desired_m.copy()
        step_m = (side * lacking_m)[:, None] * left
        position_m[:, :2] += _sum_by_pedestrian(step_m[is_grazed], pedestrian[is_grazed], len(position_m))
        return position_m

    def _place(self, forward: Float64Array) -> None:
        """Set centers and headings of vehicles with (V, 3) headings, and of what they tow."""
        units = self._towed_units
        towed_m = units.hitch_m - self._towed_lead_m * units.forward
        self.center_m: Float64Array = np.concatenate([self._point_m - self._lead_m * forward, towed_m])
        plan = np.concatenate([forward, units.forward])[:, :2]
        self.ahead: Float64Array = plan / np.linalg.norm(plan, axis=1, keepdims=True)


def _sum_by_pedestrian(step_m: Float64Array, pedestrian: Int64Array, count: int) -> Float64Array:
    """(P, 2) sums of (N, 2) steps over each of the (N,) pedestrians' indices."""
    return np.stack([np.bincount(pedestrian, column, count) for column in step_m.T], axis=1)
