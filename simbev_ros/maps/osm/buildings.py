"""Selects the buildings of an OpenStreetMap file: none overlaps a road or another building; with height and use."""

from collections import defaultdict
from collections.abc import Sequence

import numpy as np
import shapely

from simbev_ros.maps.land_features import Footprint
from simbev_ros.maps.osm.areas import Area, polygons
from simbev_ros.maps.osm.data import Tags, parse_length_m
from simbev_ros.maps.osm.land_rules import land_rules
from simbev_ros.types import AnyArray

_MIN_AREA_M2 = 6.0
_MIN_FREE_FRACTION = 0.6
_MIN_HEIGHT_M, _MAX_HEIGHT_M = 2.2, 500.0


def buildings_of(areas: Sequence[Area], road_bands: AnyArray) -> tuple[tuple[Footprint, ...], tuple[str, ...]]:
    """The buildings among areas, and notes about those that were left out.

    Args:
        areas: Areas of a file.
        road_bands: (R,) polygons that roads occupy.
    """
    candidates = [area for area in areas if _is_building(area.tags) and area.polygon.area >= _MIN_AREA_M2]
    candidates.sort(key=lambda area: -area.polygon.area)  # where two overlap, the larger one is kept
    outlines = np.array([area.polygon for area in candidates], dtype=object)
    roads, larger = _overlapping(outlines, road_bands), _overlapping(outlines, outlines)
    footprints: dict[int, shapely.Polygon] = {}
    for index, outline in enumerate(outlines):
        obstacles = [road_bands[k] for k in roads[index]] + [
            footprints[k] for k in larger[index] if k < index and k in footprints
        ]
        parts = polygons(shapely.difference(outline, shapely.union_all(obstacles)))
        free = max(parts, key=lambda part: part.area, default=None)
        if free is not None and free.area >= max(_MIN_AREA_M2, _MIN_FREE_FRACTION * outline.area):
            footprints[index] = free
    left_out = len(candidates) - len(footprints)
    note = f"buildings that stand on roads or in other buildings were left out: {left_out}"
    return tuple(_footprint(outline, candidates[k].tags) for k, outline in footprints.items()), (
        note,
    ) if left_out else ()


def _overlapping(outlines: AnyArray, others: AnyArray) -> dict[int, list[int]]:
    """Index of outline → indices of the other polygons that it overlaps."""
    found: dict[int, list[int]] = defaultdict(list)
    for index, other in shapely.STRtree(others).query(outlines, predicate="intersects").T.tolist():
        found[index].append(other)
    return found


def _is_building(tags: Tags) -> bool:
    kind = tags.get("building", "no")
    return kind not in land_rules().left_out and tags.get("location") != "underground"


def _footprint(outline: shapely.Polygon, tags: Tags) -> Footprint:
    rules = land_rules()
    rule = rules.buildings.get(tags["building"], rules.buildings["yes"])
    height_m, storeys = parse_length_m(tags.get("height", "")), parse_length_m(tags.get("building:levels", ""))
    height_m = height_m or (storeys + 0.5) * rules.storey_m * (storeys > 0.0) or rule.height_m
    return Footprint(outline, min(max(height_m, _MIN_HEIGHT_M), _MAX_HEIGHT_M), rule.use, tags.get("roof:shape", ""))
