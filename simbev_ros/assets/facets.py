"""The ground as flat facets: a triangulation of a region that follows a raster of heights as closely as is needed.

Leaves of a balanced quadtree (neighbours differ by one step at most), each cut into triangles that meet its neighbours'
corners, so the surface is continuous (Von Herzen and Barr 1987). Which leaves there are depends only on heights within
a tile's side of them, so regions that are built apart meet exactly.
"""

from dataclasses import dataclass

import numpy as np
import shapely

from simbev_ros.maps.land.membrane import Raster
from simbev_ros.maps.region import Region
from simbev_ros.types import BoolArray, Float64Array, Int64Array

TILE_M = 64.0
"""Side of the largest facets, and of the tiles that meshes are cut into."""


@dataclass(frozen=True, slots=True)
class Facets:
    """Convex polygons that cover a region and overlap nowhere, none across the border of a tile.

    Attributes:
        polygons: (F,) shapely polygons, map frame.
        planes: (F, 3, 3) rows: height, its slope to the east, its slope to the north; each the weights of x, y, 1. The
            slopes are the smooth surface's, for shading.
        tile: (F, 2) column and row of the tile that each lies in.
        tree: Of the polygons.
    """

    polygons: np.ndarray[tuple[int], np.dtype[np.object_]]
    planes: Float64Array
    tile: Int64Array
    tree: shapely.STRtree

    @classmethod
    def level(cls, region: Region) -> "Facets":
        """A region at height 0: a square per tile."""
        x0, y0, x1, y1 = region.area.bounds
        x_m, y_m = (axis.reshape(-1) for axis in np.meshgrid(np.arange(x0, x1, TILE_M), np.arange(y0, y1, TILE_M)))
        return cls._of(shapely.box(x_m, y_m, x_m + TILE_M, y_m + TILE_M), np.zeros((len(x_m), 3, 3)))

    @classmethod
    def of(cls, raster: Raster, tolerance_m: Float64Array) -> "Facets":
        """Facets of all but a tile's width around a raster of heights; ``tolerance_m`` at each of its nodes."""
        corner, spacing_m = raster.origin_m, raster.spacing_m
        triangles = _triangles(raster.values, tolerance_m, margin=round(TILE_M / spacing_m))
        index = np.stack(np.unravel_index(triangles, raster.values.shape), axis=-1)
        xy_m = index * spacing_m + corner
        east, north = np.gradient(raster.values, spacing_m)
        values = np.stack([raster.values, east, north], axis=-1).reshape(-1, 3)[triangles]
        return cls._of(np.asarray(shapely.polygons(xy_m), object), _planes(xy_m, values))

    @classmethod
    def _of(cls, polygons: np.ndarray[tuple[int], np.dtype[np.object_]], planes: Float64Array) -> "Facets":
        low_m, high_m = np.split(shapely.bounds(polygons), 2, axis=1)
        tile = np.floor((low_m + high_m) / (2.0 * TILE_M)).astype(np.int64)
        return cls(polygons, planes, tile, shapely.STRtree(polygons))

    def at(self, facet: Int64Array, xy_m: Float64Array) -> Float64Array:
        """(N, 3) height and slopes at (N, 2) points, each on the facet of an (N,) index."""
        values: Float64Array = np.einsum("nij,nj->ni", self.planes[facet], np.column_stack([xy_m, np.ones(len(xy_m))]))
        return values


def _planes(xy_m: Float64Array, values: Float64Array) -> Float64Array:
    """(T, K, 3) weights of x, y, 1 that give (T, 3, K) values at the (T, 3, 2) corners of triangles."""
    matrix = np.concatenate([xy_m, np.ones((*xy_m.shape[:2], 1))], axis=2)
    weights: Float64Array = np.swapaxes(np.linalg.solve(matrix, values), 1, 2)
    return weights


def _triangles(node_m: Float64Array, tolerance_m: Float64Array, margin: int) -> Int64Array:
    """(T, 3) nodes of counter-clockwise triangles over all but a margin of (I, J) heights."""
    shape, merged = node_m.shape, _merged_blocks(node_m, tolerance_m, round(np.log2(margin)))
    found = []
    for step, whole in enumerate(merged):
        size = 2**step
        inner = np.zeros_like(whole)
        inner[margin // size : -(margin // size), margin // size : -(margin // size)] = True
        if step + 1 < len(merged):
            inner &= ~merged[step + 1].repeat(2, axis=0).repeat(2, axis=1)
        i, j = np.nonzero(whole & inner)
        around = ~whole & (step > 0)  # nothing is finer than the first step
        finer = np.stack([around[i, j - 1], around[i + 1, j], around[i, j + 1], around[i - 1, j]], axis=1)
        found += _leaf_triangles(i * size, j * size, size, finer, shape)
    return np.concatenate(found)


def _leaf_triangles(
    i: Int64Array, j: Int64Array, size: int, finer: BoolArray, shape: tuple[int, ...]
) -> list[Int64Array]:
    """Triangles of leaves by their south-western nodes; (N, 4) which neighbours, from the south on, are finer."""

    def node(east: int, north: int) -> Int64Array:
        index: Int64Array = np.ravel_multi_index((i + east, j + north), shape)
        return index

    half = size // 2
    corners = [node(0, 0), node(size, 0), node(size, size), node(0, size)]
    middles = [node(half, 0), node(size, half), node(half, size), node(0, half)]
    center = node(half, half)
    plain = ~finer.any(axis=1)
    found = [np.stack([corners[0], corners[k], corners[k + 1]], axis=1)[plain] for k in (1, 2)]
    for side in range(4):
        start, middle, end = corners[side], middles[side], corners[(side + 1) % 4]
        found.append(np.stack([center, start, end], axis=1)[~plain & ~finer[:, side]])
        found += [np.stack([center, *ends], axis=1)[finer[:, side]] for ends in ((start, middle), (middle, end))]
    return found


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
