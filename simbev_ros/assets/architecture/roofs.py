"""Roofs, chimneys and rooftop equipment of buildings. Frame and conventions as in ``facades``."""

from dataclasses import replace

import numpy as np
import shapely

from simbev_ros.assets.architecture.facades import (
    PARTY_LEDGE_M,
    building_finish,
    lay_along_front,
    move_mesh,
    parapet,
    rectangle,
    without_windows,
)
from simbev_ros.assets.architecture.walls import Wall
from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.mesh.primitives import box, boxes, extrusion, solid
from simbev_ros.assets.palette import Color, shade_color
from simbev_ros.foundation.geometry.plan_view import left_of
from simbev_ros.foundation.types import Float64Array

OVERHANG_M = 0.45
_THICKNESS_M = 0.22


def gabled_roof(
    width_m: float,
    depth_m: float,
    eaves_m: float,
    pitch: float,
    roof: Color,
    wall: Wall,
    verge_m: float = PARTY_LEDGE_M,
    overhang_m: float = OVERHANG_M,
) -> Mesh:
    """Build two slopes with the ridge along x, and the gable walls below them.

    ``pitch`` is rise over run; ``verge_m`` is the overhang of the slopes at the gables, ``overhang_m`` at the eaves.
    """
    middle_m, rise_m = depth_m / 2.0, pitch * depth_m / 2.0
    profile = [(0.0, eaves_m), (middle_m, eaves_m + rise_m), (depth_m, eaves_m)]
    return _folded_roof(width_m, np.array(profile), pitch, roof, wall, (verge_m, overhang_m))


def gambrel_roof(width_m: float, depth_m: float, eaves_m: float, roof: Color, wall: Wall) -> Mesh:
    """Build a barn roof, steep below and flatter above, with the ridge along x."""
    knee_m, top_m = 0.22 * depth_m, eaves_m + 0.42 * depth_m
    knee = eaves_m + 0.27 * depth_m
    profile = [(0.0, eaves_m), (knee_m, knee), (depth_m / 2.0, top_m), (depth_m - knee_m, knee), (depth_m, eaves_m)]
    return _folded_roof(width_m, np.array(profile), 1.2, roof, wall, (0.3, 0.3))


def cross_gable(
    width_m: float, depth_m: float, eaves_m: float, pitch: float, roof: Color, wall: Wall, verge_m: float = 0.3
) -> Mesh:
    """Build a roof like ``gabled_roof``, with the ridge along y."""
    return move_mesh(
        gabled_roof(depth_m, width_m, eaves_m, pitch, roof, wall, verge_m), width_m / 2.0, depth_m / 2.0, 1
    )


def hipped_roof(width_m: float, depth_m: float, eaves_m: float, pitch: float, roof: Color) -> Mesh:
    """Build four slopes that meet in a ridge along the longer side."""
    x_m, near_m, far_m = width_m / 2.0 + OVERHANG_M, -OVERHANG_M, depth_m + OVERHANG_M
    half_m = min(x_m, (far_m - near_m) / 2.0)
    ridge = np.array([[half_m - x_m, near_m + half_m], [x_m - half_m, far_m - half_m]])
    eaves = np.array([[-x_m, near_m], [x_m, near_m], [x_m, far_m], [-x_m, far_m]])
    rims = [np.column_stack([eaves, np.full(4, z)]) for z in (eaves_m - 0.05, eaves_m + _THICKNESS_M)]
    top = np.column_stack([ridge, np.full(2, eaves_m + _THICKNESS_M + pitch * half_m)])
    rim = [[k, (k + 1) % 4, (k + 1) % 4 + 4, k, (k + 1) % 4 + 4, k + 4] for k in range(4)]
    across = width_m >= depth_m
    slopes = [[4, 5, 9], [4, 9, 8], [5, 6, 9], [6, 7, 8], [6, 8, 9], [7, 4, 8]]
    along = [[4, 5, 8], [5, 6, 9], [5, 9, 8], [6, 7, 9], [7, 4, 8], [7, 8, 9]]
    faces = [[0, 2, 1], [0, 3, 2], *np.reshape(rim, (-1, 3)).tolist(), *(slopes if across else along)]
    vertices = np.concatenate([*rims, top])
    return with_tile_uv(
        solid(building_finish(Material.ROOF, roof), vertices, np.array(faces, np.int32), crease_deg=0.0)
    )


def spire(x_m: float, y_m: float, side_m: float, bottom_m: float, top_m: float, roof: Color) -> Mesh:
    """Build a pyramid on a square tower."""
    half_m = side_m / 2.0 + 0.25
    base = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half_m + [x_m, y_m]
    vertices = np.vstack([np.column_stack([base, np.full(4, bottom_m)]), [[x_m, y_m, top_m]]])
    faces = np.array([[0, 2, 1], [0, 3, 2], [0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]], np.int32)
    return with_tile_uv(solid(building_finish(Material.ROOF, roof), vertices, faces, crease_deg=0.0))


