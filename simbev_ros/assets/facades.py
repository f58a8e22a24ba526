"""Walls with windows, and what hangs on them: bands of storeys, ledges, pilasters, balconies, doors, awnings.

A building's frame: x along the street front, y away from the street (the front wall at y = 0), z up from the ground.
Windows are drawn by the material: ``uv`` grows by ``BAY_M`` from bay to bay and by ``STOREY_M`` from floor to floor,
whole numbers of both on every wall, whatever the wall's true measures.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh import Mesh
from simbev_ros.assets.palette import Color
from simbev_ros.assets.primitives import Finish, box, extrusion, plate
from simbev_ros.semantics import Tag
from simbev_ros.types import Float64Array

BAY_M = 3.0
STOREY_M = 3.0
FOUNDATION_M = 0.4
PARTY_LEDGE_M = 0.05
"""Nothing stands out farther than this from the sides of a building that may have neighbours."""


@dataclass(frozen=True, slots=True)
class Band:
    """Storeys of one look: material, colour, true height of one storey, and how many."""

    material: Material
    color: Color
    storey_m: float
    storeys: int


def built(material: Material, color: Color) -> Finish:
    """Finish of a piece of a building."""
    return Finish(material, Tag.BUILDING, color)


def rectangle(width_m: float, depth_m: float, inset_m: float = 0.0) -> shapely.Polygon:
    """Plan of a building or ledge; a negative inset stands out."""
    return shapely.box(inset_m - width_m / 2.0, inset_m, width_m / 2.0 - inset_m, depth_m - inset_m)


def body(plan: shapely.Polygon, bands: Sequence[Band], roof: Color, base_m: float = 0.0) -> tuple[Mesh, float]:
    """Closed block of storeys on a rectangular plan.

    Returns:
        The mesh, and the height of its flat roof.
    """
    ring = np.asarray(shapely.orient_polygons(plan).exterior.coords)[:-1]
    pieces, z_m, floor = [], base_m, 0
    for band in bands:
        top_m = z_m + band.storey_m * band.storeys
        floors = (floor * STOREY_M, (floor + band.storeys) * STOREY_M)
        pieces.append(_walls(built(band.material, band.color), ring, (z_m, top_m), floors))
        z_m, floor = top_m, floor + band.storeys
    underside = plate(built(Material.CONCRETE, roof), plan, 0.0).transformed(np.diag([1.0, 1.0, -1.0, 1.0]))
    lowered = np.eye(4)
    lowered[2, 3] = base_m
    return Mesh.merged([*pieces, plate(built(Material.ROOF, roof), plan, z_m), underside.transformed(lowered)]), z_m


def ledge(plan: shapely.Polygon, color: Color, bottom_m: float, height_m: float, out_m: float) -> Mesh:
    """A band of plaster that stands out from front and back, and a little from the sides, where a neighbour may be."""
    left_m, near_m, right_m, far_m = plan.bounds
    side_m = min(out_m, PARTY_LEDGE_M)
    outline = shapely.box(left_m - side_m, near_m - out_m, right_m + side_m, far_m + out_m)
    return extrusion(built(Material.PLASTER, color), outline, bottom_m, bottom_m + height_m)


def parapet(plan: shapely.Polygon, color: Color, roof_m: float, height_m: float = 0.9) -> Mesh:
    """A low wall around a flat roof."""
    left_m, near_m, right_m, far_m = plan.bounds
    inner = shapely.box(left_m + 0.3, near_m + 0.3, right_m - 0.3, far_m - 0.3)
    outer = shapely.box(left_m - 0.02, near_m - 0.02, right_m + 0.02, far_m + 0.02)
    ring = shapely.Polygon(outer.exterior, [inner.exterior])
    return extrusion(built(Material.PLASTER, color), ring, roof_m - 0.05, roof_m + height_m)


def pilasters(width_m: float, color: Color, bottom_m: float, top_m: float) -> list[Mesh]:
    """Upright strips between the bays of the front."""
    bays = max(1, round(width_m / BAY_M))
    height_m = top_m - bottom_m
    finish = built(Material.PLASTER, color)
    return [
        box(finish, (0.36, 0.24, height_m), (x_m, -0.02, bottom_m + height_m / 2.0))
        for x_m in np.linspace(-width_m / 2.0 + 0.18, width_m / 2.0 - 0.18, bays + 1)
    ]


def balconies(width_m: float, bays: Sequence[int], floors_m: Sequence[float], color: Color) -> list[Mesh]:
    """A balcony on the front at each given bay and floor height."""
    count = max(1, round(width_m / BAY_M))
    pieces = []
    for bay in bays:
        x_m = ((bay + 0.5) / count - 0.5) * width_m
        for z_m in floors_m:
            pieces.append(box(built(Material.CONCRETE, color), (2.5, 1.3, 0.16), (x_m, -0.6, z_m)))
            rail = shapely.Polygon(_RAIL_M + np.array([x_m, 0.0]))
            pieces.append(extrusion(built(Material.METAL, (70, 72, 74)), rail, z_m + 0.08, z_m + 1.0))
    return pieces


def door_x_m(width_m: float) -> float:
    """Where the front door is: in the bay next to the middle, in place of a window."""
    bays = max(1, round(width_m / BAY_M))
    return ((bays // 2 + 0.5) / bays - 0.5) * width_m


def door(x_m: float, color: Color, trim: Color) -> list[Mesh]:
    """A front door with steps and a small canopy."""
    return [
        box(built(Material.WOOD, color), (1.2, 0.12, 2.2), (x_m, -0.03, 1.25)),
        box(built(Material.PLASTER, trim), (1.6, 0.08, 2.45), (x_m, -0.02, 1.225)),
        box(built(Material.CONCRETE, trim), (1.7, 0.5, 0.15 + FOUNDATION_M), (x_m, -0.24, 0.075 - FOUNDATION_M / 2)),
        box(built(Material.METAL, (92, 94, 96)), (1.9, 0.8, 0.1), (x_m, -0.39, 2.75)),
    ]


def awning(x_m: float, width_m: float, color: Color, top_m: float) -> Mesh:
    """A sloping cloth over a shop window."""
    profile = shapely.Polygon([(0.02, top_m), (-1.15, top_m - 0.55), (-1.15, top_m - 0.75), (0.02, top_m - 0.08)])
    return along_front(extrusion(built(Material.CLOTH, color), profile, x_m - width_m / 2.0, x_m + width_m / 2.0))


def along_front(profile: Mesh) -> Mesh:
    """A solid drawn out along z from a profile in (x, y), laid so that the profile is in (y, z) and it runs along x."""
    cyclic = np.array([[0.0, 0.0, 1.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
    return profile.transformed(cyclic)


def _walls(finish: Finish, ring: Float64Array, z_m: tuple[float, float], v: tuple[float, float]) -> Mesh:
    """Upright quads around a counter-clockwise (N, 2) ring, a whole number of bays in u on each."""
    ends = np.roll(ring, -1, axis=0)
    lengths = np.linalg.norm(ends - ring, axis=1)
    outward = np.stack([ends[:, 1] - ring[:, 1], ring[:, 0] - ends[:, 0], np.zeros(len(ring))], axis=1)
    bottom, top = np.full((len(ring), 1), z_m[0]), np.full((len(ring), 1), z_m[1])
    quads = [np.hstack([ring, bottom]), np.hstack([ends, bottom]), np.hstack([ends, top]), np.hstack([ring, top])]
    u = np.maximum(1, np.round(lengths / BAY_M)) * BAY_M
    uv = np.stack([np.stack([u * side, np.full(len(ring), v[up])], axis=1) for side, up in _QUAD_UV], axis=1)
    return Mesh.indexed(
        np.stack(quads, axis=1).reshape(-1, 3),
        (np.arange(len(ring))[:, None, None] * 4 + _QUAD_TRIANGLES).reshape(-1, 3).astype(np.int32),
        normals=np.repeat(outward / lengths[:, None], 4, axis=0),
        material=finish.material,
        tag=finish.tag,
        color=finish.color,
        uv=uv.reshape(-1, 2),
    )


_RAIL_M = np.array(
    [[-1.22, 0], [-1.22, -1.22], [1.22, -1.22], [1.22, 0], [1.18, 0], [1.18, -1.18], [-1.18, -1.18], [-1.18, 0]]
)
_QUAD_UV = ((0, 0), (1, 0), (1, 1), (0, 1))
_QUAD_TRIANGLES = np.array([[0, 1, 2], [0, 2, 3]])
