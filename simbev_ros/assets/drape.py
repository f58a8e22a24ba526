"""Meshes that follow the ground: areas in plan, cut into pieces that each lie on one flat facet.

What lies on one facet is flat, so pieces may be triangulated in any way, and neighbours need not share their vertices:
along a border both are straight.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from simbev_ros.assets.facets import Facets
from simbev_ros.assets.mesh import Mesh
from simbev_ros.assets.primitives import Finish, triangulate
from simbev_ros.types import BoolArray, Float64Array, Int64Array

_SPECK_M2 = 1e-6
_ON_EDGE_M = 0.002  # plans lie on a millimetre grid, and what is cut from them too

Ceiling = Callable[[Float64Array], Float64Array]
"""(N,) heights that nothing is to exceed at (N, 2) points of the map frame."""

_Polygons = np.ndarray[tuple[int], np.dtype[np.object_]]


class Cut(NamedTuple):
    """An area in pieces: (P,) polygons, counter-clockwise, and the facet that each lies on."""

    pieces: _Polygons
    facet: Int64Array
    facets: Facets

    def where(self, chosen: BoolArray) -> "Cut":
        """Some of the pieces."""
        return Cut(self.pieces[chosen], self.facet[chosen], self.facets)


def cut_to_facets(polygons: _Polygons, facets: Facets) -> Cut:
    """The pieces of polygons that do not overlap."""
    which, facet = facets.tree.query(polygons, predicate="intersects")
    order = np.lexsort((facet, which))
    which, facet = which[order], facet[order]
    parts, cells = polygons[which], facets.polygons[facet]
    shapely.prepare(parts)
    whole, within = shapely.contains(parts, cells), shapely.covers(cells, parts)
    pieces = np.where(whole, cells, parts)
    crossing = ~whole & ~within
    pieces[crossing] = shapely.intersection(parts[crossing], cells[crossing])
    pieces, origin = shapely.get_parts(pieces, return_index=True)
    kept = (shapely.get_type_id(pieces) == shapely.GeometryType.POLYGON) & (shapely.area(pieces) > _SPECK_M2)
    return Cut(shapely.orient_polygons(pieces[kept]), facet[origin[kept]], facets)


def sheet(
    cut: Cut,
    finish: Finish,
    rise_m: float,
    *,
    downward: bool = False,
    ceiling_m: Ceiling | None = None,
    yaw_rad: float = 0.0,
) -> Mesh:
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
        return Mesh.empty()
    height_m, east, north = cut.facets.at(cut.facet[piece], xy_m).T
    height_m = height_m + rise_m
    if ceiling_m is not None:
        height_m = np.minimum(height_m, ceiling_m(xy_m))
    normals = np.column_stack([-east, -north, np.ones(len(xy_m))])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    _, first, joined = np.unique(_key(xy_m), return_index=True, return_inverse=True)
    return Mesh.indexed(
        np.column_stack([xy_m, height_m])[first],
        joined[triangles[:, ::-1] if downward else triangles].astype(np.int32),
        normals=(-normals if downward else normals)[first],
        material=finish.material,
        tag=finish.tag,
        color=finish.color,
        uv=(xy_m @ np.array([[np.cos(yaw_rad), -np.sin(yaw_rad)], [np.sin(yaw_rad), np.cos(yaw_rad)]]))[first],
    )


def faces(cut: Cut, finish: Finish, edges: BaseGeometry, bottom_m: float, top_m: float) -> Mesh:
    """Upright faces, outward, where rims of pieces lie on ``edges``, from one height above the ground to another."""
    rings, piece = shapely.get_rings(cut.pieces, return_index=True)
    xy_m, ring = shapely.get_coordinates(rings, return_index=True)
    follows = ring[1:] == ring[:-1]
    starts, ends, piece = xy_m[:-1][follows], xy_m[1:][follows], piece[ring[:-1][follows]]
    shapely.prepare(edges)
    kept = shapely.dwithin(edges, shapely.points((starts + ends) / 2.0), _ON_EDGE_M)
    starts, ends, facet = starts[kept], ends[kept], cut.facet[piece[kept]]
    if len(starts) == 0:
        return Mesh.empty()
    start_m, end_m = cut.facets.at(facet, starts)[:, 0], cut.facets.at(facet, ends)[:, 0]
    corners = [(starts, start_m + bottom_m), (ends, end_m + bottom_m), (ends, end_m + top_m), (starts, start_m + top_m)]
    a, b, c, d = (np.column_stack(corner) for corner in corners)
    lengths = np.linalg.norm(ends - starts, axis=1)
    along = np.cumsum(lengths)
    uv_a, uv_d = (np.column_stack([along - lengths, corner[:, 2]]) for corner in (a, d))
    uv_b, uv_c = (np.column_stack([along, corner[:, 2]]) for corner in (b, c))
    return Mesh.flat(
        np.stack([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)], axis=1).reshape(-1, 3, 3),
        uv=np.stack([np.stack([uv_a, uv_b, uv_c], axis=1), np.stack([uv_a, uv_c, uv_d], axis=1)], axis=1),
        material=finish.material,
        tag=finish.tag,
        color=finish.color,
    )


def _triangulated(pieces: _Polygons) -> tuple[Float64Array, Int64Array, Int64Array]:
    """(V, 2) vertices, the piece of each, and (T, 3) counter-clockwise triangles; convex pieces all at once."""
    xy_m, piece = shapely.get_coordinates(shapely.get_exterior_ring(pieces), return_index=True)
    last = np.append(piece[1:] != piece[:-1], True) if len(piece) else np.zeros(0, bool)
    xy_m, piece = xy_m[~last], piece[~last]
    count = np.bincount(piece, minlength=len(pieces))
    first = np.cumsum(count) - count
    simple = _are_convex(xy_m, piece, first, count) & (shapely.get_num_interior_rings(pieces) == 0)
    here = np.arange(len(xy_m))
    fan = simple[piece] & (here > first[piece]) & (here < first[piece] + count[piece] - 1)
    triangles = [np.column_stack([first[piece[fan]], here[fan], here[fan] + 1])]
    vertices, owners, total = [xy_m], [piece], len(xy_m)
    for number in np.flatnonzero(~simple):
        corners_m, found = triangulate(pieces[number])
        vertices.append(corners_m)
        owners.append(np.full(len(corners_m), number))
        triangles.append(found.astype(np.int64) + total)
        total += len(corners_m)
    all_m, all_triangles = np.concatenate(vertices), np.concatenate(triangles)
    a, b, c = (all_m[all_triangles[:, k]] for k in range(3))
    return all_m, np.concatenate(owners), all_triangles[_cross(b - a, c - a) > _SPECK_M2]


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


def _key(xy_m: Float64Array) -> Int64Array:
    """(N,) the same for points of one place, to a tenth of a millimetre."""
    grid = np.round(xy_m * 1e4).astype(np.int64)
    key: Int64Array = grid[:, 0] * np.int64(1 << 32) + grid[:, 1]
    return key
