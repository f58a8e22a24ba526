"""The land around the roads of an OpenDRIVE file: guessed from speed limits and sidewalks; objects as in the file."""

from collections.abc import Sequence

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from simbev_ros.foundation.geometry import overlay
from simbev_ros.maps.findings import Findings
from simbev_ros.maps.land_features import Footprint, MapFeatures, MapObject, Zone
from simbev_ros.maps.roads.lane_kind import ROAD_KINDS, LaneKind
from simbev_ros.maps.roads.layout import Strip
from simbev_ros.maps.roads.surface import strip_polygons
from simbev_ros.maps.surroundings import SurroundingsRecipe

_FAST_MPS = 80.5 / 3.6
_COUNTRY_RADIUS_M = 150.0
_TOWN_RADIUS_M = 70.0
_SIMPLIFICATION_M = 5.0
_TOUCHING_M = 0.1
_TOWN = SurroundingsRecipe(use="residential")
_COUNTRY = SurroundingsRecipe(
    use="farmland",
    building_style="timber",
    building_density=0.15,
    building_setback_m=12.0,
    tree_spacing_m=0.0,
    street_light_spacing_m=0.0,
    furniture_density=0.0,
    fence_density=0.3,
)


def features_of(
    strips: Sequence[Strip], objects: Sequence[MapObject], buildings: Sequence[Footprint], notes: Findings
) -> MapFeatures:
    """Land features: residential everywhere, but farmland beside fast roads without sidewalks.

    Args:
        strips: All strips of the map.
        objects: The objects of the file.
        buildings: The buildings of the file; if there are any, no others are generated.
        notes: Receives what is left out: buildings that stand on carriageways.
    """
    with_sidewalk = {strip.road for strip in strips if strip.kind is LaneKind.SIDEWALK}
    driven = [strip for strip in strips if strip.kind is LaneKind.DRIVING and not strip.junction]
    fast = [strip for strip in driven if strip.speed_mps > _FAST_MPS and strip.road not in with_sidewalk]
    slow = [strip for strip in driven if strip.speed_mps <= _FAST_MPS or strip.road in with_sidewalk]
    country = _buffered(fast, _COUNTRY_RADIUS_M).difference(_buffered(slow, _TOWN_RADIUS_M))
    parts = [part for part in shapely.get_parts(country.simplify(_SIMPLIFICATION_M)) if part.area > _TOWN_RADIUS_M**2]
    zones = tuple(Zone(part, _COUNTRY) for part in parts)
    clear = _clear_buildings(strips, buildings)
    for _ in range(len(buildings) - len(clear)):
        notes.left_out("a building that stands on a carriageway is left out")
    return MapFeatures(_TOWN, zones, buildings=clear or None, objects=tuple(objects))


def _clear_buildings(strips: Sequence[Strip], buildings: Sequence[Footprint]) -> tuple[Footprint, ...]:
    """The buildings that do not overlap a carriageway."""
    carriageway = shapely.STRtree(strip_polygons([strip for strip in strips if strip.kind in ROAD_KINDS]))
    outlines = shapely.buffer(np.array([building.outline for building in buildings], dtype=object), -_TOUCHING_M)
    taken = set(carriageway.query(outlines, predicate="intersects")[0].tolist())
    return tuple(building for row, building in enumerate(buildings) if row not in taken)


def _buffered(strips: Sequence[Strip], radius_m: float) -> BaseGeometry:
    """The area within a radius of the strips."""
    lines = shapely.simplify([shapely.LineString(strip.center_m[:, :2]) for strip in strips], _SIMPLIFICATION_M)
    return overlay.union_all(shapely.buffer(np.asarray(lines, dtype=object), radius_m, quad_segs=4))
