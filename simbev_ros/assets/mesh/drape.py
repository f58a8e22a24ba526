"""Meshes that follow the ground, from areas that are cut into pieces of which each lies on one flat facet.

What lies on one facet is flat, so pieces may be triangulated in any way, and neighbours need not share their vertices:
along a border both are straight.
"""

from collections.abc import Callable
from dataclasses import fields

import mapbox_earcut
import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from simbev_ros.assets.mesh.clipping import Rings, cross
from simbev_ros.assets.mesh.facet_cuts import Cut
from simbev_ros.assets.mesh.facets import TILE_M
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.mesh.primitives import Finish
from simbev_ros.types import BoolArray, Float64Array, Int64Array

_SPECK_M2 = 1e-6
_ON_EDGE_M = 0.002  # plans lie on a millimetre grid, and what is cut from them too
_BITS = 21  # enough for places in a tile, in tenths of a millimetre

Ceiling = Callable[[Float64Array], Float64Array]
"""(N,) heights that nothing is to exceed at (N, 2) points of the map frame."""

ByTile = dict[tuple[int, int], Mesh]
"""By column and row of tiles: a mesh in the frame of the tile's middle, at height 0."""


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
    triangles = _triangulated(cut.pieces)
    if len(triangles) == 0:
        return {}
    facet, xy_m = cut.facet[cut.pieces.owner], cut.pieces.xy_m
    tile = cut.facets.tile[facet]
    _, first, joined = np.unique(_key(xy_m, tile), return_index=True, return_inverse=True)
    facet, xy_m, tile, triangles = facet[first], xy_m[first], tile[first], joined[triangles]
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
    pieces, rim = cut.pieces, ~cut.pieces.is_cut
    starts, ends, piece = pieces.xy_m[rim], pieces.xy_m[pieces.following[rim]], pieces.owner[rim]
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


def _triangulated(pieces: Rings) -> Int64Array:
    """(T, 3) counter-clockwise triangles, those of convex pieces all at once."""
    first, count, owner = pieces.first, pieces.count, pieces.owner
    convex = _are_convex(pieces)
    here = np.arange(len(owner))
    fan = convex[owner] & (here > first[owner]) & (here < first[owner] + count[owner] - 1)
    triangles = [np.column_stack([first[owner[fan]], here[fan], here[fan] + 1])]
    for number in np.flatnonzero(~convex).tolist():
        ring_m = pieces.xy_m[first[number] : first[number] + count[number]]
        ears = mapbox_earcut.triangulate_float64(ring_m, np.array([len(ring_m)], np.uint32))
        triangles.append(ears.astype(np.int64).reshape(-1, 3) + first[number])
    found = np.concatenate(triangles)
    a, b, c = (pieces.xy_m[found[:, k]] for k in range(3))
    area_m2 = cross(b - a, c - a)
    found[area_m2 < 0.0] = found[area_m2 < 0.0][:, ::-1]
    real: Int64Array = found[np.abs(area_m2) > _SPECK_M2]
    return real


def _are_convex(pieces: Rings) -> BoolArray:
    """(P,) which rings of vertices never turn right."""
    step_m = pieces.xy_m[pieces.following] - pieces.xy_m
    turns_right = cross(step_m, step_m[pieces.following]) < -1e-9
    right_turns = np.bincount(pieces.owner[turns_right], minlength=len(pieces.count))
    convex: BoolArray = right_turns == 0
    return convex


def _key(xy_m: Float64Array, tile: Int64Array) -> Int64Array:
    """(N,) ascending by (N, 2) tile, and the same for points of one tile and place, to a tenth of a millimetre."""
    column, row = (tile - tile.min(axis=0)).T
    x, y = np.round((xy_m - (tile - 0.5) * TILE_M) * 1e4).astype(np.int64).T
    key: Int64Array = ((column * (1 + row.max()) + row << _BITS) + x << _BITS) + y
    return key
