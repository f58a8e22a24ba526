"""Bounds of actors in their current pose, so that boxes fit a stride, a turned handlebar or a steered wheel.

``boxes.boxes`` uses them for the sizes of ground-truth boxes. Doors count as shut: an open door is not part of a
vehicle's box, whereas limbs are part of a pedestrian's, as in nuScenes (annotator instructions, "Extremities").
"""

from collections.abc import Sequence

import numpy as np

from simbev_ros.assets.actors.actor_model import ActorModel
from simbev_ros.assets.actors.skeletons import Skeletons
from simbev_ros.foundation.geometry.ragged import ragged_starts
from simbev_ros.foundation.types import AnyArray, Float64Array, Table
from simbev_ros.schema.scene.state import ACTOR_DTYPE
from simbev_ros.simulation.annotation.parts.outermost import outermost_points
from simbev_ros.simulation.annotation.parts.part_rows import PartRows

_POSE_COLUMNS = ("id", "blueprint", "wheel", "gait", "steer", "vx", "vy")
"""Columns that decide where an actor's parts are in its own frame."""
_POSE_DTYPE = np.dtype([(name, ACTOR_DTYPE[name]) for name in _POSE_COLUMNS])


class Extents:
    """The catalog's models, reduced to the points that can be outermost in some pose."""

    def __init__(self, models: Sequence[ActorModel]) -> None:
        """Prepare models, indexed by blueprint."""
        self._skeletons, self._points = Skeletons(models), PartRows(models, outermost_points)
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
