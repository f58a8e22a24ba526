"""The ground as flat facets: an adaptive triangulation that follows a raster of heights within a tolerance.

The facets are the leaves of a balanced quadtree (neighbors differ by one step at most), each cut into triangles that
meet its neighbors' corners, so the surface is continuous (Von Herzen and Barr 1987). Which leaves exist depends only
on heights within a tile's side of them, so regions that are built separately meet exactly.
"""

from dataclasses import dataclass

import numpy as np

from simbev_ros.foundation.types import BoolArray, Float64Array, Int64Array
from simbev_ros.maps.land.membrane import Raster
from simbev_ros.maps.region import Region

TILE_M = 64.0
"""Edge length of the largest facets, and of the tiles that meshes are cut into."""


@dataclass(frozen=True, slots=True)
class Facets:
    """Convex polygons that cover a region without overlap, none of them across the border of a tile.

    A facet is a whole leaf (a square of the quadtree) or a part of one. Diagonals divide a leaf into four sectors, the
    southern one first, then counter-clockwise; the line from a leaf's center to the middle of a side divides a sector
    into two halves.

    Attributes:
        corners_m: (F, K, 2) corners, counter-clockwise, map frame.
        planes: (F, 3, 3) weights of x, y, 1 that give, row by row, the height and its slopes to the east and to the
            north. The slopes are those of the smooth surface, for shading.
        tile: (F, 2) column and row of each facet's tile.
        first_tile: (2,) column and row of the south-western tile.
        leaf_at: For squares with sides of one tile, half a tile and so on: (I, J) index of the leaf, -1 where the
            square is not a leaf.
        middle_m: (L, 2) centers of the leaves.
        sectors: (L, 4, 2) facet of each half of the leaves' sectors.
    """

    corners_m: Float64Array
    planes: Float64Array
    tile: Int64Array
    first_tile: Int64Array
    leaf_at: tuple[Int64Array, ...]
    middle_m: Float64Array
    sectors: Int64Array

    @classmethod
    def from_level_region(cls, region: Region) -> "Facets":
        """Create facets of a flat region at height 0: one square per tile."""
        first, end = np.round(np.reshape(region.area.bounds, (2, 2)) / TILE_M).astype(np.int64)
        leaf_at = np.arange(np.prod(end - first)).reshape(end - first)
        tile = first + np.stack(np.unravel_index(leaf_at.reshape(-1), leaf_at.shape), axis=1)
        corners_m = (tile[:, None] + np.array([[0, 0], [1, 0], [1, 1], [0, 1]])) * TILE_M
        planes, sectors = np.zeros((len(tile), 3, 3)), np.tile(leaf_at.reshape(-1, 1, 1), (1, 4, 2))
        return cls(corners_m, planes, tile, first, (leaf_at,), (tile + 0.5) * TILE_M, sectors)

    @classmethod
    def from_raster(cls, raster: Raster, tolerance_m: Float64Array) -> "Facets":
        """Create facets for a raster of heights without its outermost tile width.

        Args:
            raster: Heights of the ground.
            tolerance_m: Maximum error of the height at each node of the raster.
        """
        corner, spacing_m = raster.origin_m, raster.spacing_m
        leaf_at, center, triangles, sectors = _leaves(raster.values, tolerance_m, margin=round(TILE_M / spacing_m))
        index = np.stack(np.unravel_index(triangles, raster.values.shape), axis=-1)
        xy_m = index * spacing_m + corner
        east, north = np.gradient(raster.values, spacing_m)
        values = np.stack([raster.values, east, north], axis=-1).reshape(-1, 3)[triangles]
        tile = np.floor(xy_m.mean(axis=1) / TILE_M).astype(np.int64)
        first = np.round(corner / TILE_M).astype(np.int64) + 1
        return cls(xy_m, _planes(xy_m, values), tile, first, leaf_at, center * spacing_m + corner, sectors)

    def heights_and_slopes(self, facet: Int64Array, xy_m: Float64Array) -> Float64Array:
        """(N, 3) height and slopes (east, north) at (N, 2) points of the map frame on (N,) facets."""
        return np.einsum("nij,nj->ni", self.planes[facet], np.column_stack([xy_m, np.ones(len(xy_m))]))


def _planes(xy_m: Float64Array, values: Float64Array) -> Float64Array:
    """(T, K, 3) weights of x, y, 1 that give (T, 3, K) values at the (T, 3, 2) corners of triangles."""
    matrix = np.concatenate([xy_m, np.ones((*xy_m.shape[:2], 1))], axis=2)
    return np.swapaxes(np.linalg.solve(matrix, values), 1, 2)


