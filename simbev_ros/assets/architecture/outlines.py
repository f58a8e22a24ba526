"""Buildings on outlines that a map prescribes, extruded to their height. Frame: map axes, z = 0 at the ground floor."""

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from simbev_ros.assets.architecture.facades import Band, body, building_finish, parapet
from simbev_ros.assets.architecture.roofs import hipped_roof
from simbev_ros.assets.architecture.shaped_roofs import fits_roof, shaped_roof, slope_across, usual_rise_m
from simbev_ros.assets.architecture.walls import Wall
from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.mesh.primitives import box, extrusion
from simbev_ros.assets.palette import Color, pick_color, rgb
from simbev_ros.foundation.geometry.transforms import matrices_from_xyz_rpy
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.land_features import Footprint

_STORY_M = 3.1
_MAX_HIPPED_HEIGHT_M, _MAX_HIPPED_M2 = 13.0, 320.0
_RECTANGULAR_SHARE = 0.94
_PITCH = 0.6
_CUT_CORNERS_M = 0.15
_MIN_WALLS_M = 2.4


def building_on_outline(building: Footprint, foundation_m: float, wall: Wall, rng: np.random.Generator) -> Mesh:
    """Build a building on a prescribed outline, courtyards included, with rows of windows and a door.

    Its roof has the shape that the map gives, or is flat if that does not fit the outline. If the map gives none, small
    rectangular buildings get hipped roofs, and all others flat roofs with a parapet.

    Args:
        building: The building; its outline in the frame of the mesh.
        foundation_m: Depth of its foundation below z = 0.
        wall: Material and color of its walls.
        rng: Random generator for colors.
    """
    plan = _polygon(shapely.orient_polygons(building.outline.simplify(_CUT_CORNERS_M)))
    name = _roof_of(building, plan)
    flat = name == "flat"
    color = pick_color(rng, "flat_roofs" if flat else "pitched_roofs")
    roof = color if building.roof_color < 0 else rgb(building.roof_color)
    slope_rad = building.slope_rad if np.isfinite(building.slope_rad) else slope_across(plan)
    tall_m = building.height_m - building.bottom_m
    rise_m = 0.0 if flat else min(building.roof_height_m or _usual_rise_m(plan, name, slope_rad), tall_m)
    stories = max(1, round((tall_m - rise_m) / _STORY_M))
    walls_m = max(_MIN_WALLS_M, tall_m - rise_m) if building.bottom_m == 0.0 else max(0.1, tall_m - rise_m)
    mesh, eaves_m = body(plan, [Band(wall.material, wall.color, walls_m / stories, stories)], roof, building.bottom_m)
    pieces = [mesh, _cover(plan, name, eaves_m, rise_m, slope_rad, roof, wall)]
    if building.bottom_m == 0.0:
        concrete = building_finish(Material.CONCRETE, (112, 110, 106))
        foot = extrusion(concrete, plan, -foundation_m, 0.25, crease_deg=0.0)
        pieces += [foot, _entrance(plan, foundation_m, rng)]
    return Mesh.merge(pieces)


def _roof_of(building: Footprint, plan: shapely.Polygon) -> str:
    """Name of the roof shape that is built."""
    frame = _polygon(plan.minimum_rotated_rectangle)
    rectangular = not plan.interiors and plan.area > _RECTANGULAR_SHARE * frame.area
    if building.roof == "hipped" and rectangular:
        return "hipped"
    if building.roof:
        return building.roof if fits_roof(plan, building.roof) else "flat"
    is_house = building.height_m < _MAX_HIPPED_HEIGHT_M and plan.area < _MAX_HIPPED_M2 and building.bottom_m == 0.0
    return "hipped" if is_house and rectangular else "flat"


def _usual_rise_m(plan: shapely.Polygon, name: str, slope_rad: float) -> float:
    """Height of a roof if the map gives none."""
    if name == "hipped":
        return _PITCH * float(_sides_m(_polygon(plan.minimum_rotated_rectangle)).min()) / 2.0
    return usual_rise_m(plan, name, slope_rad)


def _cover(
    plan: shapely.Polygon, name: str, eaves_m: float, rise_m: float, slope_rad: float, roof: Color, wall: Wall
) -> Mesh:
    """The roof above the ceiling of the highest story."""
    if name == "flat":
        return parapet(plan, wall.color, eaves_m, 0.6)
    if name == "hipped":
        frame = _polygon(plan.minimum_rotated_rectangle)
        return _hipped_over(frame, eaves_m, 2.0 * rise_m / float(_sides_m(frame).min()), roof)
    return shaped_roof(plan, name, eaves_m, rise_m, slope_rad, roof, wall)


def _polygon(geometry: BaseGeometry) -> shapely.Polygon:
    """Check that a geometry is a polygon, also for the type checker."""
    if not isinstance(geometry, shapely.Polygon):
        raise TypeError(f"a building's outline must be a polygon, not a {geometry.geom_type}")
    return geometry


def _hipped_over(frame: shapely.Polygon, eaves_m: float, pitch: float, roof: Color) -> Mesh:
    """A hipped roof over a rotated rectangle."""
    corners = np.asarray(shapely.orient_polygons(frame).exterior.coords)[:4, :2]
    width_m, depth_m = _sides_m(frame)
    along = (corners[1] - corners[0]) / width_m
    middle = (corners[0] + corners[1]) / 2.0
    return hipped_roof(width_m, depth_m, eaves_m, pitch, roof).transform(_facing(middle, along))


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
