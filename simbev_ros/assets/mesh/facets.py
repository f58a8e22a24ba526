"""The ground as flat facets: a triangulation of a region that follows a raster of heights as closely as is needed.

Leaves of a balanced quadtree (neighbours differ by one step at most), each cut into triangles that meet its neighbours'
corners, so the surface is continuous (Von Herzen and Barr 1987). Which leaves there are depends only on heights within
a tile's side of them, so regions that are built apart meet exactly.
"""

from dataclasses import dataclass

import numpy as np

from simbev_ros.maps.land.membrane import Raster
from simbev_ros.maps.region import Region
from simbev_ros.types import BoolArray, Float64Array, Int64Array

TILE_M = 64.0
"""Side of the largest facets, and of the tiles that meshes are cut into."""


@dataclass(frozen=True, slots=True)
class Facets:
    """Convex polygons that cover a region and overlap nowhere, none across the border of a tile.

    Each is a leaf, a square, or a part of one. Diagonals divide a leaf into four sectors, the southern one first, then
    counter-clockwise, and the line from a leaf's middle to that of its side divides a sector into two halves.

    Attributes:
        corners_m: (F, K, 2) corners, counter-clockwise, map frame.
        planes: (F, 3, 3) rows: height, its slope to the east, its slope to the north; each the weights of x, y, 1. The
            slopes are the smooth surface's, for shading.
        tile: (F, 2) column and row of the tile that each lies in.
        first_tile: (2,) column and row of the south-western one.
        leaf_at: For squares with sides of a tile, half of one and so on: (I, J) the leaf, -1 where it is none.
        middle_m: (L, 2) middles of the leaves.
        sectors: (L, 4, 2) facet of each half of their sectors.
    """

    corners_m: Float64Array
    planes: Float64Array
    tile: Int64Array
    first_tile: Int64Array
    leaf_at: tuple[Int64Array, ...]
    middle_m: Float64Array
    sectors: Int64Array

    @classmethod
    def level(cls, region: Region) -> "Facets":
        """A region at height 0: a square per tile."""
        first, end = np.round(np.reshape(region.area.bounds, (2, 2)) / TILE_M).astype(np.int64)
        leaf_at = np.arange(np.prod(end - first)).reshape(end - first)
        tile = first + np.stack(np.unravel_index(leaf_at.reshape(-1), leaf_at.shape), axis=1)
        corners_m = (tile[:, None] + np.array([[0, 0], [1, 0], [1, 1], [0, 1]])) * TILE_M
        planes, sectors = np.zeros((len(tile), 3, 3)), np.tile(leaf_at.reshape(-1, 1, 1), (1, 4, 2))
        return cls(corners_m, planes, tile, first, (leaf_at,), (tile + 0.5) * TILE_M, sectors)

    @classmethod
    def of(cls, raster: Raster, tolerance_m: Float64Array) -> "Facets":
        """Facets of all but a tile's width around a raster of heights; ``tolerance_m`` at each of its nodes."""
        corner, spacing_m = raster.origin_m, raster.spacing_m
        leaf_at, center, triangles, sectors = _leaves(raster.values, tolerance_m, margin=round(TILE_M / spacing_m))
        index = np.stack(np.unravel_index(triangles, raster.values.shape), axis=-1)
        xy_m = index * spacing_m + corner
        east, north = np.gradient(raster.values, spacing_m)
        values = np.stack([raster.values, east, north], axis=-1).reshape(-1, 3)[triangles]
        tile = np.floor(xy_m.mean(axis=1) / TILE_M).astype(np.int64)
        first = np.round(corner / TILE_M).astype(np.int64) + 1
        return cls(xy_m, _planes(xy_m, values), tile, first, leaf_at, center * spacing_m + corner, sectors)

    def at(self, facet: Int64Array, xy_m: Float64Array) -> Float64Array:
        """(N, 3) height and slopes at (N, 2) points, each on the facet of an (N,) index."""
        values: Float64Array = np.einsum("nij,nj->ni", self.planes[facet], np.column_stack([xy_m, np.ones(len(xy_m))]))
        return values


