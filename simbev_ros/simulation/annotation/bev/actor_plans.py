"""Plan view of actors for the BEV grid: selects the triangles of posed actors that can cover a cell center.

``BevAnnotator`` passes in the actors near the grid and rasterizes the triangles that leave. Meshes are much finer than
cells, so nearly all triangles are dropped after a lookup of the cells of their corners. Positions are float32 in cells
around the ego, accurate to 0.02 mm up to 100 m.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Self

import numpy as np

from simbev_ros.assets.actors.actor_model import ActorModel
from simbev_ros.assets.actors.skeletons import Skeletons
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.foundation.geometry.grid import BevGrid
from simbev_ros.foundation.on_demand import OnDemand
from simbev_ros.foundation.types import Float32Array, Float64Array, Int32Array, Int64Array, Table
from simbev_ros.schema.scene.state import map_from_actors
from simbev_ros.simulation.annotation.bev.raster import corners_near_centers


class ActorPlans:
    """Plan-view meshes of the actor models, ready to be posed."""

    def __init__(self, models: Sequence[ActorModel]) -> None:
        """Prepare models, indexed by blueprint."""
        self._plans = OnDemand(len(models), lambda blueprint: _Plan.from_mesh(models[blueprint].mesh))
        self._skeletons = Skeletons(models)

    def corners_near_centers(
        self, actors: Table, cells_from_map: Float64Array, grid: BevGrid
    ) -> tuple[Float64Array, Int64Array]:
        """Triangles of actors whose bounding rectangle contains a cell center.

        Args:
            actors: (N,) ``ACTOR_DTYPE``.
            cells_from_map: (2, 3) ``BevGrid.cells_from_map``.
            grid: The BEV grid.

        Returns:
            (2, 3, K) continuous (row, column) of the three corners of each triangle, and (K,) row of its actor.
        """
        owner, _ = self._skeletons.rows(actors)
        map_from_part = map_from_actors(actors)[owner] @ self._skeletons.poses(actors)
        cells_from_part = (cells_from_map[:, :2] @ map_from_part[:, :2]).swapaxes(0, 1)
        cells_from_part[:, :, 3] += cells_from_map[:, 2:]
        cells_from_part = cells_from_part.astype(np.float32, order="C")
        first = np.searchsorted(owner, np.arange(len(actors)))
        corner_parts, row_parts = [np.empty((2, 3, 0))], [np.empty(0, np.int64)]
        for blueprint in np.unique(actors["blueprint"]).tolist():
            plan, same_model = self._plans[blueprint], np.flatnonzero(actors["blueprint"] == blueprint)
            points_cells = plan.pose(cells_from_part, first[same_model])
            corners, triangle = corners_near_centers(points_cells, plan.triangles, grid.rows, grid.columns)
            corner_parts.append(corners)
            row_parts.append(same_model[triangle // max(len(plan.triangles), 1)])
        return np.concatenate(corner_parts, axis=2), np.concatenate(row_parts)


@dataclass(frozen=True, slots=True)
class _Plan:
    """A model's mesh with duplicate vertices merged, ordered by rigid part.

    Attributes:
        points: (4, V) float32 homogeneous positions, m, actor frame, rest pose.
        triangles: (T, 3) int32 indices of points.
        parts: Indices of the parts that have points.
        starts: Index of the first point of each of these parts, then V.
    """

    points: Float32Array
    triangles: Int32Array
    parts: tuple[int, ...]
    starts: tuple[int, ...]

    @classmethod
    def from_mesh(cls, mesh: Mesh) -> Self:
        """Merge the vertices of a mesh that differ only in normal or color."""
        keys = [*mesh.vertices.T, mesh.part]
        order = np.lexsort(keys)
        new = np.append(True, np.any([np.diff(key[order]) != 0 for key in keys], axis=0))[: len(order)]
        number = np.empty(len(order), np.int32)
        number[order] = np.cumsum(new) - 1
        kept = order[new]
        parts, starts = np.unique(mesh.part[kept], return_index=True)
        points = np.vstack([mesh.vertices[kept].T, np.ones(len(kept), np.float32)])
        return cls(points, number[mesh.triangles], tuple(parts.tolist()), (*starts.tolist(), len(kept)))

    def pose(self, cells_from_part: Float32Array, first: Int64Array) -> Float32Array:
        """(2, N, V) rows and columns of N actors; their parts' transforms, (2, R, 4), begin at (N,) ``first``."""
        points_cells = np.empty((2, len(first), self.points.shape[1]), np.float32)
        for part, (start, end) in zip(self.parts, pairwise(self.starts), strict=True):
            np.matmul(cells_from_part[:, first + part], self.points[:, start:end], out=points_cells[:, :, start:end])
        return points_cells