def chimney(x_m: float, y_m: float, bottom_m: float, top_m: float, color: Color) -> Mesh:
    """Build a brick chimney with a cap."""
    height_m = top_m - bottom_m
    return Mesh.merge(
        [
            box(building_finish(Material.BRICK, color), (0.6, 0.6, height_m), (x_m, y_m, bottom_m + height_m / 2.0)),
            box(building_finish(Material.CONCRETE, shade_color(color, 0.7)), (0.75, 0.75, 0.12), (x_m, y_m, top_m)),
        ]
    )


def flat_roof(rng: np.random.Generator, width_m: float, depth_m: float, roof_m: float, trim: Color) -> list[Mesh]:
    """Build the parapet, stair head, air-conditioning boxes and a vent of a flat roof."""
    pieces = [parapet(rectangle(width_m, depth_m), trim, roof_m)]
    stair_m = (2.8, 4.2, 2.6)
    x_m, y_m = rng.uniform(-0.25, 0.25) * width_m, rng.uniform(0.45, 0.6) * depth_m
    pieces.append(
        box(building_finish(Material.PLASTER, shade_color(trim, 0.9)), stair_m, (x_m, y_m, roof_m + stair_m[2] / 2.0))
    )
    pieces.append(roof_units(rng, int(rng.integers(1, 4)), width_m, depth_m, roof_m))
    vent = (rng.uniform(-0.4, 0.4) * (width_m - 3.0), rng.uniform(0.25, 0.75) * depth_m)
    pieces.append(box(building_finish(Material.METAL, (150, 152, 153)), (0.3, 0.3, 1.6), (*vent, roof_m + 0.8)))
    return pieces


def roof_units(rng: np.random.Generator, count: int, width_m: float, depth_m: float, roof_m: float) -> Mesh:
    """Build air-conditioning boxes on a flat roof."""
    sizes_m = rng.uniform((1.2, 1.0, 0.9), (2.4, 1.8, 1.5), (count, 3))
    x_m, y_m = rng.uniform(-0.4, 0.4, count) * (width_m - 3.0), rng.uniform(0.25, 0.75, count) * depth_m
    return boxes(
        building_finish(Material.METAL, (168, 171, 172)),
        sizes_m,
        np.column_stack([x_m, y_m, roof_m + sizes_m[:, 2] / 2.0]),
    )


def with_tile_uv(roof: Mesh) -> Mesh:
    """Copy of a roof with ``uv`` along its eaves and up its slopes, so that courses of tiles run level."""
    normals = roof.normals.astype(np.float64)
    run = np.hypot(normals[:, 0], normals[:, 1])
    along = left_of(normals) / np.maximum(run, 1e-6)[:, None]
    slope = np.column_stack(
        [np.einsum("ij,ij->i", along, roof.vertices[:, :2]), roof.vertices[:, 2] / np.maximum(run, 0.05)]
    )
    return replace(roof, uv=np.where(run[:, None] > 0.05, slope, roof.uv).astype(np.float32))


def _folded_roof(
    width_m: float, profile_m: Float64Array, pitch: float, roof: Color, wall: Wall, out_m: tuple[float, float]
) -> Mesh:
    """Slopes extruded along x from an (N, 2) profile of y and z, over gable walls, with overhangs (verge, eaves)."""
    verge_m, overhang_m = out_m
    foot = np.array([overhang_m, pitch * overhang_m])
    line = np.vstack([profile_m[0] - foot, profile_m[1:-1], profile_m[-1] + foot * (1.0, -1.0)])
    slopes = shapely.Polygon(np.vstack([line, line[::-1] + np.array([0.0, _THICKNESS_M])]))
    half_m = width_m / 2.0
    gable = extrusion(
        building_finish(wall.material, wall.color), shapely.Polygon(profile_m), -half_m, half_m, crease_deg=0.0
    )
    cover = extrusion(building_finish(Material.ROOF, roof), slopes, -half_m - verge_m, half_m + verge_m, crease_deg=0.0)
    return Mesh.merge([without_windows(_upright(lay_along_front(gable))), with_tile_uv(lay_along_front(cover))])


def _upright(gable: Mesh) -> Mesh:
    """Copy of a gable with ``uv`` along the wall and up, as walls have it."""
    normals = gable.normals
    along = np.einsum("ij,ij->i", left_of(normals), gable.vertices[:, :2])
    return replace(gable, uv=np.column_stack([along, gable.vertices[:, 2]]).astype(np.float32))
