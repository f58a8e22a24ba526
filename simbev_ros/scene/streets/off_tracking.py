"""Which turns are too tight for long vehicles: their rear wheels cut them, their fronts swing out.

A body is drawn along each way through a junction as in the world's motion: a point near its front axle keeps to the
lanes' middle, and the rear axle follows (a tractrix). Where it reaches deep into lanes or sidewalks that are not its
own, the way is not for that vehicle.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from simbev_ros.maps.network import Lane
from simbev_ros.maps.roads.polylines import Polylines
from simbev_ros.scene.blueprints import Blueprint, Footprint
from simbev_ros.types import BoolArray, Float64Array, Int64Array

_LONG_M = 5.5  # shorter vehicles fit everywhere
_RARE_M = 9.0  # longer ones are so few that they may wait until others have left; the rest must get past those
_PASSING_M = 0.3  # so much more room they need on each side
_STEP_M = 1.0
_APPROACH_M = 20.0  # of the lanes before and behind a junction
_STRAIGHT_RAD = 0.15
_ASKEW_RAD = 0.04  # who is less turned against its way keeps to it
_INTO_LANES_M = 0.6  # cars leave about as much room on each side
_ONTO_SIDEWALKS_M = 0.8
_OTHER_LEVEL_M = 2.5


class Ways(NamedTuple):
    """N ways, each from lane to lane, in M samples about a metre apart.

    Attributes:
        point_m: (M, 3) map frame; without more of the first and last lane than matters.
        heading: (M, 2) unit vectors.
        first: (N + 1,) number of each way's first sample, and M.
        own: (N, 2) rows of the first and the last lane.
        decisive: (N,) row of the lane that one must not take who does not fit.
    """

    point_m: Float64Array
    heading: Float64Array
    first: Int64Array
    own: Int64Array
    decisive: Int64Array


def is_long(blueprint: Blueprint) -> bool:
    """Whether there are turns that it might not fit."""
    return blueprint.size_m[0] >= _LONG_M


def bent_ways(lanes: Sequence[Lane], following: Int64Array) -> Ways:
    """Of the ways through junctions and of the lanes outside, those that bend.

    Args:
        lanes: Driving lanes.
        following: (K, 2) rows of lanes and of those that follow them.
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
    lines_m = [_line(lanes, chain) for chain in chains]
    bent = [index for index, line_m in enumerate(lines_m) if _turn_rad(line_m) > _STRAIGHT_RAD]
    lines = Polylines.of([lines_m[index] for index in bent])
    way, s_m = lines.places(_STEP_M)
    place = lines.parameter(way, s_m)
    return Ways(
        lines.values(place),
        lines.headings(place),
        np.searchsorted(way, np.arange(len(lines) + 1)),
        np.array([[chains[index][0], chains[index][-1]] for index in bent], np.int64).reshape(-1, 2),
        np.array([chains[index][min(1, len(chains[index]) - 1)] for index in bent], np.int64),
    )


def _line(lanes: Sequence[Lane], chain: list[int]) -> Float64Array:
    """(M, 3) way along lanes."""
    parts_m = [lanes[row].centerline_m for row in chain]
    if len(chain) > 1:
        parts_m[0] = _beginning(parts_m[0][::-1])[::-1]
        parts_m[-1] = _beginning(parts_m[-1])
    return np.concatenate(parts_m)


def _beginning(line_m: Float64Array) -> Float64Array:
    way_m = np.cumsum(np.linalg.norm(np.diff(line_m[:, :2], axis=0), axis=1))
    return line_m[: int(np.searchsorted(way_m, _APPROACH_M)) + 2]


def _turn_rad(line_m: Float64Array) -> float:
    steps_m = np.diff(line_m[:, :2], axis=0)
    steps_m = steps_m[np.any(np.abs(steps_m) > 1e-3, axis=1)]
    return float(np.ptp(np.unwrap(np.arctan2(steps_m[:, 1], steps_m[:, 0])))) if len(steps_m) else 0.0