def _leaves(
    node_m: Float64Array, tolerance_m: Float64Array, margin: int
) -> tuple[tuple[Int64Array, ...], Float64Array, Int64Array, Int64Array]:
    """Leaves over (I, J) heights without a margin.

    Returns:
        ``Facets.leaf_at``, the (L, 2) centers of leaves in nodes, the (F, 3) nodes of triangles, ``Facets.sectors``.
    """
    shape, merged = node_m.shape, _merged_blocks(node_m, tolerance_m, round(np.log2(margin)))
    leaf_at, middles, nodes, is_first, total = [], [], [], [], 0
    for step in reversed(range(len(merged))):
        size, whole = 2**step, merged[step].copy()
        can_merge = ~whole & (step > 0)  # nothing is finer than the first step
        if step + 1 < len(merged):
            whole &= ~merged[step + 1].repeat(2, axis=0).repeat(2, axis=1)
        rim = margin // size
        i, j = (index + rim for index in np.nonzero(whole[rim:-rim, rim:-rim]))
        finer = np.stack([can_merge[i, j - 1], can_merge[i + 1, j], can_merge[i, j + 1], can_merge[i - 1, j]], axis=1)
        numbers = np.full(whole.shape, -1)
        numbers[i, j] = total + np.arange(len(i))
        leaf_at.append(numbers[rim:-rim, rim:-rim])
        middles.append((np.stack([i, j], axis=1) + 0.5) * size)
        found, first = _leaf_triangles(i * size, j * size, size, finer, shape)
        nodes.append(found[first])
        is_first.append(first)
        total += len(i)
    sectors = np.cumsum(np.concatenate(is_first).reshape(-1)).reshape(-1, 4, 2) - 1
    return tuple(leaf_at), np.concatenate(middles), np.concatenate(nodes), sectors


def _leaf_triangles(
    i: Int64Array, j: Int64Array, size: int, finer: BoolArray, shape: tuple[int, ...]
) -> tuple[Int64Array, BoolArray]:
    """Triangles of leaves, from their south-western nodes and (N, 4) whether each neighbor (south first) is finer.

    Returns:
        (N, 4, 2, 3) nodes of the triangle of each half of a sector, and (N, 4, 2) whether it differs from the previous.
    """

    def node(east: int, north: int) -> Int64Array:
        return np.ravel_multi_index((i + east, j + north), shape)

    half = size // 2
    corners = np.stack([node(0, 0), node(size, 0), node(size, size), node(0, size)], axis=1)
    middles = np.stack([node(half, 0), node(size, half), node(half, size), node(0, half)], axis=1)
    centers, ends = np.broadcast_to(node(half, half)[:, None], finer.shape), np.roll(corners, -1, axis=1)
    firsts = np.stack([centers, corners, np.where(finer, middles, ends)], axis=2)
    triangles = np.stack([firsts, np.stack([centers, middles, ends], axis=2)], axis=2)
    is_first = np.stack([np.full(finer.shape, True), finer], axis=2)
    plain = ~finer.any(axis=1)
    triangles[plain, 0, 0], triangles[plain, 2, 0] = corners[plain][:, [0, 1, 2]], corners[plain][:, [0, 2, 3]]
    is_first[plain] = np.array([True, False, True, False])[:, None] & np.array([True, False])
    return triangles, is_first


def _merged_blocks(node_m: Float64Array, tolerance_m: Float64Array, steps: int) -> list[BoolArray]:
    """Per block size of 1, 2, 4 … 2^steps nodes: whether each block may be one leaf."""
    merged = [np.full((node_m.shape[0] - 1, node_m.shape[1] - 1), True)]
    for step in range(1, steps + 1):
        can_merge = np.pad(merged[-1], 1, constant_values=True)
        ring = can_merge[:-2, 1:-1] & can_merge[2:, 1:-1] & can_merge[1:-1, :-2] & can_merge[1:-1, 2:] & merged[-1]
        children = ring[0::2, 0::2] & ring[1::2, 0::2] & ring[0::2, 1::2] & ring[1::2, 1::2]
        merged.append(children & (_misfit_in_tolerances(node_m, tolerance_m, 2**step) < 1.0))
    return merged


def _misfit_in_tolerances(node_m: Float64Array, tolerance_m: Float64Array, size: int) -> Float64Array:
    """Per block: upper estimate of its nodes' distance from two triangles over its corners, in units of tolerance."""
    corners = node_m[::size, ::size]
    share = np.arange(size) / size
    rows = np.concatenate([_interpolate_rows(corners, share), corners[-1:]])
    bent = np.abs(node_m - np.concatenate([_interpolate_rows(rows.T, share), rows.T[-1:]]).T)
    twist = np.abs(corners[1:, 1:] + corners[:-1, :-1] - corners[1:, :-1] - corners[:-1, 1:]) / 4.0
    return _block_maximum(bent / tolerance_m, size) + twist * _block_maximum(1.0 / tolerance_m, size)


def _block_maximum(values: Float64Array, size: int) -> Float64Array:
    """Maximum of (I, J) values in each block, including its border."""
    for _ in range(2):
        values = np.maximum(values[:-1], values[1:]).T
    for _ in range(2 * size.bit_length() - 2):
        values = np.maximum(values[0::2], values[1::2]).T
    return values


def _interpolate_rows(rows: Float64Array, share: Float64Array) -> Float64Array:
    """Rows interpolated at fractions between each row and the next."""
    mixed = rows[:-1, None] * (1.0 - share[:, None]) + rows[1:, None] * share[:, None]
    return mixed.reshape(-1, rows.shape[1])
