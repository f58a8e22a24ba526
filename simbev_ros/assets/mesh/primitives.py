"""Primitive solids that all models are built from; unless stated otherwise, meshes are closed and face outward."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import mapbox_earcut
import numpy as np
import shapely

from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.foundation.geometry.ragged import ragged_indices, ragged_starts
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import BoolArray, Float64Array, Int32Array, Int64Array

Vector = tuple[float, float, float]

_MIN_HEIGHT_M = 2e-6
"""Minimum height of a triangle; thinner ones would have no area in float32."""

_BOX_NORMALS = np.array([[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], np.float64)
_BOX_CORNERS = 0.5 * np.array(
    [
        [[1, -1, -1], [1, 1, -1], [1, 1, 1], [1, -1, 1]],
        [[1, 1, -1], [-1, 1, -1], [-1, 1, 1], [1, 1, 1]],
        [[-1, 1, -1], [-1, -1, -1], [-1, -1, 1], [-1, 1, 1]],
        [[-1, -1, -1], [1, -1, -1], [1, -1, 1], [-1, -1, 1]],
        [[-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]],
        [[-1, 1, -1], [1, 1, -1], [1, -1, -1], [-1, -1, -1]],
    ]
).reshape(-1, 3)
_BOX_CORNER_NORMALS = np.repeat(_BOX_NORMALS, 4, axis=0)
_BOX_TRIANGLES = (np.arange(0, 24, 4)[:, None, None] + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3)
_BOX_UV_FROM_CORNER = np.array(  # as ``_surface_coordinates`` has it; each coordinate is one of x, y, z or its negative
    [[[-y, x, 0.0], [0.0, 0.0, 1.0]] if z == 0.0 else np.eye(3)[:2] for x, y, z in _BOX_CORNER_NORMALS]
)
_BOX_UV_AXIS, _BOX_UV_SIGN = np.abs(_BOX_UV_FROM_CORNER).argmax(axis=2), _BOX_UV_FROM_CORNER.sum(axis=2)
_BOX_CORNER = np.arange(24)[:, None]


@dataclass(frozen=True, slots=True)
class Finish:
    """Surface of a solid: material, semantic tag, sRGB albedo 0..255, and the rigid part that moves it."""

    material: Material
    tag: Tag
    color: tuple[int, int, int]
    part: int = 0


def solid(
    finish: Finish,
    vertices: Float64Array,
    triangles: Int32Array,
    *,
    crease_deg: float = 35.0,
    uv: Float64Array | None = None,
) -> Mesh:
    """Build a mesh whose normals are smooth where faces meet at less than the crease angle, and sharp elsewhere.

    Args:
        finish: Finish of all triangles.
        vertices: (V, 3) positions, meters; coincident ones are joined.
        triangles: (T, 3) vertex indices, counter-clockwise seen from outside; triangles without area are dropped.
        crease_deg: Edges sharper than this stay sharp; 0 makes every face flat.
        uv: (T, 3, 2) surface coordinates per corner. When omitted: x, y on level faces; elsewhere meters along the
            surface's horizontal, and z.
    """
    if crease_deg == 0.0 and uv is None:
        return _flat_shaded(finish, np.asarray(vertices, np.float64)[np.asarray(triangles).reshape(-1, 3)])
    return patchwork([finish], np.zeros(len(triangles), np.int64), vertices, triangles, crease_deg=crease_deg, uv=uv)


def patchwork(
    finishes: Sequence[Finish],
    finish_of_triangle: Int64Array,
    vertices: Float64Array,
    triangles: Int32Array,
    *,
    crease_deg: float = 35.0,
    uv: Float64Array | None = None,
) -> Mesh:
    """Build a mesh like ``solid``, with one of several finishes per triangle; normals are smooth across finishes.

    Args:
        finishes: Finishes to choose from.
        finish_of_triangle: (T,) index of each triangle's finish.
        vertices: As in ``solid``.
        triangles: As in ``solid``.
        crease_deg: As in ``solid``.
        uv: As in ``solid``.
    """
    _, first, joined = np.unique(np.round(vertices, 6), axis=0, return_index=True, return_inverse=True)
    triangles = joined.reshape(-1).astype(np.int32)[np.asarray(triangles).reshape(-1, 3)]
    positions = np.asarray(vertices, np.float64)[first]
    corners = positions[triangles]
    kept, _ = _has_area(corners, _cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
    triangles = triangles[kept]
    normals = _corner_normals(triangles.reshape(-1), corners[kept], np.cos(np.radians(crease_deg)))
    points = positions[triangles.reshape(-1)]
    corner_uv = _surface_coordinates(points, normals) if uv is None else np.asarray(uv)[kept].reshape(-1, 2)
    corner_finish = np.repeat(finish_of_triangle[kept], 3)
    key = np.round(np.column_stack([triangles.reshape(-1), corner_finish, normals, corner_uv]), 4)
    _, first, indices = np.unique(key, axis=0, return_index=True, return_inverse=True)
    finish = corner_finish[first]
    return Mesh(
        vertices=points[first].astype(np.float32),
        normals=normals[first].astype(np.float32),
        uv=corner_uv[first].astype(np.float32),
        color=np.array([entry.color for entry in finishes], np.uint8)[finish],
        material=np.array([entry.material for entry in finishes], np.uint8)[finish],
        tag=np.array([entry.tag for entry in finishes], np.uint8)[finish],
        part=np.array([entry.part for entry in finishes], np.uint8)[finish],
        triangles=indices.reshape(-1, 3).astype(np.int32),
    )


def box(finish: Finish, size_m: Vector, center_m: Vector = (0.0, 0.0, 0.0), bevel_m: float = 0.0) -> Mesh:
    """Build a cuboid of a size along x, y, z; ``bevel_m`` is the width of its beveled edges."""
    if not bevel_m:
        return boxes(finish, np.array([size_m]), np.array([center_m]))
    hx, hy, hz = (side / 2.0 for side in size_m)
    b = bevel_m
    inner = np.array([[hx - b, hy - b], [b - hx, hy - b], [b - hx, b - hy], [hx - b, b - hy]]).repeat(2, axis=0)
    outer = inner + b * np.array([[1, 0], [0, 1], [0, 1], [-1, 0], [-1, 0], [0, -1], [0, -1], [1, 0]])
    sections = np.stack(
        [
            np.column_stack([ring, np.full(8, z)])
            for ring, z in ((inner, -hz), (outer, b - hz), (outer, hz - b), (inner, hz))
        ]
    )
    return loft(finish, sections + np.asarray(center_m))


def boxes(finish: Finish, size_m: Float64Array, center_m: Float64Array) -> Mesh:
    """Build cuboids of one finish in one step, from (N, 3) sizes along x, y, z and (N, 3) centers."""
    size_m, center_m = np.asarray(size_m, np.float64), np.asarray(center_m, np.float64)
    corners = size_m[:, None] * _BOX_CORNERS + center_m[:, None]
    triangles = np.arange(0, 24 * len(size_m), 24)[:, None, None] + _BOX_TRIANGLES
    return Mesh.indexed(
        corners.reshape(-1, 3),
        triangles.reshape(-1, 3).astype(np.int32),
        normals=_BOX_CORNER_NORMALS if len(size_m) == 1 else np.tile(_BOX_CORNER_NORMALS, (len(size_m), 1)),
        material=finish.material,
        tag=finish.tag,
        color=finish.color,
        uv=(corners[:, _BOX_CORNER, _BOX_UV_AXIS] * _BOX_UV_SIGN + 0.0).reshape(-1, 2),
        part=finish.part,
    )


def cylinder(
    finish: Finish,
    start_m: Vector,
    end_m: Vector,
    radius_m: float,
    *,
    end_radius_m: float | None = None,
    segments: int = 12,
) -> Mesh:
    """Build a cylinder between two points, or a (truncated) cone if the radius at the end differs."""
    end_radius_m = radius_m if end_radius_m is None else end_radius_m
    return tube(finish, np.array([start_m, end_m]), np.array([radius_m, end_radius_m]), segments=segments)


def tube(
    finish: Finish,
    path_m: Float64Array,
    radius_m: float | Float64Array,
    *,
    segments: int = 8,
    crease_deg: float = 50.0,
) -> Mesh:
    """Build a round bar along a path.

    Args:
        finish: Finish of all triangles.
        path_m: (N, 3) center line.
        radius_m: One radius, or (N,) radii.
        segments: Number of sides of the cross-section.
        crease_deg: As in ``solid``.
    """
    path_m = np.asarray(path_m, np.float64)
    directions = np.diff(path_m, axis=0)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    along = np.concatenate([directions[:1], directions[:-1] + directions[1:], directions[-1:]])
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    side = np.cross(along[0], np.eye(3)[np.argmin(np.abs(along[0]))])
    radii = np.broadcast_to(np.asarray(radius_m, np.float64), len(path_m))
    angles = np.arange(segments) * (2.0 * np.pi / segments)
    sections = []
    for point, direction, radius in zip(path_m, along, radii, strict=True):
        side = side - direction * (side @ direction)
        side /= np.linalg.norm(side)
        up = np.cross(direction, side)
        sections.append(point + radius * (np.outer(np.cos(angles), side) + np.outer(np.sin(angles), up)))
    return loft(finish, np.stack(sections), crease_deg=crease_deg)


def lathe(
    finish: Finish, profile_m: Float64Array, *, segments: int = 12, crease_deg: float = 40.0, caps: bool = True
) -> Mesh:
    """Build a solid of revolution about z.

    Args:
        finish: Finish of all triangles.
        profile_m: (N, 2) radius and z, from the bottom up the outside; radius 0 closes an end in a point.
        segments: Number of sides.
        crease_deg: As in ``solid``.
        caps: Whether to close both ends; False if the profile is closed itself, as for a ring.
    """
    angles = np.arange(segments) * (2.0 * np.pi / segments)
    profile_m = np.asarray(profile_m, np.float64)
    sections = np.empty((len(profile_m), segments, 3))
    sections[..., 0] = np.outer(profile_m[:, 0], np.cos(angles))
    sections[..., 1] = np.outer(profile_m[:, 0], np.sin(angles))
    sections[..., 2] = profile_m[:, 1:]
    return loft(finish, sections, crease_deg=crease_deg, caps=caps)


def ellipsoid(
    finish: Finish, radii_m: Vector, center_m: Vector = (0.0, 0.0, 0.0), *, segments: int = 12, rings: int = 6
) -> Mesh:
    """Build an ellipsoid with its axes along x, y, z and its poles on z."""
    latitudes = np.linspace(-np.pi / 2.0, np.pi / 2.0, rings + 1)
    profile = np.stack([np.cos(latitudes), np.sin(latitudes)], axis=1)
    target_from_unit = np.diag([*radii_m, 1.0])
    target_from_unit[:3, 3] = center_m
    return lathe(finish, profile, segments=segments, crease_deg=180.0).transform(target_from_unit)


def loft(finish: Finish, sections_m: Float64Array, *, crease_deg: float = 35.0, caps: bool = True) -> Mesh:
    """Build a solid through successive cross-sections.

    Args:
        finish: Finish of all triangles.
        sections_m: (N, M, 3) rings of M points each, counter-clockwise for a viewer that they approach.
        crease_deg: As in ``solid``.
        caps: Whether to close the first and the last ring, which must then be convex.
    """
    count, around = sections_m.shape[:2]
    here = np.arange(around)
    following = (here + 1) % around
    quads = np.stack([here, following, following + around, here, following + around, here + around], axis=1)
    sides = (quads[None] + np.arange(count - 1)[:, None, None] * around).reshape(-1, 3)
    fan = np.stack([np.zeros(around - 2, np.int64), here[1:-1], here[2:]], axis=1)
    last = fan + (count - 1) * around
    triangles = np.concatenate([sides, fan[:, ::-1], last]) if caps else sides
    return solid(finish, sections_m.reshape(-1, 3), triangles.astype(np.int32), crease_deg=crease_deg)


def extrusion(
    finish: Finish, polygon: shapely.Polygon, bottom_m: float, top_m: float, *, crease_deg: float = 35.0
) -> Mesh:
    """Build a solid by extruding a polygon in x and y (holes allowed) from one height to another."""
    flat, faces = triangulate(polygon)
    count = len(flat)
    ends = np.cumsum([len(ring.coords) - 1 for ring in (polygon.exterior, *polygon.interiors)])
    here = np.arange(count)
    following = here + 1
    following[ends - 1] = np.concatenate([[0], ends[:-1]])
    walls = np.stack([here, following, following + count, here, following + count, here + count], axis=1)
    vertices = np.concatenate(
        [np.column_stack([flat, np.full(count, bottom_m)]), np.column_stack([flat, np.full(count, top_m)])]
    )
    triangles = np.concatenate([faces[:, ::-1], faces + count, walls.reshape(-1, 3)])
    return solid(finish, vertices, triangles.astype(np.int32), crease_deg=crease_deg)


def plate(finish: Finish, polygon: shapely.Polygon, z_m: float) -> Mesh:
    """Build a level, one-sided polygon that faces up; ``uv`` = x, y."""
    flat, faces = triangulate(polygon)
    return Mesh.indexed(
        np.column_stack([flat, np.full(len(flat), z_m)]),
        faces,
        normals=np.tile([0.0, 0.0, 1.0], (len(flat), 1)),
        material=finish.material,
        tag=finish.tag,
        color=finish.color,
        part=finish.part,
    )


@lru_cache(maxsize=512)
def triangulate(polygon: shapely.Polygon) -> tuple[Float64Array, Int32Array]:
    """Triangulate a polygon into (V, 2) vertices (exterior counter-clockwise, holes clockwise) and (T, 3) triangles.

    The arrays are read-only, because equal polygons share them.
    """
    polygon = shapely.orient_polygons(polygon)
    rings = [np.asarray(ring.coords, np.float64)[:-1, :2] for ring in (polygon.exterior, *polygon.interiors)]
    vertices = np.concatenate(rings)
    ends = np.cumsum([len(ring) for ring in rings], dtype=np.uint32)
    faces = mapbox_earcut.triangulate_float64(vertices, ends).astype(np.int32).reshape(-1, 3)
    a, b, c = vertices[faces[:, 0]], vertices[faces[:, 1]], vertices[faces[:, 2]]
    area = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    faces[area < 0] = faces[area < 0][:, ::-1]
    faces = faces[area != 0]
    vertices.flags.writeable = faces.flags.writeable = False
    return vertices, faces


def _flat_shaded(finish: Finish, corners: Float64Array) -> Mesh:
    """Flat-shaded mesh of (T, 3, 3) triangles; triangles without area are dropped."""
    area_normals = _cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    kept, double_area = _has_area(corners, area_normals)
    corners = corners[kept]
    normals = np.repeat(area_normals[kept] / double_area[kept, None], 3, axis=0)
    points = corners.reshape(-1, 3)
    return Mesh.indexed(
        points,
        np.arange(len(points), dtype=np.int32).reshape(-1, 3),
        normals=normals,
        material=finish.material,
        tag=finish.tag,
        color=finish.color,
        uv=_surface_coordinates(points, normals),
        part=finish.part,
    )


def _has_area(corners: Float64Array, area_normals: Float64Array) -> tuple[BoolArray, Float64Array]:
    """(T,) whether (T, 3, 3) triangles keep an area in float32, and (T,) lengths of their (T, 3) area normals."""
    longest = _length(corners - corners[:, [2, 0, 1]]).max(axis=1)
    double_area = _length(area_normals)
    return double_area > _MIN_HEIGHT_M * longest, double_area


def _cross(a: Float64Array, b: Float64Array) -> Float64Array:
    """Cross product along the last axis, without the overhead of ``np.cross``, which matters for small meshes."""
    ax, ay, az, bx, by, bz = a[..., 0], a[..., 1], a[..., 2], b[..., 0], b[..., 1], b[..., 2]
    cross = np.empty((*ax.shape, 3))
    cross[..., 0], cross[..., 1], cross[..., 2] = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    return cross


def _length(vectors: Float64Array) -> Float64Array:
    """Norm along the last axis."""
    return np.sqrt(np.einsum("...i,...i->...", vectors, vectors))


def _corner_normals(corner_vertex: Int32Array, corners: Float64Array, crease_cosine: float) -> Float64Array:
    """(3T, 3) normals per corner: mean over the faces at its vertex that are within the crease angle of its own.

    Faces are weighted by their angle at the vertex, so that the way a quad was cut into triangles does not matter.
    """
    area_normals = _cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    unit = area_normals / _length(area_normals)[:, None]
    to_next, to_previous = corners[:, [1, 2, 0]] - corners, corners[:, [2, 0, 1]] - corners
    cosine = np.einsum("tki,tki->tk", to_next, to_previous)
    angle = np.arctan2(_length(_cross(to_next, to_previous)), cosine).reshape(-1, 1)
    weighted = np.repeat(unit, 3, axis=0) * angle
    order = np.argsort(corner_vertex, kind="stable")
    counts = np.bincount(corner_vertex)
    corner, within = ragged_indices(counts[corner_vertex])
    other = order[ragged_starts(counts)[corner_vertex[corner]] + within]
    alike = np.einsum("ij,ij->i", unit[corner // 3], unit[other // 3]) >= crease_cosine - 1e-9
    smooth = alike | (corner // 3 == other // 3)
    normals = np.stack(
        [np.bincount(corner[smooth], weighted[other[smooth], k], len(corner_vertex)) for k in range(3)], axis=1
    )
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.where(lengths > 1e-12, normals / np.maximum(lengths, 1e-12), np.repeat(unit, 3, axis=0))


def _surface_coordinates(points: Float64Array, normals: Float64Array) -> Float64Array:
    """(N, 2) surface coordinates: x, y on nearly level surfaces, elsewhere meters along their horizontal, and z."""
    x, y, z = normals.T
    along_m = (x * points[:, 1] - y * points[:, 0]) / np.maximum(np.hypot(x, y), 1e-12)
    uv = points[:, :2].copy()
    upright = np.abs(z) <= 0.7
    uv[upright, 0], uv[upright, 1] = along_m[upright], points[upright, 2]
    return uv
