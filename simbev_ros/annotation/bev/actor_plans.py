"""Actors seen from above: of all their triangles those that may lie under the centre of a cell.

Their meshes are much finer than cells, so nearly all triangles are dropped, before anything is done with them but to
look up where their corners are. Positions are float32 in cells around the ego: within 0.02 mm up to 100 m.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Self

import numpy as np

from simbev_ros.annotation.bev.raster import corners_near_centers
from simbev_ros.assets.actors.actor_model import ActorModel
from simbev_ros.assets.actors.skeletons import Skeletons
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.geometry.grid import BevGrid
from simbev_ros.scene.state import map_from_actors
from simbev_ros.types import Float32Array, Float64Array, Int32Array, Int64Array, Table


class ActorPlans:
    """The models' triangles."""

    def __init__(self, models: Sequence[ActorModel]) -> None:
        """For models, indexed by blueprint."""
        self._plans = [_Plan.of(model.mesh) for model in models]
        self._skeletons = Skeletons(models)

    def corners_near_centers(
        self, actors: Table, cells_from_map: Float64Array, grid: BevGrid
    ) -> tuple[Float64Array, Int64Array]:
        """Triangles of actors in whose bounds a cell's centre lies.

        Args:
            actors: (N,) ``ACTOR_DTYPE``.
            cells_from_map: (2, 3) ``BevGrid.cells_from_map``.
            grid: The cells.

        Returns:
            (2, 3, K) continuous (row, column) of their three corners, and (K,) row of the actor.
        """
        owner, _ = self._skeletons.rows(actors)
        map_from_part = map_from_actors(actors)[owner] @ self._skeletons.poses(actors)
        cells_from_part = (cells_from_map[:, :2] @ map_from_part[:, :2]).swapaxes(0, 1)
        cells_from_part[:, :, 3] += cells_from_map[:, 2:]
        cells_from_part = cells_from_part.astype(np.float32, order="C")
        first = np.searchsorted(owner, np.arange(len(actors)))
        corners, rows = [np.empty((2, 3, 0))], [np.empty(0, np.int64)]
        for blueprint in np.unique(actors["blueprint"]).tolist():
            plan, alike = self._plans[blueprint], np.flatnonzero(actors["blueprint"] == blueprint)
            points_cells = plan.posed(cells_from_part, first[alike])
            near, triangle = corners_near_centers(points_cells, plan.triangles, grid.rows, grid.columns)
            corners.append(near)
            rows.append(alike[triangle // max(len(plan.triangles), 1)])
        return np.concatenate(corners, axis=2), np.concatenate(rows)


@dataclass(frozen=True, slots=True)
class _Plan:
    """A model's mesh with every corner once, part by part.

    Attributes:
        points: (4, V) float32 x, y, z in metres, actor frame, rest pose, and 1.
        triangles: (T, 3).
        parts: Those that have points.
        starts: Where the points of each of them begin, and the end.
    """

    points: Float32Array
    triangles: Int32Array
    parts: tuple[int, ...]
    starts: tuple[int, ...]

    @classmethod
    def of(cls, mesh: Mesh) -> Self:
        """Of a mesh whose vertices are apart where their normals or colours differ."""
        keys = [*mesh.vertices.T, mesh.part]
        order = np.lexsort(keys)
        new = np.append(True, np.any([np.diff(key[order]) != 0 for key in keys], axis=0))[: len(order)]
        number = np.empty(len(order), np.int32)
        number[order] = np.cumsum(new) - 1
        kept = order[new]
        parts, starts = np.unique(mesh.part[kept], return_index=True)
        points = np.vstack([mesh.vertices[kept].T, np.ones(len(kept), np.float32)])
        return cls(points, number[mesh.triangles], tuple(parts.tolist()), (*starts.tolist(), len(kept)))

    def posed(self, cells_from_part: Float32Array, first: Int64Array) -> Float32Array:
        """(2, N, V) rows and columns of N actors whose parts' (2, R, 4) transforms begin at (N,) ``first``."""
        posed = np.empty((2, len(first), self.points.shape[1]), np.float32)
        for part, (start, end) in zip(self.parts, pairwise(self.starts), strict=True):
            np.matmul(cells_from_part[:, first + part], self.points[:, start:end], out=posed[:, :, start:end])
        return posed
