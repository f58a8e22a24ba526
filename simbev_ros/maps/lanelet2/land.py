"""Builds the land beside the roads from the areas of a Lanelet2 map: buildings and vegetation."""

from collections.abc import Iterable, Sequence
from dataclasses import replace

import shapely

from simbev_ros.foundation.geometry.plan_view import polygon_parts
from simbev_ros.maps.findings import Findings
from simbev_ros.maps.land_features import Footprint, MapFeatures, Zone
from simbev_ros.maps.lanelet2.document import Area
from simbev_ros.maps.opendrive.surroundings import features_of
from simbev_ros.maps.osm.lengths import parse_length_m
from simbev_ros.maps.roads.layout import Strip
from simbev_ros.maps.surroundings import SurroundingsRecipe

_BUILDING_HEIGHT_M = 8.0
_MAX_BUILDING_HEIGHT_M = 500.0
_MIN_AREA_M2 = 4.0
_MAX_CORNERS = 2_000
_VEGETATION = SurroundingsRecipe(use="park", building_density=0.0, furniture_density=0.0, fence_density=0.0)


def land_of(areas: Iterable[Area], strips: Sequence[Strip], notes: Findings) -> MapFeatures:
    """Land features: those of an OpenDRIVE map, with the buildings of the file if it has any, and its vegetation."""
    buildings: list[Footprint] = []
    zones: list[Zone] = []
    for area in areas:
        subtype = area.tags.get("subtype") or area.tags.get("type", "")
        if subtype not in ("building", "vegetation") or len(area.outline_m) > _MAX_CORNERS:
            continue
        for part in polygon_parts(shapely.make_valid(shapely.Polygon(area.outline_m[:, :2]))).tolist():
            if part.area < _MIN_AREA_M2:
                continue
            if subtype == "building":
                height_m = parse_length_m(area.tags.get("height", "")) or _BUILDING_HEIGHT_M
                buildings.append(Footprint(part, min(height_m, _MAX_BUILDING_HEIGHT_M)))
            else:
                zones.append(Zone(part, _VEGETATION))
    features = features_of(strips, (), buildings, notes)
    return replace(features, zones=(*features.zones, *zones))
