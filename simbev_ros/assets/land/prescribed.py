"""Builds the buildings that the map prescribes, on their outlines."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import shapely

from simbev_ros.assets.architecture.outlines import building_on_outline
from simbev_ros.assets.architecture.walls import draw_wall
from simbev_ros.assets.land.blocks import Zones
from simbev_ros.assets.land.yard import Yard
from simbev_ros.assets.palette import rgb
from simbev_ros.assets.placement.tiles import upright_pose
from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.land_features import Footprint
from simbev_ros.maps.surroundings import SurroundingsRecipe

_NEAR_M = 60.0
_EAVES_M, _FOOT_M = 0.5, 0.3
_WALLS = {
    "industrial": ("metal", "concrete"),
    "warehouse": ("metal", "concrete"),
    "commercial": ("glass", "concrete", "brick"),
    "office": ("glass", "concrete"),
    "retail": ("plaster", "brick", "concrete"),
    "barn": ("timber",),
    "farm": ("timber", "brick"),
    "house": ("brick", "plaster", "timber"),
    "detached": ("brick", "plaster", "timber"),
}
_USUAL = ("brick", "plaster", "plaster", "concrete")
_TALL_M = 28.0


def build_prescribed(
    yard: Yard,
    buildings: Sequence[Footprint],
    zones: Zones,
) -> None:
    """Claim the outlines in and around a region, and build those whose representative point the region owns."""
    if not buildings:
        return
    outlines = np.array([building.outline for building in buildings])
    around = yard.inside.buffer(_NEAR_M, join_style="mitre")
    near = np.flatnonzero(shapely.intersects(around, outlines))
    footprints = shapely.buffer(outlines[near], _EAVES_M, join_style="mitre")
    beyond = ~shapely.contains(around, footprints)  # a claim costs time for all of its extent
    footprints[beyond] = overlay.intersection(footprints[beyond], around)
    yard.claims.add(*footprints)
    yard.walls.extend(outlines[near])
    owned = near[yard.ground.owns(shapely.get_coordinates(shapely.point_on_surface(outlines[near])))]
    for row in owned.tolist():
        _build(yard, buildings[row], zones)


def _build(yard: Yard, building: Footprint, zones: Zones) -> None:
    """Build one building, with its ground floor at the highest land along its walls."""
    middle_m = np.array(building.outline.centroid.coords[0])
    rng = yard.ground.stream(f"prescribed.{middle_m[0]:.1f}.{middle_m[1]:.1f}")
    heights_m = _around_m(yard, building.outline)
    recipe = next((recipe for recipe, area in zones if area.intersects(building.outline)), zones[-1][0])
    local = replace(building, outline=shapely.transform(building.outline, lambda xy: xy - middle_m))
    wall = draw_wall(_style(building, recipe, rng), rng)
    if building.color >= 0:
        wall = replace(wall, color=rgb(building.color))
    mesh = building_on_outline(local, float(np.ptp(heights_m)) + _FOOT_M, wall, rng)
    yard.tiles.place(mesh, upright_pose(middle_m, float(heights_m.max())))


def _around_m(yard: Yard, outline: shapely.Polygon) -> Float64Array:
    """Heights of the land along the walls."""
    return yard.ground.land_m(shapely.get_coordinates(shapely.segmentize(outline.exterior, 4.0)))


def _style(building: Footprint, recipe: SurroundingsRecipe, rng: np.random.Generator) -> str:
    """Style of the map or of the recipe, or one that suits the building if the recipe mixes styles."""
    if building.wall:
        return building.wall
    if recipe.building_style != "mixed":
        return recipe.building_style
    choices = ("glass", "concrete") if building.height_m > _TALL_M else _WALLS.get(building.use, _USUAL)
    return choices[int(rng.integers(len(choices)))]
