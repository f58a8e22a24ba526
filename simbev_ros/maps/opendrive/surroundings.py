"""What an OpenDRIVE file lets one guess about the land beside its roads."""

from collections.abc import Sequence

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from simbev_ros.maps.land_features import MapFeatures, Zone
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.layout import Strip
from simbev_ros.maps.surroundings import SurroundingsRecipe

_FAST_MPS = 80.5 / 3.6
_COUNTRY_REACH_M = 150.0
_TOWN_REACH_M = 70.0
_DETAIL_M = 5.0
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


def features_of(strips: Sequence[Strip]) -> MapFeatures:
    """Houses everywhere, but farmland beside fast roads without sidewalks."""
    walked = {strip.road for strip in strips if strip.kind is LaneKind.SIDEWALK}
    driven = [strip for strip in strips if strip.kind is LaneKind.DRIVING and not strip.junction]
    fast = [strip for strip in driven if strip.speed_mps > _FAST_MPS and strip.road not in walked]
    slow = [strip for strip in driven if strip.speed_mps <= _FAST_MPS or strip.road in walked]
    country = _around(fast, _COUNTRY_REACH_M).difference(_around(slow, _TOWN_REACH_M))
    parts = [part for part in shapely.get_parts(country.simplify(_DETAIL_M)) if part.area > _TOWN_REACH_M**2]
    return MapFeatures(_TOWN, tuple(Zone(part, _COUNTRY) for part in parts))


def _around(strips: Sequence[Strip], reach_m: float) -> BaseGeometry:
    """All that is within reach of strips."""
    lines = shapely.simplify([shapely.LineString(strip.center_m[:, :2]) for strip in strips], _DETAIL_M)
    return shapely.union_all(shapely.buffer(np.asarray(lines, dtype=object), reach_m, quad_segs=4))
