"""Meshes that follow the ground: areas in plan, cut into pieces that each lie on one flat facet.

What lies on one facet is flat, so pieces may be triangulated in any way, and neighbours need not share their vertices:
along a border both are straight.
"""

from collections.abc import Callable
from dataclasses import fields
from typing import NamedTuple

import mapbox_earcut
import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from simbev_ros.assets.facets import TILE_M, Facets
from simbev_ros.assets.mesh import Mesh
from simbev_ros.assets.primitives import Finish, triangulate
from simbev_ros.types import BoolArray, Float64Array, Int64Array

_SPECK_M2 = 1e-6
_ON_EDGE_M = 0.002  # plans lie on a millimetre grid, and what is cut from them too
_BITS = 21  # enough for places in a tile, in tenths of a millimetre

Ceiling = Callable[[Float64Array], Float64Array]
"""(N,) heights that nothing is to exceed at (N, 2) points of the map frame."""

ByTile = dict[tuple[int, int], Mesh]
"""By column and row of tiles: a mesh in the frame of the tile's middle, at height 0."""

_Polygons = np.ndarray[tuple[int], np.dtype[np.object_]]


class Cut(NamedTuple):
    """An area in pieces: (P,) polygons, counter-clockwise, and the facet that each lies on."""

    pieces: _Polygons
    facet: Int64Array
    facets: Facets


def cut_to_facets(area: BaseGeometry, facets: Facets) -> Cut:
    """The pieces of an area; what facets do not cover is left out."""
    parts, tile = _cut_to_tiles(_polygons(shapely.get_parts(area))[0])
    which, facet = facets.tree.query(parts, predicate="intersects")
    here = (facets.tile[facet] == tile[which]).all(axis=1)
    which, facet = which[here], facet[here]
    fills = shapely.area(parts) > TILE_M**2 - _SPECK_M2
    pieces, origin = _intersections(parts[which], facets.polygons[facet], fills[which])
    kept = shapely.area(pieces) > _SPECK_M2
    return Cut(shapely.orient_polygons(pieces[kept]), facet[origin[kept]], facets)


def _intersections(parts: _Polygons, cells: _Polygons, covers: BoolArray) -> tuple[_Polygons, Int64Array]:
    """The polygons of intersections with cells, of which some are covered for sure, and the number of the pair."""
    shapely.prepare(parts)
    part_m, cell_m = shapely.bounds(parts).reshape(-1, 4), shapely.bounds(cells).reshape(-1, 4)
    whole, within = covers.copy(), _encloses(cell_m, part_m)
    uncertain = ~covers & _encloses(part_m, cell_m)
    whole[uncertain] = shapely.contains(parts[uncertain], cells[uncertain])
    within[within] = shapely.covers(cells[within], parts[within])
    pieces = np.where(whole, cells, parts)
    crossing = ~whole & ~within
    pieces[crossing] = shapely.intersection(parts[crossing], cells[crossing])
    return _polygons(pieces)


def sheet(
    cut: Cut,
    finish: Finish,
    rise_m: float,
    *,
    downward: bool = False,
    ceiling_m: Ceiling | None = None,
    yaw_rad: float = 0.0,
) -> ByTile:
    """A one-sided cover of all pieces.

    Args:
        cut: What to cover.
        finish: Of all of it.
        rise_m: So much above the ground.
        downward: To be seen from below.
        ceiling_m: Of the height.
        yaw_rad: Of the first axis of ``uv``, which are metres in plan.
    """
    xy_m, piece, triangles = _triangulated(cut.pieces)
    if len(triangles) == 0:
        return {}
    tile = cut.facets.tile[cut.facet[piece]]
    _, first, joined = np.unique(_key(xy_m, tile), return_index=True, return_inverse=True)
    facet, xy_m, tile, triangles = cut.facet[piece][first], xy_m[first], tile[first], joined[triangles]
    height_m, east, north = cut.facets.at(facet, xy_m).T
    height_m = height_m + rise_m
    if ceiling_m is not None:
        height_m = np.minimum(height_m, ceiling_m(xy_m))
    normals = np.column_stack([-east, -north, np.ones(len(xy_m))])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    mesh = Mesh.indexed(
        np.column_stack([xy_m - (tile + 0.5) * TILE_M, height_m]),
        (triangles[:, ::-1] if downward else triangles).astype(np.int32),
        normals=-normals if downward else normals,
        material=finish.material,
        tag=finish.tag,
        color=finish.color,
        uv=xy_m @ np.array([[np.cos(yaw_rad), -np.sin(yaw_rad)], [np.sin(yaw_rad), np.cos(yaw_rad)]]),
    )
    return _by_tile(mesh, tile)