def _planes(xy_m: Float64Array, values: Float64Array) -> Float64Array:
    """(T, K, 3) weights of x, y, 1 that give (T, 3, K) values at the (T, 3, 2) corners of triangles."""
    matrix = np.concatenate([xy_m, np.ones((*xy_m.shape[:2], 1))], axis=2)
    weights: Float64Array = np.swapaxes(np.linalg.solve(matrix, values), 1, 2)
    return weights


def _leaves(
    node_m: Float64Array, tolerance_m: Float64Array, margin: int
) -> tuple[tuple[Int64Array, ...], Float64Array, Int64Array, Int64Array]:
    """Leaves over all but a margin of (I, J) heights.

    Returns:
        ``Facets.leaf_at``, the (L, 2) middles of leaves in nodes, the (F, 3) nodes of triangles, ``Facets.sectors``.
    """
    shape, merged = node_m.shape, _merged_blocks(node_m, tolerance_m, round(np.log2(margin)))
    leaf_at, middles, nodes, is_first, total = [], [], [], [], 0
    for step in reversed(range(len(merged))):
        size, whole = 2**step, merged[step].copy()
        around = ~whole & (step > 0)  # nothing is finer than the first step
        if step + 1 < len(merged):
            whole &= ~merged[step + 1].repeat(2, axis=0).repeat(2, axis=1)
        rim = margin // size
        i, j = (index + rim for index in np.nonzero(whole[rim:-rim, rim:-rim]))
        finer = np.stack([around[i, j - 1], around[i + 1, j], around[i, j + 1], around[i - 1, j]], axis=1)
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
    """Triangles of leaves, from their south-western nodes and (N, 4) which neighbours, from the south on, are finer.

    Returns:
        (N, 4, 2, 3) nodes of the triangle of each half of a sector, and which of them are not the one before.
    """

    def node(east: int, north: int) -> Int64Array:
        index: Int64Array = np.ravel_multi_index((i + east, j + north), shape)
        return index

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
    """For block sides of 1, 2, 4 … 2^steps nodes: which blocks may be one leaf."""
    merged = [np.full((node_m.shape[0] - 1, node_m.shape[1] - 1), True)]
    for step in range(1, steps + 1):
        around = np.pad(merged[-1], 1, constant_values=True)
        ring = around[:-2, 1:-1] & around[2:, 1:-1] & around[1:-1, :-2] & around[1:-1, 2:] & merged[-1]
        children = ring[0::2, 0::2] & ring[1::2, 0::2] & ring[0::2, 1::2] & ring[1::2, 1::2]
        merged.append(children & (_misfit(node_m, tolerance_m, 2**step) < 1.0))
    return merged


def _misfit(node_m: Float64Array, tolerance_m: Float64Array, size: int) -> Float64Array:
    """Per block: how far its nodes lie off two triangles over its corners, at most about, in tolerances."""
    corners = node_m[::size, ::size]
    share = np.arange(size) / size
    rows = np.concatenate([_between(corners, share), corners[-1:]])
    bent = np.abs(node_m - np.concatenate([_between(rows.T, share), rows.T[-1:]]).T)
    twist = np.abs(corners[1:, 1:] + corners[:-1, :-1] - corners[1:, :-1] - corners[:-1, 1:]) / 4.0
    misfit: Float64Array = _largest(bent / tolerance_m, size) + twist * _largest(1.0 / tolerance_m, size)
    return misfit


def _largest(values: Float64Array, size: int) -> Float64Array:
    """The largest of (I, J) values in each block, its border included."""
    for _ in range(2):
        values = np.maximum(values[:-1], values[1:]).T
    for _ in range(2 * size.bit_length() - 2):
        values = np.maximum(values[0::2], values[1::2]).T
    return values


def _between(rows: Float64Array, share: Float64Array) -> Float64Array:
    """Rows at shares between each and the next."""
    mixed = rows[:-1, None] * (1.0 - share[:, None]) + rows[1:, None] * share[:, None]
    return mixed.reshape(-1, rows.shape[1])
