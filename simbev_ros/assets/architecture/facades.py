"""Walls with windows, and what hangs on them: bands of storeys, ledges, pilasters, balconies, doors, awnings.

A building's frame: x along the street front, y away from the street (the front wall at y = 0), z up from the floor of
the ground storey. Windows are drawn by the material: ``uv`` grows by ``BAY_M`` from bay to bay and by ``STOREY_M`` from
floor to floor, whole numbers of both on every wall, whatever the wall's true measures; below v = 0 there are none.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely

from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.mesh.primitives import Finish, box, boxes, extrusion, plate
from simbev_ros.assets.palette import Color, shaded
from simbev_ros.semantics import Tag
from simbev_ros.types import Float64Array

BAY_M = 3.0
STOREY_M = 3.0
PARTY_LEDGE_M = 0.05
"""Nothing stands out farther than this from the sides of a building that may have neighbours."""

_BLANK_V_M = -300.0
_SHORTEST_WINDOWED_M = 1.6


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
    """Closed block of storeys on any plan, courtyards included.

    Returns:
        The mesh, and the height of its flat roof.
    """
    plan = shapely.orient_polygons(plan)
    rings = [np.asarray(ring.coords)[:-1, :2] for ring in (plan.exterior, *plan.interiors)]
    pieces, z_m, floor = [], base_m, 0
    for band in bands:
        top_m = z_m + band.storey_m * band.storeys
        floors = (floor * STOREY_M, (floor + band.storeys) * STOREY_M)
        pieces += [_walls(built(band.material, band.color), ring, (z_m, top_m), floors) for ring in rings]
        z_m, floor = top_m, floor + band.storeys
    ceiling = plate(built(Material.ROOF, roof), plan, z_m)
    return Mesh.merged([*pieces, ceiling, _underside(ceiling, base_m)]), z_m


def windowless(mesh: Mesh) -> Mesh:
    """The same, its walls without windows."""
    return replace(mesh, uv=mesh.uv + np.array([0.0, _BLANK_V_M], np.float32))


def ledge(plan: shapely.Polygon, color: Color, bottom_m: float, height_m: float, out_m: float) -> Mesh:
    """A band of plaster that stands out from front and back, and a little from the sides, where a neighbour may be."""
    left_m, near_m, right_m, far_m = plan.bounds
    side_m = min(out_m, PARTY_LEDGE_M)
    size_m = (right_m - left_m + 2.0 * side_m, far_m - near_m + 2.0 * out_m, height_m)
    center_m = ((left_m + right_m) / 2.0, (near_m + far_m) / 2.0, bottom_m + height_m / 2.0)
    return box(built(Material.PLASTER, color), size_m, center_m)


def plinth(plan: shapely.Polygon, foundation_m: float) -> Mesh:
    """The foot of the walls, reaching into the ground."""
    return ledge(plan, (112, 110, 106), -foundation_m, foundation_m + 0.25, 0.06)


def parapet(plan: shapely.Polygon, color: Color, roof_m: float, height_m: float = 0.9) -> Mesh:
    """A low wall around a flat roof."""
    outer = plan.buffer(0.02, join_style="mitre")
    ring = outer.difference(plan.buffer(-0.3, join_style="mitre"))
    walls = [part for part in shapely.get_parts(ring) if part.geom_type == "Polygon"]
    finish = built(Material.PLASTER, color)
    return Mesh.merged([extrusion(finish, wall, roof_m - 0.05, roof_m + height_m, crease_deg=0.0) for wall in walls])


def pilasters(width_m: float, color: Color, bottom_m: float, top_m: float) -> Mesh:
    """Upright strips between the bays of the front."""
    bays = max(1, round(width_m / BAY_M))
    height_m = top_m - bottom_m
    x_m = np.linspace(-width_m / 2.0 + 0.18, width_m / 2.0 - 0.18, bays + 1)
    places = np.column_stack([x_m, np.full(bays + 1, -0.02), np.full(bays + 1, bottom_m + height_m / 2.0)])
    return boxes(built(Material.PLASTER, color), np.tile((0.36, 0.24, height_m), (bays + 1, 1)), places)


def balconies(width_m: float, bays: Sequence[int], floors_m: Sequence[float], color: Color) -> list[Mesh]:
    """A balcony on the front at each given bay and floor height."""
    count = max(1, round(width_m / BAY_M))
    x_m = ((np.asarray(bays) + 0.5) / count - 0.5) * width_m
    spots = np.array([(x, -0.6, z) for x in x_m for z in floors_m]).reshape(-1, 1, 3)
    if len(spots) == 0:
        return []
    rails_m = np.tile(_RAIL_SIZES_M, (len(spots), 1))
    return [
        boxes(built(Material.CONCRETE, color), np.tile((2.5, 1.3, 0.16), (len(spots), 1)), spots[:, 0]),
        boxes(built(Material.PLASTER, shaded(color, 0.85)), rails_m, (spots + _RAIL_PLACES_M).reshape(-1, 3)),
    ]


def door_x_m(width_m: float) -> float:
    """Where the front door is: in the bay next to the middle, in place of a window."""
    bays = max(1, round(width_m / BAY_M))
    return ((bays // 2 + 0.5) / bays - 0.5) * width_m


def door(x_m: float, color: Color, trim: Color, foundation_m: float, canopy: bool = True) -> list[Mesh]:
    """A front door with a step down to the ground and a small canopy."""
    pieces = [
        box(built(Material.WOOD, color), (1.2, 0.12, 2.2), (x_m, -0.03, 1.25)),
        box(built(Material.PLASTER, trim), (1.6, 0.08, 2.45), (x_m, -0.02, 1.225)),
        box(built(Material.CONCRETE, trim), (1.7, 0.5, 0.15 + foundation_m), (x_m, -0.24, 0.075 - foundation_m / 2)),
    ]
    return (
        [*pieces, box(built(Material.METAL, (92, 94, 96)), (1.9, 0.8, 0.1), (x_m, -0.39, 2.75))] if canopy else pieces
    )


def gate(x_m: float, width_m: float, height_m: float, color: Color, frame: Color) -> list[Mesh]:
    """A sectional door of a garage, barn or hall in its frame, its lower edge at the floor."""
    steps_m = np.arange(0.0, height_m - 0.1, max(0.5, height_m / 6.0))
    slats = np.column_stack([np.full(len(steps_m), x_m), np.full(len(steps_m), -0.075), steps_m + 0.1])
    return [
        box(built(Material.PLASTER, frame), (width_m + 0.36, 0.1, height_m + 0.18), (x_m, -0.01, height_m / 2 + 0.09)),
        box(built(Material.METAL, color), (width_m, 0.12, height_m), (x_m, -0.01, height_m / 2.0)),
        boxes(built(Material.METAL, color), np.tile((width_m, 0.03, 0.06), (len(steps_m), 1)), slats),
    ]


def awning(x_m: float, width_m: float, color: Color, top_m: float) -> Mesh:
    """A sloping cloth over a shop window."""
    profile = shapely.Polygon([(0.02, top_m), (-1.15, top_m - 0.55), (-1.15, top_m - 0.75), (0.02, top_m - 0.08)])
    cloth = extrusion(built(Material.CLOTH, color), profile, x_m - width_m / 2.0, x_m + width_m / 2.0, crease_deg=0.0)
    return along_front(cloth)


def along_front(profile: Mesh) -> Mesh:
    """A solid drawn out along z from a profile in (x, y), laid so that the profile is in (y, z) and it runs along x."""
    cyclic = np.array([[0.0, 0.0, 1.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
    return profile.transformed(cyclic)


def moved(mesh: Mesh, x_m: float, y_m: float, quarter_turns: int = 0) -> Mesh:
    """The mesh turned counter-clockwise about z, then shifted."""
    cosine, sine = ((1, 0), (0, 1), (-1, 0), (0, -1))[quarter_turns % 4]
    pose = np.array([[cosine, -sine, 0, x_m], [sine, cosine, 0, y_m], [0, 0, 1, 0], [0, 0, 0, 1]], np.float64)
    return mesh.transformed(pose)


def _underside(ceiling: Mesh, z_m: float) -> Mesh:
    """A flat roof's plate seen from below, at a height."""
    vertices = ceiling.vertices.copy()
    vertices[:, 2] = z_m
    triangles = np.ascontiguousarray(ceiling.triangles[:, ::-1])
    material = np.full(len(vertices), Material.CONCRETE, np.uint8)
    return replace(ceiling, vertices=vertices, normals=-ceiling.normals, material=material, triangles=triangles)