class Obstacles:
    """What a vehicle must keep off: samples of the middles of lanes outside junctions and of sidewalks."""

    def __init__(self, driving: Sequence[Lane], sidewalks: Sequence[Lane]) -> None:
        lanes = [*driving, *sidewalks]
        rows = np.array([row for row, lane in enumerate(lanes) if not lane.junction], np.int64)
        lines = Polylines.of([lanes[row].centerline_m for row in rows])
        line, s_m = lines.places(_STEP_M)
        self._lane = rows[line]  # sidewalks have rows of their own behind those of the driving lanes
        points_m = lines.values(lines.parameter(line, s_m))
        self._height_m = points_m[:, 2]
        spare_m = np.where(np.arange(len(lanes)) < len(driving), _INTO_LANES_M, _ONTO_SIDEWALKS_M)
        self._reach_m = (np.array([lane.width_m for lane in lanes]) / 2.0 - spare_m)[self._lane]
        self._farthest_m = float(self._reach_m.max(initial=0.0))
        self._tree = cKDTree(points_m[:, :2]) if len(points_m) else None

    def hit(self, point_m: Float64Array) -> Int64Array:
        """(N,) row of the lane that each of (N, 3) points is nearest to, if it is in it; else -1."""
        if self._tree is None:
            return np.full(len(point_m), -1)
        distance_m, near = self._tree.query(point_m[:, :2], distance_upper_bound=self._farthest_m)
        near = np.minimum(near, len(self._lane) - 1)
        inside = (distance_m < self._reach_m[near]) & (np.abs(self._height_m[near] - point_m[:, 2]) < _OTHER_LEVEL_M)
        return np.where(inside, self._lane[near], -1)


def unfit(bodies: Sequence[Footprint], ways: Ways, obstacles: Obstacles) -> BoolArray:
    """(B, N) whether each of B vehicles does not fit each of N ways."""
    length_m, width_m, lead_m, axle_m = np.array(bodies, np.float64).reshape(-1, 4).T
    width_m = width_m + 2.0 * _PASSING_M * (length_m < _RARE_M)
    arm_m = np.stack(
        [
            np.stack([axle_m + ahead_m, side * width_m / 2.0], axis=-1)
            for ahead_m in (length_m / 2.0, -axle_m, -length_m / 2.0)
            for side in (1.0, -1.0)
        ],
        axis=1,
    )  # (B, 6, 2) from the rear axle ahead and to the left: corners of the box, and ends of the axle
    samples, trail_m = np.diff(ways.first), (lead_m + axle_m)[:, None]
    bad: BoolArray = np.zeros((len(bodies), len(samples)), bool)
    through = obstacles.hit(ways.point_m)  # lanes that overlap the way itself
    rear_m = ways.point_m[ways.first[:-1], :2] - trail_m[..., None] * ways.heading[ways.first[:-1]]
    for sample in range(int(samples.max(initial=0))):
        body, way = np.nonzero((samples > sample) & ~bad)
        here = ways.first[way] + sample
        pull_m = ways.point_m[here, :2] - rear_m[body, way]
        forward = pull_m / np.linalg.norm(pull_m, axis=1, keepdims=True)
        rear_m[body, way] = ways.point_m[here, :2] - trail_m[body] * forward
        left = np.column_stack([-forward[:, 1], forward[:, 0]])
        askew = np.abs(np.sum(left * ways.heading[here], axis=1)) > _ASKEW_RAD
        body, way, here, axes = body[askew], way[askew], here[askew], np.stack([forward, left], axis=1)[askew]
        corner_m = np.empty((len(way), arm_m.shape[1], 3))
        corner_m[..., :2] = rear_m[body, way][:, None] + arm_m[body] @ axes
        corner_m[..., 2] = ways.point_m[here, 2][:, None]
        hit = obstacles.hit(corner_m.reshape(-1, 3)).reshape(corner_m.shape[:2])
        own = np.column_stack([through[here], ways.own[way]])
        bad[body, way] = np.any((hit >= 0) & np.all(hit[..., None] != own[:, None], axis=2), axis=1)
    return bad