def faces(cut: Cut, finish: Finish, edges: BaseGeometry, bottom_m: float, top_m: float) -> ByTile:
    """Upright faces, outward, where rims of pieces lie on ``edges``, from one height above the ground to another."""
    rings, piece = shapely.get_rings(cut.pieces, return_index=True)
    xy_m, ring = shapely.get_coordinates(rings, return_index=True)
    follows = ring[1:] == ring[:-1]
    starts, ends, piece = xy_m[:-1][follows], xy_m[1:][follows], piece[ring[:-1][follows]]
    shapely.prepare(edges)
    kept = shapely.dwithin(edges, shapely.points((starts + ends) / 2.0), _ON_EDGE_M)
    if not kept.any():
        return {}
    tile = cut.facets.tile[cut.facet[piece]]
    order = np.flatnonzero(kept)[np.lexsort(tile[kept].T)]
    starts, ends, tile, facet = starts[order], ends[order], tile[order], cut.facet[piece[order]]
    start_m, end_m = cut.facets.at(facet, starts)[:, 0], cut.facets.at(facet, ends)[:, 0]
    along = np.cumsum(np.linalg.norm(ends - starts, axis=1))
    before = np.concatenate([[0.0], along[:-1]])
    starts, ends = starts - (tile + 0.5) * TILE_M, ends - (tile + 0.5) * TILE_M
    corners = [(starts, start_m + bottom_m), (ends, end_m + bottom_m), (ends, end_m + top_m), (starts, start_m + top_m)]
    a, b, c, d = (np.column_stack(corner) for corner in corners)
    uv_a, uv_d = (np.column_stack([before, corner[:, 2]]) for corner in (a, d))
    uv_b, uv_c = (np.column_stack([along, corner[:, 2]]) for corner in (b, c))
    mesh = Mesh.flat(
        np.stack([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)], axis=1).reshape(-1, 3, 3),
        uv=np.stack([np.stack([uv_a, uv_b, uv_c], axis=1), np.stack([uv_a, uv_c, uv_d], axis=1)], axis=1),
        material=finish.material,
        tag=finish.tag,
        color=finish.color,
    )
    return _by_tile(mesh, np.repeat(tile, 6, axis=0))


def _cut_to_tiles(parts: _Polygons) -> tuple[_Polygons, Int64Array]:
    """(N,) polygons cut along the tiles' borders, and the (N, 2) tile of each."""
    columns, column, _ = _cut_along(parts[shapely.area(parts) > 0.0], axis=0)
    pieces, row, origin = _cut_along(columns, axis=1)
    return pieces, np.stack([column[origin], row], axis=1)


def _cut_along(parts: _Polygons, axis: int) -> tuple[_Polygons, Int64Array, Int64Array]:
    """(N,) polygons cut where an axis crosses the tiles' borders; of each its number on the axis and its polygon's."""
    bounds_m = shapely.bounds(parts).reshape(-1, 4)
    low = np.floor(bounds_m[:, axis] / TILE_M).astype(np.int64)
    count = np.maximum(np.ceil(bounds_m[:, axis + 2] / TILE_M).astype(np.int64) - low, 1)
    which = np.repeat(np.arange(len(parts)), count)
    number = low[which] + np.arange(len(which)) - np.repeat(np.cumsum(count) - count, count)
    between_m = bounds_m[which]
    between_m[:, axis], between_m[:, axis + 2] = number * TILE_M, (number + 1) * TILE_M
    pieces, crossing = parts[which], count[which] > 1
    pieces[crossing] = shapely.intersection(pieces[crossing], shapely.box(*between_m[crossing].T))
    pieces, origin = _polygons(pieces)
    return pieces, number[origin], which[origin]


def _polygons(areas: _Polygons) -> tuple[_Polygons, Int64Array]:
    """The polygons of areas, without what is thinner, and the number of the area of each."""
    plain = shapely.get_type_id(areas) == shapely.GeometryType.POLYGON
    parts, origin = shapely.get_parts(areas[~plain], return_index=True)
    kept = shapely.get_type_id(parts) == shapely.GeometryType.POLYGON
    numbers = np.flatnonzero(plain), np.flatnonzero(~plain)[origin[kept]]
    return np.concatenate([areas[plain], parts[kept]]), np.concatenate(numbers)


