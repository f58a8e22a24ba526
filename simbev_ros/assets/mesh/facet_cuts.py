"""Cuts areas in plan into pieces that each lie on one flat facet of the ground; ``drape`` turns them into meshes."""

from typing import NamedTuple

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from simbev_ros.assets.mesh.clipping import Rings, split_along_lines, without_holes
from simbev_ros.assets.mesh.facets import TILE_M, Facets
from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.geometry.plan_view import indexed_polygon_parts
from simbev_ros.foundation.geometry.ragged import ragged_indices
from simbev_ros.foundation.types import AnyArray, Float64Array, Int64Array

_MIN_PIECE_M2 = 1e-6


class Cut(NamedTuple):
    """An area cut into (P,) polygons, with the (P,) facet that each lies on."""

    pieces: Rings
    facet: Int64Array
    facets: Facets


def cut_to_facets(area: BaseGeometry, facets: Facets) -> Cut:
    """Cut an area into pieces by descending the quadtree of facets; parts outside of all facets are dropped."""
    parts, tile = _cut_to_tiles(_polygons(shapely.get_parts(area))[0])
    parts, origin = without_holes(parts)
    pieces, leaf = _cut_to_leaves(Rings.from_polygons(parts), tile[origin], facets)
    pieces, facet = _cut_in_leaves(pieces, leaf, facets)
    kept = pieces.area_m2 > _MIN_PIECE_M2
    return Cut(pieces.take(kept), facet[kept], facets)


def _cut_to_tiles(parts: AnyArray) -> tuple[AnyArray, Int64Array]:
    """Cut (N,) polygons along the tiles' borders; returns the pieces and the (M, 2) tile of each."""
    columns, column, _ = _cut_along(parts[shapely.area(parts) > 0.0], axis=0)
    pieces, row, origin = _cut_along(columns, axis=1)
    return pieces, np.stack([column[origin], row], axis=1)


def _cut_along(parts: AnyArray, axis: int) -> tuple[AnyArray, Int64Array, Int64Array]:
    """Cut (N,) polygons where an axis crosses tile borders; returns pieces, their tile indices and polygon indices."""
    bounds_m = shapely.bounds(parts).reshape(-1, 4)
    low = np.floor(bounds_m[:, axis] / TILE_M).astype(np.int64)
    count = np.maximum(np.ceil(bounds_m[:, axis + 2] / TILE_M).astype(np.int64) - low, 1)
    part_index, offset = ragged_indices(count)
    number = low[part_index] + offset
    between_m = bounds_m[part_index]
    between_m[:, axis], between_m[:, axis + 2] = number * TILE_M, (number + 1) * TILE_M
    pieces, crossing = parts[part_index], count[part_index] > 1
    pieces[crossing] = overlay.intersection(pieces[crossing], shapely.box(*between_m[crossing].T))
    pieces, origin = _polygons(pieces)
    return pieces, number[origin], part_index[origin]


def _polygons(areas: AnyArray) -> tuple[AnyArray, Int64Array]:
    """The polygons of areas, without points and lines, and the index of each one's area."""
    plain = shapely.get_type_id(areas) == shapely.GeometryType.POLYGON
    parts, origin = indexed_polygon_parts(areas[~plain])
    numbers = np.flatnonzero(plain), np.flatnonzero(~plain)[origin]
    return np.concatenate([areas[plain], parts]), np.concatenate(numbers)


def _cut_to_leaves(pieces: Rings, tile: Int64Array, facets: Facets) -> tuple[Rings, Int64Array]:
    """Halve pieces of (N, 2) tiles in both directions until each lies in one leaf; returns them and their leaves."""
    block = tile - facets.first_tile
    inside = np.asarray(((block >= 0) & (block < facets.leaf_at[0].shape)).all(axis=1))
    pieces, block = pieces.take(inside), block[inside]
    found, side_m = [], TILE_M
    for leaf_at in facets.leaf_at:
        leaf = leaf_at[block[:, 0], block[:, 1]]
        found.append((pieces.take(leaf >= 0), leaf[leaf >= 0]))
        pieces, block = pieces.take(leaf < 0), block[leaf < 0]
        if len(block) == 0:
            break
        for axis in range(2):
            line = np.zeros((len(block), 3))
            line[:, axis] = 1.0
            line[:, 2] = facets.first_tile[axis] * TILE_M + (block[:, axis] + 0.5) * side_m
            pieces, origin, beyond = split_along_lines(pieces, line)
            block = block[origin]
            block[:, axis] = 2 * block[:, axis] + beyond
        side_m /= 2.0
    return Rings.concatenate(*(rings for rings, _ in found)), np.concatenate([leaf for _, leaf in found])


def _cut_in_leaves(pieces: Rings, leaf: Int64Array, facets: Facets) -> tuple[Rings, Int64Array]:
    """Cut pieces of (N,) leaves along the lines between the leaves' facets; returns them and the facet of each."""
    sectors, middle_m = facets.sectors[leaf, :, 0], facets.middle_m[leaf]
    pieces, origin, north_west = split_along_lines(
        pieces, _lines_through(middle_m, [-1.0, 1.0], sectors[:, 1] != sectors[:, 2])
    )
    leaf, sectors, middle_m = leaf[origin], sectors[origin], middle_m[origin]
    pieces, origin, north_east = split_along_lines(
        pieces, _lines_through(middle_m, [1.0, 1.0], sectors[:, 0] != sectors[:, 1])
    )
    leaf, middle_m, north_west = leaf[origin], middle_m[origin], north_west[origin]
    side = np.where(north_west, np.where(north_east, 2, 3), np.where(north_east, 1, 0))
    halves = facets.sectors[leaf, side]
    onward = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]])[side]
    pieces, origin, second = split_along_lines(pieces, _lines_through(middle_m, onward, halves[:, 0] != halves[:, 1]))
    return pieces, halves[origin, second.astype(np.int64)]


def _lines_through(through_m: Float64Array, normal: AnyArray | list[float], wanted: AnyArray) -> Float64Array:
    """(N, 3) lines for ``split_along_lines`` through (N, 2) points; where none is wanted, a line beyond everything."""
    normal = np.broadcast_to(np.asarray(normal), through_m.shape)
    return np.column_stack([normal, np.where(wanted, np.sum(normal * through_m, axis=1), -np.inf)])
