"""Lines beside carriageways for placing objects: on sidewalks, on verges of roads without sidewalks, on decks."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from simbev_ros.assets.land.blocks import Zones
from simbev_ros.assets.land.yard import Yard
from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.geometry.plan_view import left_of
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.surroundings import SurroundingsRecipe

STATION_M = 0.5
"""Spacing of the positions along a line."""

_FROM_CURB_M, _FROM_EDGE_M, _ON_RIM_M = 0.55, 1.5, 0.2
_KEEP_FROM_CROSSING_M = 2.0
_KEEP_FROM_CORNER_M = 1.0
_MIN_LENGTH_M = 6.0
_KEEP_FROM_WALK_M = 4.0


@dataclass(frozen=True, slots=True)
class CurbLine:
    """A line beside a carriageway that objects such as lights and trees are placed along.

    Attributes:
        position_m: (N, 2) positions, ``STATION_M`` apart, map frame.
        yaw_rad: (N,) headings toward the road.
        recipe: Recipe of the land beside the road.
        walk: Whether the line lies on a sidewalk.
        level: Level of the road.
    """

    position_m: Float64Array
    yaw_rad: Float64Array
    recipe: SurroundingsRecipe
    walk: bool
    level: int = 0


def curb_lines(yard: Yard, zones: Zones) -> tuple[CurbLine, ...]:
    """Find all lines in a region, always in the same order."""
    ground, streets = yard.ground, yard.ground.streets[0]
    asphalt = overlay.union(streets.road, streets.shoulder)
    crossings = shapely.buffer(streets.crosswalk, _KEEP_FROM_CROSSING_M)
    walks: BaseGeometry = shapely.buffer(asphalt, _FROM_CURB_M).boundary.intersection(
        shapely.buffer(streets.sidewalk, -0.3)
    )
    walks = overlay.difference(walks, crossings)
    lines = list(_stretches(walks, asphalt, yard, zones, walk=True, level=0))
    street = streets.area
    verges: BaseGeometry = shapely.buffer(street, _FROM_EDGE_M, quad_segs=4).boundary
    verges = overlay.difference(verges, shapely.buffer(streets.sidewalk, _KEEP_FROM_WALK_M, quad_segs=2))
    verges = overlay.intersection(verges, ground.land)
    lines += _stretches(verges, street, yard, zones, walk=False, level=0)
    for level in range(1, ground.network.layout.tunnel_levels.start):
        area = ground.streets[level].area
        rim: BaseGeometry = shapely.buffer(area, _ON_RIM_M, join_style="mitre").boundary
        others = [other.area for other in ground.streets[:level]]
        rim = overlay.difference(rim, shapely.buffer(overlay.union_all(others[-1:]), 2.0))
        lines += _stretches(rim, area, yard, zones, walk=False, level=level)
    return tuple(lines)


def _stretches(
    lines: BaseGeometry,
    road: BaseGeometry,
    yard: Yard,
    zones: Zones,
    *,
    walk: bool,
    level: int,
) -> Iterator[CurbLine]:
    """Sections of lines within the region, zone by zone."""
    lines = overlay.intersection(lines, yard.inside)
    if lines.is_empty or road.is_empty:
        return
    shapely.prepare(road)
    for recipe, area in zones:
        merged = shapely.line_merge(overlay.intersection(lines, area))
        parts = [part for part in shapely.get_parts(merged) if part.length > _MIN_LENGTH_M]
        for part in sorted(parts, key=lambda part: part.coords[0]):
            stations = np.arange(_KEEP_FROM_CORNER_M, part.length - _KEEP_FROM_CORNER_M, STATION_M)
            corners_m = shapely.get_coordinates(part)
            corner_at_m = np.append(0.0, np.cumsum(np.hypot(*np.diff(corners_m, axis=0).T)))
            positions, onward = (
                np.column_stack([np.interp(at_m, corner_at_m, axis_m) for axis_m in corners_m.T])
                for at_m in (stations, stations + STATION_M)
            )
            left = left_of(onward - positions)
            half_way = len(positions) // 2
            sides = shapely.points(positions[half_way] + np.array([[1.0], [-1.0]]) * left[half_way])
            toward_road = left if np.argmin(shapely.distance(road, sides)) == 0 else -left
            yield CurbLine(positions, np.arctan2(toward_road[:, 1], toward_road[:, 0]), recipe, walk, level)
