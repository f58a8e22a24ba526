"""Roofs of prescribed shapes on any outline: with a ridge (gabled, skillion, ...) or a point (pyramidal, dome, ...)."""

from collections.abc import Callable, Mapping
from functools import lru_cache
from itertools import pairwise

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from simbev_ros.assets.architecture.facades import building_finish, without_windows
from simbev_ros.assets.architecture.roofs import with_tile_uv
from simbev_ros.assets.architecture.walls import Wall
from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.mesh.primitives import solid, triangulate
from simbev_ros.assets.palette import Color
from simbev_ros.config.base import Model
from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.geometry.plan_view import polygon_parts
from simbev_ros.foundation.tables import load_table
from simbev_ros.foundation.types import Float64Array

_CUT_M = 1e-6
_MIN_FILL = 0.85  # of an outline in its convex hull, from which roofs to a point are possible


class RoofShape(Model):
    """One shape of roof_shapes.yaml, which explains the fields."""

    rise: float
    across: tuple[tuple[float, float], ...] = ()
    around: tuple[tuple[float, float], ...] = ()


@lru_cache(maxsize=1)
def roof_shapes() -> Mapping[str, RoofShape]:
    """Load roof_shapes.yaml: shapes by OpenStreetMap's names."""
    table = load_table("simbev_ros.assets.architecture", "roof_shapes.yaml")
    return {name: RoofShape.model_validate(entry) for name, entry in table.items()}


def fits_roof(plan: shapely.Polygon, name: str) -> bool:
    """Whether a shape is known and can be built on a plan: a roof to a point needs one without courtyards and wings."""
    shape = roof_shapes().get(name)
    if shape is None:
        return False
    return not shape.around or (not plan.interiors and plan.area > _MIN_FILL * plan.convex_hull.area)


def usual_rise_m(plan: shapely.Polygon, name: str, slope_rad: float) -> float:
    """Height of a roof of a shape if the map gives none."""
    return roof_shapes()[name].rise * _span_m(plan, slope_rad)[1] / 2.0


def shaped_roof(
    plan: shapely.Polygon, name: str, eaves_m: float, rise_m: float, slope_rad: float, roof: Color, wall: Wall
) -> Mesh:
    """Build a roof, and the gable walls below it, on a flat ceiling.

    Args:
        plan: Outline of the walls, frame of the mesh, meters.
        name: A shape that ``fits_roof``.
        eaves_m: Height of the ceiling.
        rise_m: Height of the roof.
        slope_rad: Direction across the ridge, in which a skillion roof falls.
        roof: Color of the roof.
        wall: Material and color of the gables.
    """
    shape = roof_shapes()[name]
    if shape.around:
        return _pointed(plan, np.array(shape.around), eaves_m, rise_m, roof)
    return _ridged(plan, np.array(shape.across), eaves_m, rise_m, slope_rad, roof, wall)


def slope_across(plan: shapely.Polygon) -> float:
    """Direction across the longer side of a plan."""
    corners = shapely.get_coordinates(plan.minimum_rotated_rectangle)[:3]
    sides = np.diff(corners, axis=0)
    along = sides[int(np.argmin(np.hypot(*sides.T)))]
    return float(np.arctan2(along[1], along[0]))


def _span_m(plan: shapely.Polygon, slope_rad: float) -> tuple[float, float]:
    """Start and width of a plan in a direction."""
    reach_m = shapely.get_coordinates(plan) @ [np.cos(slope_rad), np.sin(slope_rad)]
    return float(reach_m.min()), float(np.ptp(reach_m))


def _ridged(
    plan: shapely.Polygon,
    profile: Float64Array,
    eaves_m: float,
    rise_m: float,
    slope_rad: float,
    roof: Color,
    wall: Wall,
) -> Mesh:
    """Slopes between the lines where an (N, 2) profile across the ridge bends, and walls up to them."""
    start_m, width_m = _span_m(plan, slope_rad)
    across = np.array([np.cos(slope_rad), np.sin(slope_rad)])
    reach_m = (2.0 * float(np.abs(shapely.get_coordinates(plan)).max()) + width_m) * np.array([-across[1], across[0]])
    bends_m = [(start_m + share * width_m) * across for share in profile[:, 0]]

    def height_m(xy_m: Float64Array) -> Float64Array:
        share = (xy_m @ across - start_m) / width_m
        return eaves_m + rise_m * np.interp(share, profile[:, 0], profile[:, 1])

    slopes = []
    for low_m, high_m in pairwise(bends_m):
        band = shapely.Polygon([low_m - reach_m, high_m - reach_m, high_m + reach_m, low_m + reach_m])
        for part in polygon_parts(overlay.intersection(plan, band)):
            flat, faces = triangulate(part)
            slopes.append(np.column_stack([flat, height_m(flat)])[faces])
    cuts = overlay.union_all([shapely.LineString([bend_m - reach_m, bend_m + reach_m]) for bend_m in bends_m[1:-1]])
    gables = without_windows(_faces(_gables(plan, cuts, eaves_m, height_m), wall.material, wall.color))
    return Mesh.merge([with_tile_uv(_faces(slopes, Material.ROOF, roof)), gables])


def _gables(
    plan: shapely.Polygon, cuts: BaseGeometry, eaves_m: float, height_m: Callable[[Float64Array], Float64Array]
) -> list[Float64Array]:
    """Triangles of the walls from the eaves up to a roof that bends at lines."""
    oriented = shapely.orient_polygons(plan)
    triangles = []
    for ring in (oriented.exterior, *oriented.interiors):
        for piece in shapely.get_parts(overlay.difference(ring, shapely.buffer(cuts, _CUT_M))):
            corners_m = shapely.get_coordinates(piece)
            top_m = np.column_stack([corners_m, height_m(corners_m)])
            foot_m = np.column_stack([corners_m, np.full(len(corners_m), eaves_m)])
            triangles.append(np.stack([foot_m[:-1], foot_m[1:], top_m[1:]], axis=1))
            triangles.append(np.stack([foot_m[:-1], top_m[1:], top_m[:-1]], axis=1))
    return triangles


def _faces(faces: list[Float64Array], material: Material, color: Color) -> Mesh:
    """Flat mesh of (T, 3, 3) triangles."""
    corners_m = np.concatenate([np.empty((0, 3, 3)), *faces]).reshape(-1, 3)
    triangles = np.arange(len(corners_m), dtype=np.int32).reshape(-1, 3)
    return solid(building_finish(material, color), corners_m, triangles, crease_deg=0.0)


def _pointed(plan: shapely.Polygon, profile: Float64Array, eaves_m: float, rise_m: float, roof: Color) -> Mesh:
    """Rings of the outline, scaled about its center by an (N, 2) profile."""
    ring_m = shapely.get_coordinates(shapely.orient_polygons(plan).exterior)[:-1]
    middle_m = shapely.get_coordinates(plan.centroid)[0]
    rings = [
        np.column_stack([middle_m + size * (ring_m - middle_m), np.full(len(ring_m), eaves_m + rise_m * height)])
        for size, height in profile
    ]
    faces = []
    for low, high in pairwise(rings):
        low_next, high_next = (np.roll(ring, -1, axis=0) for ring in (low, high))
        faces += [np.stack([low, low_next, high_next], axis=1), np.stack([low, high_next, high], axis=1)]
    return with_tile_uv(_faces(faces, Material.ROOF, roof))
