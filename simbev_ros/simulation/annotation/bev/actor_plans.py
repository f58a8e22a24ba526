"""Plan view of actors for the BEV grid: selects the triangles of posed actors that can cover a cell center.

``BevAnnotator`` passes in the actors near the grid and rasterizes the triangles that leave. Meshes are much finer than
cells, so they are divided into blocks of neighboring triangles. Most blocks are dropped because their bounds contain no
cell center, and so are most triangles of the others. Positions are float32 in cells around the ego, accurate to 0.02 mm
up to 100 m.
"""

from collections.abc import Sequence

import numpy as np

from simbev_ros.assets.actors.actor_model import ActorModel
from simbev_ros.assets.actors.skeletons import Skeletons
from simbev_ros.foundation.geometry.grid import BevGrid
from simbev_ros.foundation.types import BoolArray, Float32Array, Float64Array, Int64Array, Table
from simbev_ros.schema.scene.state import map_from_actors
from simbev_ros.simulation.annotation.bev.raster import near_centers
from simbev_ros.simulation.annotation.parts.blocks import BLOCK, block_bounds, blocks
from simbev_ros.simulation.annotation.parts.part_rows import PartRows

_ROUNDING_CELLS, _ROUNDING = 1e-3, 1e-6
"""Upper bound of the errors of float32 positions: absolute, and relative to the number of cells along an axis."""


class ActorPlans:
    """Meshes of the actor models in blocks, ready to be posed."""

    def __init__(self, models: Sequence[ActorModel]) -> None:
        """Prepare models, indexed by blueprint."""
        self._skeletons = Skeletons(models)
        self._blocks = PartRows(models, blocks)
        self._bounds_m = np.ascontiguousarray(PartRows(models, block_bounds).values.T)

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
        if not len(actors):
            return np.empty((2, 3, 0)), np.empty(0, np.int64)
        is_lone = np.bincount(actors["blueprint"])[actors["blueprint"]] == 1
        inside = np.flatnonzero(_near_grid(actors, cells_from_map, grid))
        chosen = inside[np.argsort(is_lone[inside], kind="stable")]
        actors, first_lone = actors[chosen], len(chosen) - np.count_nonzero(is_lone[chosen])
        owner, part = self._skeletons.rows(actors)
        map_from_part = map_from_actors(actors)[owner] @ self._skeletons.poses(actors)
        in_cells = cells_from_map[:, :2] @ map_from_part[:, :2]
        in_cells[:, :, 3] += cells_from_map[:, 2]
        cells_from_part = in_cells.astype(np.float32)
        row, block = self._near_blocks(cells_from_part, part, grid)
        lone = int(np.searchsorted(row, np.searchsorted(owner, first_lone)))
        corners = _pose(cells_from_part.take(row, axis=0), self._blocks.values.take(block, axis=0), lone)
        near = np.flatnonzero(near_centers(corners, grid.rows, grid.columns))
        return corners[:, :, near].astype(np.float64), chosen[owner[row[near // BLOCK]]]

    def _near_blocks(
        self, cells_from_part: Float32Array, part: Int64Array, grid: BevGrid
    ) -> tuple[Int64Array, Int64Array]:
        """Blocks with a cell center in their bounds: (K,) row of the (R,) parts and (K,) index of the block."""
        count, block = self._blocks.count[part], self._blocks.indices(part)
        bounds_m = np.take(self._bounds_m, block, axis=1)
        near = np.ones(len(block), bool)
        for axis, cells in enumerate((grid.rows, grid.columns)):
            x, y, z, offset = np.repeat(np.ascontiguousarray(cells_from_part[:, axis].T), count, axis=1)
            center = x * bounds_m[0] + y * bounds_m[1] + z * bounds_m[2] + offset
            reach = np.abs(x) * bounds_m[3] + np.abs(y) * bounds_m[4] + np.abs(z) * bounds_m[5]
            slack = np.float32(_ROUNDING_CELLS + _ROUNDING * cells)
            near &= np.abs(center - np.rint(center).clip(0, cells - 1)) <= reach + slack
        return np.repeat(np.arange(len(part)), count)[near], block[near]


def _near_grid(actors: Table, cells_from_map: Float64Array, grid: BevGrid) -> BoolArray:
    """(N,) whether actors can touch the grid."""
    position = cells_from_map[:, :2] @ np.stack([actors["x"], actors["y"]]) + cells_from_map[:, 2:]
    reach = np.hypot(actors["length"], actors["width"]) / grid.cell_m
    size = np.array([[grid.rows], [grid.columns]])
    return ((position > -reach) & (position < size + reach)).all(axis=0)


def _pose(cells_from_part: Float32Array, corners_m: Float32Array, lone: int) -> Float32Array:
    """(2, 3, K B) row and column of the three corners of the triangles of (K,) blocks.

    The order in which BLAS adds decides the last bit. It differs for actors that are the only ones of their model;
    their blocks are those from ``lone`` on.
    """
    corners = np.empty((2, 3, len(corners_m), BLOCK), np.float32)
    several = corners_m[:lone] @ np.ascontiguousarray(cells_from_part[:lone].swapaxes(1, 2))
    corners[:, :, :lone] = several.reshape(-1, 3, BLOCK, 2).transpose(3, 1, 0, 2)
    single = cells_from_part[lone:, :, None] @ corners_m[lone:, None].swapaxes(2, 3)
    corners[:, :, lone:] = single.reshape(-1, 2, 3, BLOCK).transpose(1, 2, 0, 3)
    return corners.reshape(2, 3, -1)
