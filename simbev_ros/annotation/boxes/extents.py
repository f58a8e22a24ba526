"""How far actors reach as they are posed now, so that boxes fit a stride, a turned handlebar or a steered wheel.

Doors count as shut: what sticks out of a vehicle for a moment is not part of its box, whereas limbs are part of a
person's, as in nuScenes (annotator instructions, "Extremities").
"""

from collections.abc import Sequence

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from simbev_ros.assets.actors.actor_model import ActorModel
from simbev_ros.assets.actors.skeletons import Skeletons
from simbev_ros.types import AnyArray, BoolArray, Float32Array, Float64Array, Table


class Extents:
    """The catalogue's shapes, reduced to the points that can be outermost."""

    def __init__(self, models: Sequence[ActorModel]) -> None:
        """For models, indexed by blueprint."""
        self._skeletons = Skeletons(models)
        points = [part for model in models for part in _outermost(model)]
        self._count = np.array([len(part) for part in points])
        self._first = np.cumsum(self._count) - self._count
        self._points_m = np.concatenate([np.empty((0, 3), np.float32), *points]).T.copy()

    def of(self, actors: Table) -> tuple[Float64Array, Float64Array]:
        """Lowest and highest x, y and z, each (N, 3), of (N,) ``ACTOR_DTYPE`` actors, each in its own frame, metres."""
        if not len(actors):
            return np.empty((0, 3)), np.empty((0, 3))
        shut = actors.copy()
        shut["doors"] = 0
        actor, part = self._skeletons.rows(shut)
        reaching = self._count[part] > 0
        poses, actor, part = self._skeletons.poses(shut)[reaching], actor[reaching], part[reaching]
        low_m, high_m = self._of_parts(part, poses)
        first = np.flatnonzero(np.diff(actor, prepend=-1))
        return np.minimum.reduceat(low_m, first), np.maximum.reduceat(high_m, first)

    def _of_parts(self, part: AnyArray, poses: Float64Array) -> tuple[Float64Array, Float64Array]:
        """(R, 3) lowest and highest coordinates of (R,) parts, by their (R, 4, 4) poses."""
        count = self._count[part]
        start = np.cumsum(count) - count
        place = np.arange(int(count.sum())) + np.repeat(self._first[part] - start, count)
        points_m = self._points_m[:, place]
        turns = np.repeat(poses[:, :3, :3].reshape(-1, 9).T.astype(np.float32), count, axis=1).reshape(3, 3, -1)
        posed_m = np.einsum("ijk,jk->ik", turns, points_m)
        low_m, high_m = (np.asarray(each.reduceat(posed_m, start, axis=1).T) for each in (np.minimum, np.maximum))
        return low_m + poses[:, :3, 3], high_m + poses[:, :3, 3]


def _outermost(model: ActorModel) -> list[Float32Array]:
    """The points of each part, (P, 3), that can be outermost: of all that never moves the corners of its bounds."""
    moves = _moves(model)
    of_part = [model.mesh.vertices[model.mesh.part == index] for index in range(len(model.parts))]
    if moves[0]:
        return [_hull(points) for points in of_part]
    still = np.concatenate([points for points, away in zip(of_part, moves, strict=True) if not away])
    corners = np.stack(np.meshgrid(*np.stack([still.min(axis=0), still.max(axis=0)]).T), axis=-1).reshape(-1, 3)
    moving = [_hull(points) if away else points[:0] for points, away in zip(of_part, moves, strict=True)]
    return [corners, *moving[1:]]


def _moves(model: ActorModel) -> BoolArray:
    """(P,) whether a part moves by anything but doors."""
    moves = np.full(len(model.parts), model.cycle is not None)
    for index, part in enumerate(model.parts):
        moves[index] |= part.spins or part.steers or part.cranks or (part.parent >= 0 and moves[part.parent])
    return moves


def _hull(points: Float32Array) -> Float32Array:
    """Those of (P, 3) points that are corners of their convex hull."""
    try:
        corners: Float32Array = points[ConvexHull(points).vertices]
    except QhullError:  # all in a plane
        corners = np.unique(points, axis=0)
    return corners
