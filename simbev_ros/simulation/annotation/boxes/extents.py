"""Bounds of actors in their current pose, so that boxes fit a stride, a turned handlebar or a steered wheel.

``boxes.boxes`` uses them for the sizes of ground-truth boxes. Doors count as shut: an open door is not part of a
vehicle's box, whereas limbs are part of a pedestrian's, as in nuScenes (annotator instructions, "Extremities").
"""

from collections.abc import Sequence

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from simbev_ros.assets.actors.actor_model import ActorModel
from simbev_ros.assets.actors.skeletons import Skeletons
from simbev_ros.foundation.geometry.ragged import ragged_starts
from simbev_ros.foundation.types import AnyArray, BoolArray, Float32Array, Float64Array, Table
from simbev_ros.schema.scene.state import ACTOR_DTYPE
from simbev_ros.simulation.annotation.part_rows import PartRows

_POSE_COLUMNS = ("id", "blueprint", "wheel", "gait", "steer", "vx", "vy")
"""Columns that decide where an actor's parts are in its own frame."""
_POSE_DTYPE = np.dtype([(name, ACTOR_DTYPE[name]) for name in _POSE_COLUMNS])


class Extents:
    """The catalog's models, reduced to the points that can be outermost in some pose."""

    def __init__(self, models: Sequence[ActorModel]) -> None:
        """Prepare models, indexed by blueprint."""
        self._skeletons, self._points = Skeletons(models), PartRows(models, _outermost_points)
        self._points_m = np.ascontiguousarray(self._points.values.T)
        self._latest = np.empty(0, _POSE_DTYPE)
        self._latest_bounds_m = np.empty((2, 0, 3))

    def bounds(self, actors: Table) -> tuple[Float64Array, Float64Array]:
        """Minimum and maximum x, y, z, each (N, 3), of (N,) ``ACTOR_DTYPE`` actors, each in its own frame, meters.

        Those of actors whose parts have not moved since the last call are kept.
        """
        latest = np.zeros(len(actors), _POSE_DTYPE)
        for name in _POSE_COLUMNS:
            latest[name] = actors[name]
        _, row, row_before = np.intersect1d(actors["id"], self._latest["id"], return_indices=True)
        is_same = latest[row] == self._latest[row_before]
        moves, bounds_m = np.ones(len(actors), bool), np.empty((2, len(actors), 3))
        moves[row[is_same]] = False
        bounds_m[:, row[is_same]] = self._latest_bounds_m[:, row_before[is_same]]
        if moves.any():
            bounds_m[:, moves] = self._moved_bounds(actors[moves])
        self._latest, self._latest_bounds_m = latest, bounds_m
        return bounds_m[0], bounds_m[1]

    def _moved_bounds(self, actors: Table) -> tuple[Float64Array, Float64Array]:
        """Result of ``bounds`` for at least one actor."""
        shut = actors.copy()
        shut["doors"] = 0
        actor, part = self._skeletons.rows(shut)
        has_points = self._points.count[part] > 0
        poses, actor, part = self._skeletons.poses(shut)[has_points], actor[has_points], part[has_points]
        low_m, high_m = self._part_bounds(part, poses)
        first = np.flatnonzero(np.diff(actor, prepend=-1))
        return np.minimum.reduceat(low_m, first), np.maximum.reduceat(high_m, first)

    def _part_bounds(self, part: AnyArray, poses: Float64Array) -> tuple[Float64Array, Float64Array]:
        """(R, 3) minimum and maximum coordinates of (R,) parts, given their (R, 4, 4) poses."""
        count = self._points.count[part]
        start = ragged_starts(count)
        points_m = np.take(self._points_m, self._points.indices(part), axis=1)
        turns = np.repeat(poses[:, :3, :3].reshape(-1, 9).T.astype(np.float32), count, axis=1).reshape(3, 3, -1)
        posed_m = np.einsum("ijk,jk->ik", turns, points_m)
        low_m, high_m = (np.asarray(each.reduceat(posed_m, start, axis=1).T) for each in (np.minimum, np.maximum))
        return low_m + poses[:, :3, 3], high_m + poses[:, :3, 3]


def _outermost_points(model: ActorModel) -> list[Float32Array]:
    """Points of each part, (P, 3), that can be outermost; for static parts together, the corners of their bounds."""
    moves = _moving_parts(model)
    points_of_part = [model.mesh.vertices[model.mesh.part == index] for index in range(len(model.parts))]
    if moves[0]:
        return [_hull(points) for points in points_of_part]
    static = np.concatenate([points for points, is_moving in zip(points_of_part, moves, strict=True) if not is_moving])
    corners = np.stack(np.meshgrid(*np.stack([static.min(axis=0), static.max(axis=0)]).T), axis=-1).reshape(-1, 3)
    moving_points = [
        _hull(points) if is_moving else points[:0] for points, is_moving in zip(points_of_part, moves, strict=True)
    ]
    return [corners, *moving_points[1:]]


def _moving_parts(model: ActorModel) -> BoolArray:
    """(P,) whether a part moves, other than as a door."""
    moves = np.full(len(model.parts), model.cycle is not None)
    for index, part in enumerate(model.parts):
        moves[index] |= part.spins or part.steers or part.cranks or (part.parent >= 0 and moves[part.parent])
    return moves


def _hull(points: Float32Array) -> Float32Array:
    """The corners of the convex hull of (P, 3) points."""
    try:
        corners: Float32Array = points[ConvexHull(points).vertices]
    except QhullError:  # all points in one plane
        corners = np.unique(points, axis=0)
    return corners
