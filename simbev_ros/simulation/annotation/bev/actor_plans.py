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
from simbev_ros.foundation.geometry.ragged import ragged_indices
from simbev_ros.foundation.types import BoolArray, Float32Array, Float64Array, Int64Array, Table
from simbev_ros.schema.scene.state import map_from_actors
from simbev_ros.simulation.annotation.bev.raster import near_centers
from simbev_ros.simulation.annotation.part_rows import PartRows

_BLOCK = 8
"""Triangles per block: smaller blocks are dropped more often, but there are more of them."""

_LARGE_M = 0.15
"""Triangles larger than this have blocks of their own, so that those of small ones stay small."""

_VOXEL_M = 0.02
_SPREAD = ((np.arange(1 << 10)[:, None] >> np.arange(10) & 1) << 3 * np.arange(10)).sum(axis=1)
"""Voxels that follow each other in Morton order are neighbors: numbers of 10 bits, with two zeros after each bit."""

_ROUNDING_CELLS, _ROUNDING = 1e-3, 1e-6
"""Upper bound of the errors of float32 positions: absolute, and relative to the number of cells along an axis."""


class ActorPlans:
    """Meshes of the actor models in blocks, ready to be posed."""

    def __init__(self, models: Sequence[ActorModel]) -> None:
        """Prepare models, indexed by blueprint."""
        self._skeletons = Skeletons(models)
        self._blocks = PartRows(models, _blocks)
        self._bounds_m = np.ascontiguousarray(PartRows(models, _bounds).values.T)

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
        return corners[:, :, near].astype(np.float64), chosen[owner[row[near // _BLOCK]]]

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
    corners = np.empty((2, 3, len(corners_m), _BLOCK), np.float32)
    several = corners_m[:lone] @ np.ascontiguousarray(cells_from_part[:lone].swapaxes(1, 2))
    corners[:, :, :lone] = several.reshape(-1, 3, _BLOCK, 2).transpose(3, 1, 0, 2)
    single = cells_from_part[lone:, :, None] @ corners_m[lone:, None].swapaxes(2, 3)
    corners[:, :, lone:] = single.reshape(-1, 2, 3, _BLOCK).transpose(1, 2, 0, 3)
    return corners.reshape(2, 3, -1)


def _blocks(model: ActorModel) -> list[Float32Array]:
    """The triangles of each part in blocks, (C, 3 B, 4) homogeneous: first, second and third corners of B triangles.

    A block that is not full repeats its last triangle.
    """
    mesh = model.mesh
    corners_m = mesh.vertices[mesh.triangles]
    low_m, high_m = corners_m.min(axis=1), corners_m.max(axis=1)
    part, is_large = mesh.part[mesh.triangles[:, 0]], (high_m - low_m).max(axis=1) > _LARGE_M
    order = np.lexsort((_morton((low_m + high_m) / 2), is_large, part))
    group = 2 * part[order].astype(np.int64) + is_large[order]
    first = np.flatnonzero(np.diff(group, prepend=-1))
    end = np.append(first[1:], len(order))
    of_group, number = ragged_indices(-(-(end - first) // _BLOCK))
    index = np.minimum((first[of_group] + number * _BLOCK)[:, None] + np.arange(_BLOCK), end[of_group, None] - 1)
    points_m = corners_m[order[index]].swapaxes(1, 2).reshape(-1, 3 * _BLOCK, 3)
    blocks = np.concatenate([points_m, np.ones_like(points_m[:, :, :1])], axis=2)
    ends = np.cumsum(np.bincount(group[first[of_group]] // 2, minlength=len(model.parts)))
    return np.split(blocks, ends[:-1])


def _bounds(model: ActorModel) -> list[Float32Array]:
    """(C, 6) centers and half extents of the bounds of the blocks of each part."""
    bounds = []
    for corners_m in _blocks(model):
        low_m, high_m = corners_m[:, :, :3].min(axis=1), corners_m[:, :, :3].max(axis=1)
        bounds.append(np.concatenate([(low_m + high_m) / 2, (high_m - low_m) / 2], axis=1))
    return bounds


def _morton(points_m: Float32Array) -> Int64Array:
    """(T,) Morton codes of (T, 3) points: neighbors in space have mostly similar codes."""
    lowest_m = points_m.min(axis=0, initial=np.inf)
    x, y, z = ((points_m - lowest_m) / _VOXEL_M).astype(np.int64).clip(max=len(_SPREAD) - 1).T
    return _SPREAD[x] | _SPREAD[y] << 1 | _SPREAD[z] << 2
