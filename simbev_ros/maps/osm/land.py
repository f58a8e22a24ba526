"""What an OpenStreetMap file says about the land beside its roads: zones, water, buildings."""

import re
from collections.abc import Iterator, Sequence

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from simbev_ros.maps.features import Footprint, MapFeatures, Water, Zone
from simbev_ros.maps.osm.areas import Area, areas_of, polygons
from simbev_ros.maps.osm.data import OsmData, Tags
from simbev_ros.maps.osm.land_rules import land_rules
from simbev_ros.maps.osm.roads import OsmRoad, line_of
from simbev_ros.types import Float64Array

_AROUND_M = 1500.0
_LANE_M = 3.3
_SIDEWALK_M = 2.4
_PATH_M = 2.2
_VERGE_M = 2.0
_SMALLEST_M2 = 6.0
_LOWEST_M, _HIGHEST_M = 2.2, 500.0
_FOOT_M = 0.3048
_LEAST_SHARE = 0.6


def features_of(data: OsmData, xy_m: Float64Array, roads: Sequence[OsmRoad]) -> tuple[MapFeatures, tuple[str, ...]]:
    """The land, and what was left out.

    Args:
        data: The file.
        xy_m: (N, 2) its nodes in the map frame.
        roads: The roads that are built.
    """
    lines = [line_of(road, xy_m) for road in roads]
    extent = shapely.box(*shapely.total_bounds(lines)).buffer(_AROUND_M, join_style="mitre")
    areas = [area for area in areas_of(data, xy_m) if area.polygon.intersects(extent)]
    zones = _zones(areas, extent)
    water = _water(
        data, xy_m, areas, extent, _corridor([road for road in roads if not road.way.bridge], xy_m, _VERGE_M)
    )
    buildings, note = _buildings(areas, _corridor([road for road in roads if road.way.layer >= 0], xy_m, 0.0))
    rules = land_rules()
    outside = rules.outside if zones else rules.anywhere
    features = MapFeatures(outside, zones=zones, water=water, buildings=buildings or None)
    return features, note if buildings else ("it has no buildings: they are invented",)


def _zones(areas: Sequence[Area], extent: BaseGeometry) -> tuple[Zone, ...]:
    """Large ones first, so that small ones hold."""
    found = []
    for area in areas:
        recipes = (
            land_rules().zones.get(f"{key}={area.tags.get(key)}")
            for key in ("leisure", "amenity", "natural", "landuse")
        )
        recipe = next((recipe for recipe in recipes if recipe is not None), None)
        if recipe is not None and "building" not in area.tags:
            found += [Zone(part, recipe) for part in polygons(shapely.intersection(area.polygon, extent))]
    return tuple(sorted(found, key=lambda zone: -zone.area.area))


def _water(
    data: OsmData, xy_m: Float64Array, areas: Sequence[Area], extent: BaseGeometry, corridor: BaseGeometry
) -> tuple[Water, ...]:
    """Areas, and lines with a width where no area covers them; roads without bridges have culverts."""
    rules = land_rules().water
    found: list[Water] = []
    for area in areas:
        kind = _kind_of_water(area.tags)
        if kind is not None:
            found += _parts_of_water(shapely.difference(area.polygon, corridor), extent, rules[kind].depth_m)
    covered = shapely.union_all([water.area for water in found])
    for way in data.ways:
        kind = way.tags.get("waterway", "")
        if kind not in rules or rules[kind].width_m == 0.0 or way.tags.get("tunnel", "no") != "no":
            continue
        width_m = _metres(way.tags.get("width", "")) or rules[kind].width_m
        band: BaseGeometry = shapely.buffer(shapely.LineString(xy_m[list(way.nodes)]), width_m / 2.0, cap_style="flat")
        band = shapely.difference(shapely.difference(band, covered), corridor)
        found += _parts_of_water(band, extent, rules[kind].depth_m)
        covered = shapely.union(covered, band)
    return tuple(found)


