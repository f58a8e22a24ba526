"""Buildings on outlines that a map prescribes, extruded to their height. Frame: map axes, z = 0 at the ground floor."""

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from simbev_ros.assets.architecture.facades import Band, body, building_finish, parapet
from simbev_ros.assets.architecture.roofs import hipped_roof
from simbev_ros.assets.architecture.walls import Wall
from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.mesh.primitives import box, extrusion
from simbev_ros.assets.palette import pick_color
from simbev_ros.geometry.transforms import matrices_from_xyz_rpy
from simbev_ros.types import Float64Array

_STORY_M = 3.1
_MAX_HIPPED_HEIGHT_M, _MAX_HIPPED_M2 = 13.0, 320.0
_RECTANGULAR_SHARE = 0.94
_PITCH = 0.6
_CUT_CORNERS_M = 0.15


def building_on_outline(
    outline: shapely.Polygon, height_m: float, foundation_m: float, wall: Wall, rng: np.random.Generator
) -> Mesh:
    """Build a building on a prescribed outline, courtyards included, with rows of windows and a door.

    Small rectangular buildings get hipped roofs, all others flat roofs with a parapet.

    Args:
        outline: Outline in the frame of the mesh, meters.
        height_m: Height of the whole building.
        foundation_m: Depth of its foundation below z = 0.
        wall: Material and color of its walls.
        rng: Random generator for colors.
    """
    plan = _polygon(shapely.orient_polygons(outline.simplify(_CUT_CORNERS_M)))
    frame = _polygon(plan.minimum_rotated_rectangle)
    is_house = height_m < _MAX_HIPPED_HEIGHT_M and plan.area < _MAX_HIPPED_M2
    hipped = is_house and not plan.interiors and plan.area > _RECTANGULAR_SHARE * frame.area
    roof = pick_color(rng, "pitched_roofs" if hipped else "flat_roofs")
    rise_m = _PITCH * _sides_m(frame).min() / 2.0 if hipped else 0.0
    stories = max(1, round((height_m - rise_m) / _STORY_M))
    story_m = max(2.4, height_m - rise_m) / stories
    mesh, eaves_m = body(plan, [Band(wall.material, wall.color, story_m, stories)], roof)
    foot = extrusion(building_finish(Material.CONCRETE, (112, 110, 106)), plan, -foundation_m, 0.25, crease_deg=0.0)
    cover = _hipped_over(frame, eaves_m, roof) if hipped else parapet(plan, wall.color, eaves_m, 0.6)
    return Mesh.merge([mesh, foot, cover, _entrance(plan, foundation_m, rng)])


def _polygon(geometry: BaseGeometry) -> shapely.Polygon:
    """Check that a geometry is a polygon, also for the type checker."""
    if not isinstance(geometry, shapely.Polygon):
        raise TypeError(f"a building's outline must be a polygon, not a {geometry.geom_type}")
    return geometry


def _hipped_over(frame: shapely.Polygon, eaves_m: float, roof: tuple[int, int, int]) -> Mesh:
    """A hipped roof over a rotated rectangle."""
    corners = np.asarray(shapely.orient_polygons(frame).exterior.coords)[:4, :2]
    width_m, depth_m = _sides_m(frame)
    along = (corners[1] - corners[0]) / width_m
    middle = (corners[0] + corners[1]) / 2.0
    return hipped_roof(width_m, depth_m, eaves_m, _PITCH, roof).transform(_facing(middle, along))


def _sides_m(frame: shapely.Polygon) -> Float64Array:
    """(2,) lengths of the first two sides of a counter-clockwise rectangle."""
    corners = np.asarray(shapely.orient_polygons(frame).exterior.coords)[:3, :2]
    return np.linalg.norm(np.diff(corners, axis=0), axis=1)


def _entrance(plan: shapely.Polygon, foundation_m: float, rng: np.random.Generator) -> Mesh:
    """A door in the middle of the longest wall."""
    corners = np.asarray(plan.exterior.coords)[:, :2]
    sides = np.diff(corners, axis=0)
    longest = int(np.argmax(np.linalg.norm(sides, axis=1)))
    along = sides[longest] / np.linalg.norm(sides[longest])
    leaf = Mesh.merge(
        [
            box(building_finish(Material.PLASTER, (196, 192, 184)), (1.6, 0.12, 2.4), (0.0, -0.02, 1.2)),
            box(building_finish(Material.WOOD, pick_color(rng, "doors")), (1.2, 0.18, 2.15), (0.0, -0.03, 1.15)),
            _step(foundation_m),
        ]
    )
    return leaf.transform(_facing((corners[longest] + corners[longest + 1]) / 2.0, along))


def _step(foundation_m: float) -> Mesh:
    height_m = 0.12 + foundation_m
    return box(
        building_finish(Material.CONCRETE, (150, 147, 140)), (1.8, 0.5, height_m), (0.0, -0.2, 0.12 - height_m / 2.0)
    )


def _facing(position_m: Float64Array, along: Float64Array) -> Float64Array:
    """(4, 4) pose of an object whose front runs along a direction and is centered at a position."""
    yaw_rad = float(np.arctan2(along[1], along[0]))
    return matrices_from_xyz_rpy(np.array([*position_m, 0.0]), np.array([0.0, 0.0, yaw_rad]))
