"""Reduces an actor model to the points that can be outermost in some pose, with its doors shut."""

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from simbev_ros.assets.actors.actor_model import ActorModel
from simbev_ros.foundation.types import BoolArray, Float32Array


def outermost_points(model: ActorModel) -> list[Float32Array]:
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
        moves[index] |= part.spins > 0.0 or part.steers or part.cranks or (part.parent >= 0 and moves[part.parent])
    return moves


def _hull(points: Float32Array) -> Float32Array:
    """The corners of the convex hull of (P, 3) points."""
    try:
        corners: Float32Array = points[ConvexHull(points).vertices]
    except QhullError:  # all points in one plane
        corners = np.unique(points, axis=0)
    return corners