def _kind_of_water(tags: Tags) -> str | None:
    if tags.get("natural") == "water" or tags.get("landuse") in ("reservoir", "basin"):
        kind = tags.get("water", "lake")
        return kind if kind in land_rules().water else "lake"
    return "river" if tags.get("waterway") == "riverbank" else None


def _parts_of_water(area: BaseGeometry, extent: BaseGeometry, depth_m: float) -> Iterator[Water]:
    for part in polygons(shapely.intersection(area, extent)):
        if part.area > _SMALLEST_M2:
            yield Water(part, -depth_m)


def _buildings(areas: Sequence[Area], corridor: BaseGeometry) -> tuple[tuple[Footprint, ...], tuple[str, ...]]:
    """Buildings off the roads and beside each other; of two in one place the larger one is built."""
    rules = land_rules()
    wanted = [area for area in areas if _is_building(area.tags) and area.polygon.area >= _SMALLEST_M2]
    wanted.sort(key=lambda area: -area.polygon.area)
    outlines = np.array([area.polygon for area in wanted], dtype=object)
    neighbours: list[list[int]] = [[] for _ in wanted]
    for small, large in shapely.STRtree(outlines).query(outlines, predicate="intersects").T.tolist():
        if large < small:
            neighbours[small].append(large)
    built: dict[int, shapely.Polygon] = {}
    for index, outline in enumerate(outlines):
        taken = shapely.union_all([corridor, *(built[large] for large in neighbours[index] if large in built)])
        free = max(polygons(shapely.difference(outline, taken)), key=lambda part: part.area, default=None)
        if free is not None and free.area >= max(_SMALLEST_M2, _LEAST_SHARE * outline.area):
            built[index] = free
    left_out = len(wanted) - len(built)
    note = (f"{left_out} buildings that stand on roads or in other buildings were left out",) if left_out else ()
    footprints = []
    for index, outline in built.items():
        tags = wanted[index].tags
        rule = rules.buildings.get(tags["building"], rules.buildings["yes"])
        footprints.append(Footprint(outline, _height_m(tags, rule.height_m), rule.use, tags.get("roof:shape", "")))
    return tuple(footprints), note


def _is_building(tags: Tags) -> bool:
    kind = tags.get("building", "no")
    return kind not in land_rules().left_out and tags.get("location") != "underground"


def _height_m(tags: Tags, default_m: float) -> float:
    """From the tag of that name, else from the storeys, else as usual."""
    height_m = _metres(tags.get("height", ""))
    if not height_m:
        storeys = _metres(tags.get("building:levels", ""))
        height_m = (storeys + 0.5) * land_rules().storey_m if storeys else default_m
    return min(max(height_m, _LOWEST_M), _HIGHEST_M)


def _metres(text: str) -> float:
    """A length such as ``12``, ``12.5 m`` or ``40'``; 0 where it is none."""
    match = re.fullmatch(r"(\d{1,4}(?:\.\d{1,3})?) ?(m|')?", text.strip())
    return 0.0 if match is None else float(match[1]) * (_FOOT_M if match[2] == "'" else 1.0)


def _corridor(roads: Sequence[OsmRoad], xy_m: Float64Array, beside_m: float) -> BaseGeometry:
    """About the ground that roads take."""
    bands = [shapely.buffer(line_of(road, xy_m), _width_m(road) / 2.0 + beside_m, cap_style="flat") for road in roads]
    return shapely.union_all(bands)


def _width_m(road: OsmRoad) -> float:
    if road.way.walk:
        return _PATH_M
    lanes = max(int(road.way.tags["lanes"]), 2 if road.way.tags["oneway"] == "no" else 1)
    sides = {"both": 2, "no": 0}.get(road.way.tags["sidewalk"], 1)
    return lanes * _LANE_M + sides * _SIDEWALK_M
