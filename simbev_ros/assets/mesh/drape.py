"""Builds meshes that follow the ground from areas that ``facet_cuts`` has cut into pieces, each on one flat facet.

The meshes come back by tile. As a piece is flat, it may be triangulated in any way, and neighboring pieces need not
share vertices: both are straight along their common border.
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
from simbev_ros.foundation.types import BoolArray, Float64Array, Int64Array

_MIN_TRIANGLE_M2 = 1e-6
_EDGE_TOLERANCE_M = 0.002  # areas and the pieces cut from them lie on a millimeter grid
_KEY_BITS = 21  # enough for positions in a tile, in tenths of a millimeter

Limit = Callable[[Float64Array], Float64Array]
"""Function that returns (N,) maximum or minimum heights at (N, 2) points of the map frame."""

Rise = float | Callable[[Float64Array], Float64Array]
"""Height above the ground: a constant, or a function that returns (N,) heights at (N, 2) points of the map frame."""

ByTile = dict[tuple[int, int], Mesh]
"""Meshes by column and row of their tile, each in the frame of the tile's center at height 0."""


def cover_mesh(
    cut: Cut,
    finish: Finish,
    rise_m: Rise,
    *,
    downward: bool = False,
    ceiling_m: Limit | None = None,
    floor_m: Limit | None = None,
    yaw_rad: float = 0.0,
) -> ByTile:
    """Build a one-sided cover of all pieces, such as asphalt or a lawn.

    Args:
        cut: Pieces to cover.
        finish: Finish of the whole cover.
        rise_m: Height above the ground.
        downward: Whether the cover faces down, to be seen from below.
        ceiling_m: Maximum height.
        floor_m: Minimum height.
        yaw_rad: Direction of the first axis of ``uv``, which are meters in plan.
    """
    triangles = _triangulate(cut.pieces)
    if len(triangles) == 0:
        return {}
    facet, xy_m = cut.facet[cut.pieces.owner], cut.pieces.xy_m
    tile = cut.facets.tile[facet]
    _, first, joined = np.unique(_vertex_keys(xy_m, tile), return_index=True, return_inverse=True)
    facet, xy_m, tile, triangles = facet[first], xy_m[first], tile[first], joined[triangles]
    height_m, east, north = cut.facets.heights_and_slopes(facet, xy_m).T
    height_m = height_m + _rise_at(rise_m, xy_m)
    if ceiling_m is not None:
        height_m = np.minimum(height_m, ceiling_m(xy_m))
    if floor_m is not None:
        height_m = np.maximum(height_m, floor_m(xy_m))
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
    return _split_by_tile(mesh, tile)


def edge_faces(cut: Cut, finish: Finish, edges: BaseGeometry, bottom_m: float, top_m: Rise) -> ByTile:
    """Build upright outward faces where rims of pieces lie on ``edges``, between two heights above the ground.

    Where the upper height is below the lower one, the faces point inward.
    """
    pieces, rim = cut.pieces, ~cut.pieces.is_cut
    starts, ends, piece = pieces.xy_m[rim], pieces.xy_m[pieces.following[rim]], pieces.owner[rim]
    shapely.prepare(edges)
    kept = shapely.dwithin(edges, shapely.points((starts + ends) / 2.0), _EDGE_TOLERANCE_M)
    if not kept.any():
        return {}
    tile = cut.facets.tile[cut.facet[piece]]
    order = np.flatnonzero(kept)[np.lexsort(tile[kept].T)]
    starts, ends, tile, facet = starts[order], ends[order], tile[order], cut.facet[piece[order]]
    start_m, end_m = (
        cut.facets.heights_and_slopes(facet, starts)[:, 0],
        cut.facets.heights_and_slopes(facet, ends)[:, 0],
    )
    top_start_m, top_end_m = start_m + _rise_at(top_m, starts), end_m + _rise_at(top_m, ends)
    along = np.cumsum(np.linalg.norm(ends - starts, axis=1))
    before = np.concatenate([[0.0], along[:-1]])
    starts, ends = starts - (tile + 0.5) * TILE_M, ends - (tile + 0.5) * TILE_M
    corners = [(starts, start_m + bottom_m), (ends, end_m + bottom_m), (ends, top_end_m), (starts, top_start_m)]
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
    return _split_by_tile(mesh, np.repeat(tile, 6, axis=0))


def _rise_at(rise_m: Rise, xy_m: Float64Array) -> float | Float64Array:
    """Heights above the ground at (N, 2) points."""
    return rise_m(xy_m) if callable(rise_m) else rise_m


def _split_by_tile(mesh: Mesh, tile: Int64Array) -> ByTile:
    """Split a mesh with vertices sorted by (V, 2) tile."""
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


def _triangulate(pieces: Rings) -> Int64Array:
    """(T, 3) counter-clockwise triangles; convex pieces are triangulated in one step."""
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
    return found[np.abs(area_m2) > _MIN_TRIANGLE_M2]


def _are_convex(pieces: Rings) -> BoolArray:
    """(P,) whether a ring is convex, i.e. never turns right."""
    step_m = pieces.xy_m[pieces.following] - pieces.xy_m
    turns_right = cross(step_m, step_m[pieces.following]) < -1e-9
    right_turns = np.bincount(pieces.owner[turns_right], minlength=len(pieces.count))
    return right_turns == 0


def _vertex_keys(xy_m: Float64Array, tile: Int64Array) -> Int64Array:
    """(N,) keys, ascending by (N, 2) tile, equal for points of a tile with equal positions to 0.1 mm."""
    column, row = (tile - tile.min(axis=0)).T
    x, y = np.round((xy_m - (tile - 0.5) * TILE_M) * 1e4).astype(np.int64).T
    return ((column * (1 + row.max()) + row << _KEY_BITS) + x << _KEY_BITS) + y