def _walls(finish: Finish, ring: Float64Array, z_m: tuple[float, float], v: tuple[float, float]) -> Mesh:
    """Upright quads along an (N, 2) ring, land to its right, a whole number of bays in u on each."""
    ends = np.roll(ring, -1, axis=0)
    along = ends - ring
    lengths = np.hypot(along[:, 0], along[:, 1])
    outward = np.column_stack([along[:, 1], -along[:, 0], np.zeros(len(ring))]) / lengths[:, None]
    corners = np.stack([np.column_stack([xy, np.full(len(ring), z)]) for xy, z in _quad(ring, ends, z_m)], axis=1)
    u = np.maximum(1, np.round(lengths / BAY_M)) * BAY_M
    low_v, high_v = (np.where(lengths < _SHORTEST_WINDOWED_M, value + _BLANK_V_M, value) for value in v)
    zero = np.zeros(len(ring))
    sides = ((zero, low_v), (u, low_v), (u, high_v), (zero, high_v))
    uv = np.stack([np.stack(side, axis=1) for side in sides], axis=1)
    return Mesh.indexed(
        corners.reshape(-1, 3),
        (np.arange(len(ring))[:, None, None] * 4 + _QUAD_TRIANGLES).reshape(-1, 3).astype(np.int32),
        normals=np.repeat(outward, 4, axis=0),
        material=finish.material,
        tag=finish.tag,
        color=finish.color,
        uv=uv.reshape(-1, 2),
    )


def _quad(starts: Float64Array, ends: Float64Array, z_m: tuple[float, float]) -> tuple[tuple[Float64Array, float], ...]:
    """Corners in plan and their heights, counter-clockwise from outside."""
    return (starts, z_m[0]), (ends, z_m[0]), (ends, z_m[1]), (starts, z_m[1])


_RAIL_SIZES_M = np.array([[2.44, 0.04, 0.92], [0.04, 1.18, 0.92], [0.04, 1.18, 0.92]])
_RAIL_PLACES_M = np.array([[0.0, -0.6, 0.54], [-1.2, 0.01, 0.54], [1.2, 0.01, 0.54]])
_QUAD_TRIANGLES = np.array([[0, 1, 2], [0, 2, 3]])
