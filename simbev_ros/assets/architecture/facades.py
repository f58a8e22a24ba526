"""Walls with windows and their details: bands of stories, ledges, pilasters, balconies, doors, awnings.

The frame of a building: x along the street front, y away from the street (the front wall at y = 0), z up from the
ground floor. The material draws the windows: ``uv`` increases by ``BAY_M`` per bay and by ``STORY_M`` per floor, in
whole numbers of both on every wall, whatever the wall's true size; below v = 0 there are no windows.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely

from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.mesh.primitives import Finish, box, boxes, extrusion, plate
from simbev_ros.assets.palette import Color, shade_color
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import Float64Array

BAY_M = 3.0
STORY_M = 3.0
PARTY_LEDGE_M = 0.05
"""Maximum projection from the sides of a building that may have neighbors."""

_BLANK_V_M = -300.0
_MIN_WINDOWED_M = 1.6


@dataclass(frozen=True, slots=True)
class Band:
    """Stories of the same appearance: material, color, true height of one story, and number of stories."""

    material: Material
    color: Color
    story_m: float
    stories: int


def building_finish(material: Material, color: Color) -> Finish:
    """Finish of a building part of a material and color, with the semantic tag of buildings."""
    return Finish(material, Tag.BUILDING, color)


def rectangle(width_m: float, depth_m: float, inset_m: float = 0.0) -> shapely.Polygon:
    """Rectangular plan of a building or ledge; a negative inset makes it larger."""
    return shapely.box(inset_m - width_m / 2.0, inset_m, width_m / 2.0 - inset_m, depth_m - inset_m)


def body(plan: shapely.Polygon, bands: Sequence[Band], roof: Color, base_m: float = 0.0) -> tuple[Mesh, float]:
    """Build a closed block of stories on any plan, courtyards included.

    Args:
        plan: Plan of the walls, meters.
        bands: Stories from the bottom up.
        roof: Color of the flat roof.
        base_m: Height at which the walls begin.

    Returns:
        The mesh, and the height of its flat roof.
    """
    plan = shapely.orient_polygons(plan)
    rings = [np.asarray(ring.coords)[:-1, :2] for ring in (plan.exterior, *plan.interiors)]
    pieces, z_m, floor = [], base_m, 0
    for band in bands:
        top_m = z_m + band.story_m * band.stories
        floors = (floor * STORY_M, (floor + band.stories) * STORY_M)
        pieces += [_walls(building_finish(band.material, band.color), ring, (z_m, top_m), floors) for ring in rings]
        z_m, floor = top_m, floor + band.stories
    ceiling = plate(building_finish(Material.ROOF, roof), plan, z_m)
    return Mesh.merge([*pieces, ceiling, _underside(ceiling, base_m)]), z_m


def without_windows(mesh: Mesh) -> Mesh:
    """Copy of a mesh without windows in its walls."""
    return replace(mesh, uv=mesh.uv + np.array([0.0, _BLANK_V_M], np.float32))


def ledge(plan: shapely.Polygon, color: Color, bottom_m: float, height_m: float, out_m: float) -> Mesh:
    """Build a plaster band that projects at front and back, and less at the sides, where a neighbor may be."""
    left_m, near_m, right_m, far_m = plan.bounds
    side_m = min(out_m, PARTY_LEDGE_M)
    size_m = (right_m - left_m + 2.0 * side_m, far_m - near_m + 2.0 * out_m, height_m)
    center_m = ((left_m + right_m) / 2.0, (near_m + far_m) / 2.0, bottom_m + height_m / 2.0)
    return box(building_finish(Material.PLASTER, color), size_m, center_m)


def plinth(plan: shapely.Polygon, foundation_m: float) -> Mesh:
    """Build the base of the walls, which reaches into the ground."""
    return ledge(plan, (112, 110, 106), -foundation_m, foundation_m + 0.25, 0.06)


def parapet(plan: shapely.Polygon, color: Color, roof_m: float, height_m: float = 0.9) -> Mesh:
    """Build a low wall around a flat roof."""
    outer = plan.buffer(0.02, join_style="mitre")
    ring = outer.difference(plan.buffer(-0.3, join_style="mitre"))
    walls = [part for part in shapely.get_parts(ring) if part.geom_type == "Polygon"]
    finish = building_finish(Material.PLASTER, color)
    return Mesh.merge([extrusion(finish, wall, roof_m - 0.05, roof_m + height_m, crease_deg=0.0) for wall in walls])


def pilasters(width_m: float, color: Color, bottom_m: float, top_m: float) -> Mesh:
    """Build vertical strips between the bays of the front."""
    bays = max(1, round(width_m / BAY_M))
    height_m = top_m - bottom_m
    x_m = np.linspace(-width_m / 2.0 + 0.18, width_m / 2.0 - 0.18, bays + 1)
    centers_m = np.column_stack([x_m, np.full(bays + 1, -0.02), np.full(bays + 1, bottom_m + height_m / 2.0)])
    return boxes(building_finish(Material.PLASTER, color), np.tile((0.36, 0.24, height_m), (bays + 1, 1)), centers_m)


def balconies(width_m: float, bays: Sequence[int], floors_m: Sequence[float], color: Color) -> list[Mesh]:
    """Build a balcony on the front at each given bay and floor height."""
    count = max(1, round(width_m / BAY_M))
    x_m = ((np.asarray(bays) + 0.5) / count - 0.5) * width_m
    centers_m = np.array([(x, -0.6, z) for x in x_m for z in floors_m]).reshape(-1, 1, 3)
    if len(centers_m) == 0:
        return []
    rails_m = np.tile(_RAIL_SIZES_M, (len(centers_m), 1))
    return [
        boxes(
            building_finish(Material.CONCRETE, color), np.tile((2.5, 1.3, 0.16), (len(centers_m), 1)), centers_m[:, 0]
        ),
        boxes(
            building_finish(Material.PLASTER, shade_color(color, 0.85)),
            rails_m,
            (centers_m + _RAIL_CENTERS_M).reshape(-1, 3),
        ),
    ]


def door_x_m(width_m: float) -> float:
    """Coordinate x of the front door: in the bay next to the middle, in place of a window."""
    bays = max(1, round(width_m / BAY_M))
    return ((bays // 2 + 0.5) / bays - 0.5) * width_m


def door(x_m: float, color: Color, trim: Color, foundation_m: float, canopy: bool = True) -> list[Mesh]:
    """Build a front door with a step down to the ground and a small canopy."""
    pieces = [
        box(building_finish(Material.WOOD, color), (1.2, 0.12, 2.2), (x_m, -0.03, 1.25)),
        box(building_finish(Material.PLASTER, trim), (1.6, 0.08, 2.45), (x_m, -0.02, 1.225)),
        box(
            building_finish(Material.CONCRETE, trim),
            (1.7, 0.5, 0.15 + foundation_m),
            (x_m, -0.24, 0.075 - foundation_m / 2),
        ),
    ]
    return (
        [*pieces, box(building_finish(Material.METAL, (92, 94, 96)), (1.9, 0.8, 0.1), (x_m, -0.39, 2.75))]
        if canopy
        else pieces
    )


def gate(x_m: float, width_m: float, height_m: float, color: Color, frame: Color) -> list[Mesh]:
    """Build a framed sectional door of a garage, barn or hall, its lower edge at the floor."""
    steps_m = np.arange(0.0, height_m - 0.1, max(0.5, height_m / 6.0))
    slats = np.column_stack([np.full(len(steps_m), x_m), np.full(len(steps_m), -0.075), steps_m + 0.1])
    return [
        box(
            building_finish(Material.PLASTER, frame),
            (width_m + 0.36, 0.1, height_m + 0.18),
            (x_m, -0.01, height_m / 2 + 0.09),
        ),
        box(building_finish(Material.METAL, color), (width_m, 0.12, height_m), (x_m, -0.01, height_m / 2.0)),
        boxes(building_finish(Material.METAL, color), np.tile((width_m, 0.03, 0.06), (len(steps_m), 1)), slats),
    ]


def awning(width_m: float, color: Color, top_m: float) -> Mesh:
    """Build a sloping cloth awning over a shop window, its middle at x = 0."""
    profile = shapely.Polygon([(0.02, top_m), (-1.15, top_m - 0.55), (-1.15, top_m - 0.75), (0.02, top_m - 0.08)])
    cloth = extrusion(building_finish(Material.CLOTH, color), profile, -width_m / 2.0, width_m / 2.0, crease_deg=0.0)
    return lay_along_front(cloth)


def lay_along_front(profile: Mesh) -> Mesh:
    """Rotate a solid extruded along z from a profile in (x, y): it then runs along x, the profile is in (y, z)."""
    cyclic = np.array([[0.0, 0.0, 1.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
    return profile.transform(cyclic)


def move_mesh(mesh: Mesh, x_m: float, y_m: float, quarter_turns: int = 0) -> Mesh:
    """Copy of a mesh, turned counter-clockwise about z by quarter turns, then shifted in the ground plane."""
    cosine, sine = ((1, 0), (0, 1), (-1, 0), (0, -1))[quarter_turns % 4]
    pose = np.array([[cosine, -sine, 0, x_m], [sine, cosine, 0, y_m], [0, 0, 1, 0], [0, 0, 0, 1]], np.float64)
    return mesh.transform(pose)


def _underside(ceiling: Mesh, z_m: float) -> Mesh:
    """Downward-facing copy of a flat roof's plate, at a height."""
    vertices = ceiling.vertices.copy()
    vertices[:, 2] = z_m
    triangles = np.ascontiguousarray(ceiling.triangles[:, ::-1])
    material = np.full(len(vertices), Material.CONCRETE, np.uint8)
    return replace(ceiling, vertices=vertices, normals=-ceiling.normals, material=material, triangles=triangles)


