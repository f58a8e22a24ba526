"""Off-tracking: find turns that are too tight for long vehicles: their rear wheels cut in, and their fronts swing out.

Each body is drawn along every path through a junction, as in the world simulation: a point near the front axle stays on
the lanes' center lines, and the rear axle follows it (a tractrix). If the body reaches deep into lanes or sidewalks
that are not its own, the vehicle must not take this path.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from simbev_ros.foundation.geometry.plan_view import left_of
from simbev_ros.foundation.types import BoolArray, Float64Array, Int64Array
from simbev_ros.maps.network import Lane
from simbev_ros.maps.roads.polylines import Polylines
from simbev_ros.scene.blueprints import Blueprint, VehicleFootprint

_MIN_LONG_M = 5.5  # shorter vehicles fit through every turn
_MIN_RARE_M = 9.0  # longer vehicles are rare enough to wait for others; shorter ones must be able to pass these
_PASSING_CLEARANCE_M = 0.3  # extra room on each side for passing
_STEP_M = 1.0
_APPROACH_M = 20.0  # length of the lanes before and after a junction that is checked
_STRAIGHT_RAD = 0.15
_ASKEW_RAD = 0.04  # a body turned less than this against its path stays within it
_MAX_INTRUSION_LANE_M = 0.6  # cars leave about this much room on each side
_MAX_INTRUSION_SIDEWALK_M = 0.8
_LEVEL_TOLERANCE_M = 2.5


class TurningPaths(NamedTuple):
    """N paths, each from lane to lane, in M samples about a meter apart.

    Attributes:
        point_m: (M, 3) map frame; only the relevant parts of the first and last lanes.
        heading: (M, 2) unit vectors.
        first: (N + 1,) index of each path's first sample, and M.
        own: (N, 2) rows of the first and the last lane.
        decisive: (N,) row of the lane that a vehicle must not take if it does not fit.
    """

    point_m: Float64Array
    heading: Float64Array
    first: Int64Array
    own: Int64Array
    decisive: Int64Array


def is_long(blueprint: Blueprint) -> bool:
    """Whether there are turns that this blueprint might not fit through."""
    return blueprint.train_length_m >= _MIN_LONG_M


def bent_paths(lanes: Sequence[Lane], following: Int64Array) -> TurningPaths:
    """Collect the bent paths: through junctions, and along single lanes outside them.

    Args:
        lanes: Driving lanes.
        following: (K, 2) rows of lanes and their successors.
    """
    after: dict[int, list[int]] = {}
    for row, successor in following.tolist():
        after.setdefault(row, []).append(successor)
    chains = [[row] for row, lane in enumerate(lanes) if not lane.junction]
    open_ends = [[row, successor] for (row,) in chains for successor in after.get(row, ())]
    while open_ends:
        through = [chain for chain in open_ends if lanes[chain[-1]].junction]
        chains += [chain for chain in open_ends if not lanes[chain[-1]].junction]
        open_ends = [[*chain, each] for chain in through for each in after.get(chain[-1], ()) if each not in chain]
    lines_m = [_chain_line(lanes, chain) for chain in chains]
    bent = [index for index, line_m in enumerate(lines_m) if _turn_rad(line_m) > _STRAIGHT_RAD]
    lines = Polylines.from_lines([lines_m[index] for index in bent])
    path, s_m = lines.sample_stations(_STEP_M)
    parameter = lines.parameter(path, s_m)
    return TurningPaths(
        lines.values(parameter),
        lines.headings(parameter),
        np.searchsorted(path, np.arange(len(lines) + 1)),
        np.array([[chains[index][0], chains[index][-1]] for index in bent], np.int64).reshape(-1, 2),
        np.array([chains[index][min(1, len(chains[index]) - 1)] for index in bent], np.int64),
    )


def _chain_line(lanes: Sequence[Lane], chain: list[int]) -> Float64Array:
    """(M, 3) path along a chain of lanes."""
    parts_m = [lanes[row].centerline_m for row in chain]
    if len(chain) > 1:
        parts_m[0] = _clip_start(parts_m[0][::-1])[::-1]
        parts_m[-1] = _clip_start(parts_m[-1])
    return np.concatenate(parts_m)


def _clip_start(line_m: Float64Array) -> Float64Array:
    distance_m = np.cumsum(np.linalg.norm(np.diff(line_m[:, :2], axis=0), axis=1))
    return line_m[: int(np.searchsorted(distance_m, _APPROACH_M)) + 2]


def _turn_rad(line_m: Float64Array) -> float:
    steps_m = np.diff(line_m[:, :2], axis=0)
    steps_m = steps_m[np.any(np.abs(steps_m) > 1e-3, axis=1)]
    return float(np.ptp(np.unwrap(np.arctan2(steps_m[:, 1], steps_m[:, 0])))) if len(steps_m) else 0.0


class TurnObstacles:
    """Areas that turning vehicles must keep off: samples of the center lines of outside lanes and of sidewalks."""

    def __init__(self, driving: Sequence[Lane], sidewalks: Sequence[Lane]) -> None:
        lanes = [*driving, *sidewalks]
        rows = np.array([row for row, lane in enumerate(lanes) if not lane.junction], np.int64)
        lines = Polylines.from_lines([lanes[row].centerline_m for row in rows])
        line, s_m = lines.sample_stations(_STEP_M)
        self._lane = rows[line]  # the sidewalks' rows come after those of the driving lanes
        points_m = lines.values(lines.parameter(line, s_m))
        self._height_m = points_m[:, 2]
        allowed_m = np.where(np.arange(len(lanes)) < len(driving), _MAX_INTRUSION_LANE_M, _MAX_INTRUSION_SIDEWALK_M)
        self._reach_m = (np.array([lane.width_m for lane in lanes]) / 2.0 - allowed_m)[self._lane]
        self._max_reach_m = float(self._reach_m.max(initial=0.0))
        self._tree = cKDTree(points_m[:, :2]) if len(points_m) else None

    def hit_lane(self, point_m: Float64Array) -> Int64Array:
        """(N,) row of the nearest lane to each of (N, 3) points if the point is deep inside it, otherwise -1."""
        if self._tree is None:
            return np.full(len(point_m), -1)
        distance_m, near = self._tree.query(point_m[:, :2], distance_upper_bound=self._max_reach_m)
        near = np.minimum(near, len(self._lane) - 1)
        inside = (distance_m < self._reach_m[near]) & (
            np.abs(self._height_m[near] - point_m[:, 2]) < _LEVEL_TOLERANCE_M
        )
        return np.where(inside, self._lane[near], -1)


def too_tight(bodies: Sequence[VehicleFootprint], paths: TurningPaths, obstacles: TurnObstacles) -> BoolArray:
    """(B, N) whether each of N paths is too tight for each of B vehicles."""
    length_m, width_m, lead_m, axle_m = np.array(bodies, np.float64).reshape(-1, 4).T
    width_m = width_m + 2.0 * _PASSING_CLEARANCE_M * (length_m < _MIN_RARE_M)
    arm_m = np.stack(
        [
            np.stack([axle_m + ahead_m, side * width_m / 2.0], axis=-1)
            for ahead_m in (length_m / 2.0, -axle_m, -length_m / 2.0)
            for side in (1.0, -1.0)
        ],
        axis=1,
    )  # (B, 6, 2) ahead and to the left of the rear axle: corners of the box, and ends of the axle
    samples, trail_m = np.diff(paths.first), (lead_m + axle_m)[:, None]
    is_too_tight: BoolArray = np.zeros((len(bodies), len(samples)), bool)
    path_lane = obstacles.hit_lane(paths.point_m)  # lanes that overlap the path itself
    rear_m = paths.point_m[paths.first[:-1], :2] - trail_m[..., None] * paths.heading[paths.first[:-1]]
    for sample in range(int(samples.max(initial=0))):
        body, path = np.nonzero((samples > sample) & ~is_too_tight)
        here = paths.first[path] + sample
        pull_m = paths.point_m[here, :2] - rear_m[body, path]
        forward = pull_m / np.linalg.norm(pull_m, axis=1, keepdims=True)
        rear_m[body, path] = paths.point_m[here, :2] - trail_m[body] * forward
        left = left_of(forward)
        is_askew = np.abs(np.sum(left * paths.heading[here], axis=1)) > _ASKEW_RAD
        body, path, here, axes = (
            body[is_askew],
            path[is_askew],
            here[is_askew],
            np.stack([forward, left], axis=1)[is_askew],
        )
        corner_m = np.empty((len(path), arm_m.shape[1], 3))
        corner_m[..., :2] = rear_m[body, path][:, None] + arm_m[body] @ axes
        corner_m[..., 2] = paths.point_m[here, 2][:, None]
        hit_lane = obstacles.hit_lane(corner_m.reshape(-1, 3)).reshape(corner_m.shape[:2])
        own = np.column_stack([path_lane[here], paths.own[path]])
        is_too_tight[body, path] = np.any((hit_lane >= 0) & np.all(hit_lane[..., None] != own[:, None], axis=2), axis=1)
    return is_too_tight
