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


class Extents:
    """The catalog's models, reduced to the points that can be outermost in some pose."""

    def __init__(self, models: Sequence[ActorModel]) -> None:
        """Prepare models, indexed by blueprint."""
        self._models, self._skeletons = models, Skeletons(models)
        parts = np.array([len(model.parts) for model in models])
        self._first_part, self._is_prepared = ragged_starts(parts), np.zeros(len(models), bool)
        self._first, self._count = np.zeros((2, int(parts.sum())), np.int64)
        self._points_m = np.empty((3, 0), np.float32)

    def bounds(self, actors: Table) -> tuple[Float64Array, Float64Array]:
        """Minimum and maximum x, y, z, each (N, 3), of (N,) ``ACTOR_DTYPE`` actors, each in its own frame, meters."""
        if not len(actors):
            return np.empty((0, 3)), np.empty((0, 3))
        self._prepare(np.unique(actors["blueprint"]))
        shut = actors.copy()
        shut["doors"] = 0
        actor, part = self._skeletons.rows(shut)
        has_points = self._count[part] > 0
        poses, actor, part = self._skeletons.poses(shut)[has_points], actor[has_points], part[has_points]
        low_m, high_m = self._part_bounds(part, poses)
        first = np.flatnonzero(np.diff(actor, prepend=-1))
        return np.minimum.reduceat(low_m, first), np.maximum.reduceat(high_m, first)

    def _prepare(self, blueprints: AnyArray) -> None:
        """Find the points of models that are used for the first time."""
        for blueprint in blueprints[~self._is_prepared[blueprints]].tolist():
            points = _outermost_points(self._models[blueprint])
            own = slice(self._first_part[blueprint], self._first_part[blueprint] + len(points))
            self._count[own] = [len(part) for part in points]
            self._first[own] = self._points_m.shape[1] + ragged_starts(self._count[own])
            self._points_m = np.concatenate([self._points_m, *(part.T for part in points)], axis=1)
            self._is_prepared[blueprint] = True

    def _part_bounds(self, part: AnyArray, poses: Float64Array) -> tuple[Float64Array, Float64Array]:
        """(R, 3) minimum and maximum coordinates of (R,) parts, given their (R, 4, 4) poses."""
        count = self._count[part]
        start = ragged_starts(count)
        index = np.arange(int(count.sum())) + np.repeat(self._first[part] - start, count)
        points_m = self._points_m[:, index]
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
