"""Buildings: outlines that overlap neither roads nor each other, with heights and uses."""

from collections import defaultdict
from collections.abc import Sequence

import numpy as np
import shapely

from simbev_ros.maps.land_features import Footprint
from simbev_ros.maps.osm.areas import Area, polygons
from simbev_ros.maps.osm.data import Tags, metres
from simbev_ros.maps.osm.land_rules import land_rules
from simbev_ros.types import AnyArray

_SMALLEST_M2 = 6.0
_LEAST_SHARE = 0.6
_LOWEST_M, _HIGHEST_M = 2.2, 500.0


def buildings_of(areas: Sequence[Area], road_bands: AnyArray) -> tuple[tuple[Footprint, ...], tuple[str, ...]]:
    """The buildings among areas, and what was left out.

    Args:
        areas: Of a file.
        road_bands: (R,) polygons that roads take.
    """
    wanted = [area for area in areas if _is_building(area.tags) and area.polygon.area >= _SMALLEST_M2]
    wanted.sort(key=lambda area: -area.polygon.area)  # of two in one place the larger one is built
    outlines = np.array([area.polygon for area in wanted], dtype=object)
    roads, larger = _in_the_way(outlines, road_bands), _in_the_way(outlines, outlines)
    built: dict[int, shapely.Polygon] = {}
    for index, outline in enumerate(outlines):
        taken = [road_bands[k] for k in roads[index]] + [built[k] for k in larger[index] if k < index and k in built]
        parts = polygons(shapely.difference(outline, shapely.union_all(taken)))
        free = max(parts, key=lambda part: part.area, default=None)
        if free is not None and free.area >= max(_SMALLEST_M2, _LEAST_SHARE * outline.area):
            built[index] = free
    left_out = len(wanted) - len(built)
    note = f"buildings that stand on roads or in other buildings were left out: {left_out}"
    return tuple(_footprint(outline, wanted[k].tags) for k, outline in built.items()), (note,) if left_out else ()


def _in_the_way(outlines: AnyArray, others: AnyArray) -> dict[int, list[int]]:
    """Index of outline → indices of the others that it overlaps."""
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
    height_m, storeys = metres(tags.get("height", "")), metres(tags.get("building:levels", ""))
    height_m = height_m or (storeys + 0.5) * rules.storey_m * (storeys > 0.0) or rule.height_m
    return Footprint(outline, min(max(height_m, _LOWEST_M), _HIGHEST_M), rule.use, tags.get("roof:shape", ""))
