"""Extracts the land features of an OpenStreetMap file: zones, water, buildings and objects."""

from collections.abc import Iterator, Sequence

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry
from shapely.ops import substring

from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.types import AnyArray, Float64Array
from simbev_ros.maps.findings import Finding, Outcome
from simbev_ros.maps.land_features import MapFeatures, SpeedBump, Zone
from simbev_ros.maps.osm.areas import Area, areas_of, polygons
from simbev_ros.maps.osm.buildings import buildings_of
from simbev_ros.maps.osm.built_up import built_up_zones
from simbev_ros.maps.osm.coast import sea_of
from simbev_ros.maps.osm.data import OsmData
from simbev_ros.maps.osm.land_rules import land_rules
from simbev_ros.maps.osm.objects import object_rules, objects_of
from simbev_ros.maps.osm.roads import OsmRoad, line_of
from simbev_ros.maps.osm.water import water_of

_MARGIN_M = 1500.0
_HORIZON_M = 3500.0  # as far as land is drawn beyond the roads
_OUTWARD = np.array([-1.0, -1.0, 1.0, 1.0])
_LANE_M, _SIDEWALK_M, _PATH_M, _VERGE_M = 3.3, 2.4, 2.2, 2.0
_ZONE_KEYS = ("leisure", "amenity", "natural", "landuse")


def features_of(data: OsmData, xy_m: Float64Array, roads: Sequence[OsmRoad]) -> tuple[MapFeatures, tuple[Finding, ...]]:
    """The land features of a file, and findings about what was left out.

    Args:
        data: The file.
        xy_m: (N, 2) positions of its nodes, map frame.
        roads: The roads that are built.
    """
    bounds_m = shapely.total_bounds(_lines(roads, xy_m))
    extent, horizon = (shapely.box(*(bounds_m + margin_m * _OUTWARD)) for margin_m in (_MARGIN_M, _HORIZON_M))
    areas = [area for area in areas_of(data, xy_m) if area.polygon.intersects(extent)]
    embanked = [road for road in roads if not (road.way.bridge or road.way.tunnel)]
    sea, sea_findings = sea_of(data, xy_m, horizon, _lines(embanked, xy_m))
    water = water_of(data, xy_m, areas, sea, extent, _bands(embanked, xy_m, _VERGE_M))
    buildings, findings = buildings_of(areas, _bands([road for road in roads if road.way.layer >= 0], xy_m, 0.0))
    rules, zones = land_rules(), _zones(areas, extent)
    if zones:
        urban = [road for road in roads if road.way.tags.get("highway") in rules.urban_roads]
        zones = (*built_up_zones(buildings, _lines(urban, xy_m), extent), *zones)
    objects, object_findings = objects_of(data, xy_m, areas, extent)
    features = MapFeatures(
        rules.outside if zones else rules.anywhere,
        zones=zones,
        water=water,
        buildings=buildings or None,
        objects=objects,
        speed_bumps=tuple(_speed_bumps(data, xy_m, roads)),
    )
    return features, (
        *sea_findings,
        *object_findings,
        *(findings if buildings else (Finding("it has no buildings: they are generated", Outcome.ASSUMED),)),
    )


def _speed_bumps(data: OsmData, xy_m: Float64Array, roads: Sequence[OsmRoad]) -> Iterator[SpeedBump]:
    """Yield a bump across the road at each node that is tagged as one."""
    for road in roads:
        line = line_of(road, xy_m)
        for node in () if road.way.walk else road.nodes:
            rule = object_rules().calming.get(data.node_tags.get(node, {}).get("traffic_calming", ""))
            if rule is not None:
                (speed_kmh, length_m), s_m = rule, shapely.line_locate_point(line, shapely.Point(xy_m[node]))
                piece = substring(line, max(s_m - length_m / 2.0, 0.0), s_m + length_m / 2.0)
                half_width_m = _LANE_M / 2.0 * float(road.way.tags["lanes"])
                corners_m = shapely.get_coordinates(shapely.buffer(piece, half_width_m, cap_style="flat"))
                yield SpeedBump(np.column_stack([corners_m, np.full(len(corners_m), np.nan)]), speed_kmh / 3.6)


def _zones(areas: Sequence[Area], extent: BaseGeometry) -> tuple[Zone, ...]:
    """Zones in descending order of area, so that small ones take precedence."""
    rules, found = land_rules().zones, []
    for area in areas:
        kinds = (f"{key}={area.tags.get(key)}" for key in _ZONE_KEYS)
        recipe = next((rules[kind] for kind in kinds if kind in rules), None)
        if recipe is not None and "building" not in area.tags:
            found += [Zone(part, recipe) for part in polygons(overlay.intersection(area.polygon, extent))]
    return tuple(sorted(found, key=lambda zone: -zone.area.area))


def _lines(roads: Sequence[OsmRoad], xy_m: Float64Array) -> AnyArray:
    """(R,) lines of roads."""
    return np.array([line_of(road, xy_m) for road in roads], dtype=object)


def _bands(roads: Sequence[OsmRoad], xy_m: Float64Array, margin_m: float) -> AnyArray:
    """(R,) polygons of the ground that roads occupy, widened by a margin on each side; approximate."""
    half_m = np.array([_width_m(road) / 2.0 + margin_m for road in roads])
    return np.asarray(shapely.buffer(_lines(roads, xy_m), half_m, cap_style="flat"))


def _width_m(road: OsmRoad) -> float:
    if road.way.walk:
        return _PATH_M
    lanes = max(int(road.way.tags["lanes"]), 2 if road.way.tags["oneway"] == "no" else 1)
    sides = {"both": 2, "no": 0}.get(road.way.tags["sidewalk"], 1)
    return lanes * _LANE_M + sides * _SIDEWALK_M
