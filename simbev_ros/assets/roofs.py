"""Roofs and what stands on them. Frame and conventions as in ``facades``."""

import numpy as np
import shapely

from simbev_ros.assets.facades import PARTY_LEDGE_M, along_front, built, parapet, rectangle
from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh import Mesh
from simbev_ros.assets.palette import Color, shaded
from simbev_ros.assets.primitives import box, cylinder, extrusion, solid

_OVERHANG_M = 0.45
_THICKNESS_M = 0.22


def gabled_roof(
    width_m: float,
    depth_m: float,
    eaves_m: float,
    pitch: float,
    roof: Color,
    gable: tuple[Material, Color],
    verge_m: float = PARTY_LEDGE_M,
) -> Mesh:
    """Two slopes, the ridge along the street, and the gable walls below them.

    ``pitch`` is rise over run; ``verge_m`` is how far the slopes stand out from the gables.
    """
    middle_m, rise_m = depth_m / 2.0, pitch * depth_m / 2.0
    attic = shapely.Polygon([(0, eaves_m), (depth_m, eaves_m), (middle_m, eaves_m + rise_m)])
    low_m, ridge_m = eaves_m - pitch * _OVERHANG_M, eaves_m + rise_m
    slopes = shapely.Polygon(
        [
            (-_OVERHANG_M, low_m),
            (middle_m, ridge_m),
            (depth_m + _OVERHANG_M, low_m),
            (depth_m + _OVERHANG_M, low_m + _THICKNESS_M),
            (middle_m, ridge_m + _THICKNESS_M),
            (-_OVERHANG_M, low_m + _THICKNESS_M),
        ]
    )
    half_m = width_m / 2.0
    return Mesh.merged(
        [
            along_front(extrusion(built(*gable), attic, -half_m, half_m, crease_deg=0.0)),
            along_front(
                extrusion(built(Material.ROOF, roof), slopes, -half_m - verge_m, half_m + verge_m, crease_deg=0.0),
            ),
        ]
    )


def hipped_roof(width_m: float, depth_m: float, eaves_m: float, pitch: float, roof: Color) -> Mesh:
    """Four slopes that meet in a ridge along the longer side."""
    x_m, near_m, far_m = width_m / 2.0 + _OVERHANG_M, -_OVERHANG_M, depth_m + _OVERHANG_M
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
    return solid(built(Material.ROOF, roof), vertices, np.array(faces, np.int32), crease_deg=0.0)


def chimney(x_m: float, y_m: float, bottom_m: float, top_m: float, color: Color) -> Mesh:
    """A brick chimney with a cap."""
    height_m = top_m - bottom_m
    return Mesh.merged(
        [
            box(built(Material.BRICK, color), (0.6, 0.6, height_m), (x_m, y_m, bottom_m + height_m / 2.0)),
            box(built(Material.CONCRETE, shaded(color, 0.7)), (0.75, 0.75, 0.12), (x_m, y_m, top_m)),
        ]
    )


def flat_roof(rng: np.random.Generator, width_m: float, depth_m: float, roof_m: float, trim: Color) -> list[Mesh]:
    """Parapet, stair head, air-conditioning boxes and vents on a flat roof."""
    pieces = [parapet(rectangle(width_m, depth_m), trim, roof_m)]
    stair_m = (2.8, 4.2, 2.6)
    x_m, y_m = rng.uniform(-0.25, 0.25) * width_m, rng.uniform(0.45, 0.6) * depth_m
    pieces.append(box(built(Material.PLASTER, shaded(trim, 0.9)), stair_m, (x_m, y_m, roof_m + stair_m[2] / 2.0)))
    for _ in range(int(rng.integers(1, 4))):
        unit_m = (rng.uniform(1.2, 2.4), rng.uniform(1.0, 1.8), rng.uniform(0.9, 1.5))
        spot = (rng.uniform(-0.4, 0.4) * (width_m - 3.0), rng.uniform(0.25, 0.75) * depth_m, roof_m + unit_m[2] / 2.0)
        pieces.append(box(built(Material.METAL, (168, 171, 172)), unit_m, spot))
    vent = (rng.uniform(-0.4, 0.4) * (width_m - 3.0), rng.uniform(0.25, 0.75) * depth_m)
    pipe = built(Material.METAL, (150, 152, 153))
    pieces.append(cylinder(pipe, (*vent, roof_m), (*vent, roof_m + 1.6), 0.16, segments=6))
    return pieces