def _by_tile(mesh: Mesh, tile: Int64Array) -> ByTile:
    """A mesh of which (V, 2) vertices are sorted by their tile, apart."""
    starts = np.flatnonzero(np.append(True, (tile[1:] != tile[:-1]).any(axis=1)))
    of_triangle = np.searchsorted(starts, mesh.triangles[:, 0], side="right") - 1
    order = np.argsort(of_triangle, kind="stable")
    triangles = np.split(mesh.triangles[order], np.searchsorted(of_triangle[order], np.arange(1, len(starts))))
    meshes = {}
    for start, end, own in zip(starts.tolist(), [*starts[1:].tolist(), len(tile)], triangles, strict=True):
        if len(own):
            columns = {
                field.name: getattr(mesh, field.name)[start:end] for field in fields(Mesh) if field.name != "triangles"
            }
            meshes[int(tile[start, 0]), int(tile[start, 1])] = Mesh(**columns, triangles=own - np.int32(start))
    return meshes


def _encloses(outer_m: Float64Array, inner_m: Float64Array) -> BoolArray:
    """(N,) which of (N, 4) bounds enclose others."""
    low, high = outer_m[:, :2] <= inner_m[:, :2], outer_m[:, 2:] >= inner_m[:, 2:]
    return np.asarray((low & high).all(axis=1))


def _triangulated(pieces: _Polygons) -> tuple[Float64Array, Int64Array, Int64Array]:
    """(V, 2) vertices, the piece of each, and (T, 3) counter-clockwise triangles; convex pieces all at once."""
    xy_m, piece = shapely.get_coordinates(shapely.get_exterior_ring(pieces), return_index=True)
    last = np.append(piece[1:] != piece[:-1], True) if len(piece) else np.zeros(0, bool)
    xy_m, piece = xy_m[~last], piece[~last]
    count = np.bincount(piece, minlength=len(pieces))
    first = np.cumsum(count) - count
    holed = shapely.get_num_interior_rings(pieces) > 0
    simple = _are_convex(xy_m, piece, first, count) & ~holed
    here = np.arange(len(xy_m))
    fan = simple[piece] & (here > first[piece]) & (here < first[piece] + count[piece] - 1)
    triangles = [np.column_stack([first[piece[fan]], here[fan], here[fan] + 1])]
    vertices, owners, total = [xy_m], [piece], len(xy_m)
    for number in np.flatnonzero(~simple & ~holed).tolist():
        ring_m = xy_m[first[number] : first[number] + count[number]]
        ears = mapbox_earcut.triangulate_float64(ring_m, np.array([len(ring_m)], np.uint32))
        triangles.append(ears.astype(np.int64).reshape(-1, 3) + first[number])
    for number in np.flatnonzero(holed).tolist():
        corners_m, found = triangulate(pieces[number])
        vertices.append(corners_m)
        owners.append(np.full(len(corners_m), number))
        triangles.append(found.astype(np.int64) + total)
        total += len(corners_m)
    all_m, all_triangles = np.concatenate(vertices), np.concatenate(triangles)
    a, b, c = (all_m[all_triangles[:, k]] for k in range(3))
    area_m2 = _cross(b - a, c - a)
    all_triangles[area_m2 < 0.0] = all_triangles[area_m2 < 0.0][:, ::-1]
    return all_m, np.concatenate(owners), all_triangles[np.abs(area_m2) > _SPECK_M2]


def _are_convex(xy_m: Float64Array, piece: Int64Array, first: Int64Array, count: Int64Array) -> BoolArray:
    """(P,) which rings of vertices never turn right."""
    here = np.arange(len(xy_m)) - first[piece]
    after = first[piece] + (here + 1) % count[piece]
    before = first[piece] + (here - 1) % count[piece]
    turn = _cross(xy_m - xy_m[before], xy_m[after] - xy_m)
    right_turns = np.bincount(piece[turn < -1e-9], minlength=len(count))
    convex: BoolArray = right_turns == 0
    return convex


def _cross(a: Float64Array, b: Float64Array) -> Float64Array:
    """(N,) of (N, 2) vectors."""
    cross: Float64Array = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    return cross


def _key(xy_m: Float64Array, tile: Int64Array) -> Int64Array:
    """(N,) ascending by (N, 2) tile, and the same for points of one tile and place, to a tenth of a millimetre."""
    column, row = (tile - tile.min(axis=0)).T
    x, y = np.round((xy_m - (tile - 0.5) * TILE_M) * 1e4).astype(np.int64).T
    key: Int64Array = ((column * (1 + row.max()) + row << _BITS) + x << _BITS) + y
    return key