def _walls(finish: Finish, ring: Float64Array, z_m: tuple[float, float], v: tuple[float, float]) -> Mesh:
    """Upright quads along an (N, 2) ring with the outside on its right; u spans a whole number of bays on each quad."""
    ends = np.roll(ring, -1, axis=0)
    along = ends - ring
    lengths = np.hypot(along[:, 0], along[:, 1])
    outward = np.column_stack([along[:, 1], -along[:, 0], np.zeros(len(ring))]) / lengths[:, None]
    corners = np.stack([np.column_stack([xy, np.full(len(ring), z)]) for xy, z in _quad(ring, ends, z_m)], axis=1)
    u = np.maximum(1, np.round(lengths / BAY_M)) * BAY_M
    low_v, high_v = (np.where(lengths < _MIN_WINDOWED_M, value + _BLANK_V_M, value) for value in v)
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
    """Corners of wall quads in plan and their heights, counter-clockwise seen from outside."""
    return (starts, z_m[0]), (ends, z_m[0]), (ends, z_m[1]), (starts, z_m[1])


_RAIL_SIZES_M = np.array([[2.44, 0.04, 0.92], [0.04, 1.18, 0.92], [0.04, 1.18, 0.92]])
_RAIL_CENTERS_M = np.array([[0.0, -0.6, 0.54], [-1.2, 0.01, 0.54], [1.2, 0.01, 0.54]])
_QUAD_TRIANGLES = np.array([[0, 1, 2], [0, 2, 3]])
