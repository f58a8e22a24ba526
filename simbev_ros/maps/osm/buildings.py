"""Selects the buildings of an OpenStreetMap file: none overlaps a road or another building.

A building that is mapped in parts consists of them, and of what they leave of its outline.
"""

from collections import defaultdict
from collections.abc import Iterator, Sequence

import numpy as np
import shapely

from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.types import AnyArray
from simbev_ros.maps.findings import Finding
from simbev_ros.maps.land_features import Footprint
from simbev_ros.maps.osm.areas import Area, polygons
from simbev_ros.maps.osm.building_tags import footprint_of
from simbev_ros.maps.osm.data import Tags
from simbev_ros.maps.osm.land_rules import land_rules

_MIN_AREA_M2 = 6.0
_MIN_FREE_FRACTION = 0.6
_SLIVER_M = 0.5
_CLEARANCE_M = 4.5  # parts that begin above this height may stand above roads


def buildings_of(areas: Sequence[Area], road_bands: AnyArray) -> tuple[tuple[Footprint, ...], tuple[Finding, ...]]:
    """The buildings among areas, and findings about those that were left out.

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
        parts = polygons(overlay.difference(outline, overlay.union_all(obstacles)))
        free = max(parts, key=lambda part: part.area, default=None)
        if free is not None and free.area >= max(_MIN_AREA_M2, _MIN_FREE_FRACTION * outline.area):
            footprints[index] = free
    lost = [candidates[row] for row in range(len(candidates)) if row not in footprints]
    rule = "a building that stands on a road or in another building is left out"
    findings = [
        Finding(rule, position_m=shapely.get_coordinates(area.polygon.representative_point())[0]) for area in lost
    ]
    kept = [Area(outline, candidates[k].tags) for k, outline in footprints.items()]
    return tuple(_in_parts(kept, areas, road_bands)), tuple(findings)


def _in_parts(buildings: Sequence[Area], areas: Sequence[Area], road_bands: AnyArray) -> Iterator[Footprint]:
    """The parts of buildings, and the buildings themselves where they have none."""
    parts = [area for area in areas if area.tags.get("building:part", "no") != "no" and "building" not in area.tags]
    outlines = np.array([building.polygon for building in buildings], dtype=object)
    inner = np.array([part.polygon.representative_point() for part in parts], dtype=object)
    part_index, owner = shapely.STRtree(outlines).query(inner, predicate="within")
    of_building: dict[int, list[Footprint]] = defaultdict(list)
    roads = shapely.STRtree(road_bands)
    for part, building in zip(part_index.tolist(), owner.tolist(), strict=True):
        footprint = footprint_of(parts[part].polygon, {**_inherited(buildings[building].tags), **parts[part].tags})
        crossed = footprint.bottom_m < _CLEARANCE_M and len(roads.query(footprint.outline, predicate="overlaps"))
        if footprint.outline.area >= _MIN_AREA_M2 and not crossed:
            of_building[building].append(footprint)
    for index, building in enumerate(buildings):
        own = of_building[index]
        covered = overlay.union_all([part.outline for part in own])
        for rest in polygons(overlay.difference(building.polygon, covered)) if own else (building.polygon,):
            if not own or shapely.buffer(rest, -_SLIVER_M).area >= _MIN_AREA_M2:
                yield footprint_of(rest, building.tags)
        yield from own


def _inherited(tags: Tags) -> Tags:
    """Tags of a building that its parts have too."""
    keys = ("building", "building:colour", "building:material", "roof:colour", "roof:material")
    return {key: tags[key] for key in keys if key in tags}


def _overlapping(outlines: AnyArray, others: AnyArray) -> dict[int, list[int]]:
    """Index of outline → indices of the other polygons that it overlaps."""
    found: dict[int, list[int]] = defaultdict(list)
    for index, other in shapely.STRtree(others).query(outlines, predicate="intersects").T.tolist():
        found[index].append(other)
    return found


def _is_building(tags: Tags) -> bool:
    kind = tags.get("building", "no")
    return kind not in land_rules().left_out and tags.get("location") != "underground"
