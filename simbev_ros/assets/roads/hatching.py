"""Hatched areas that nobody drives on: islands in junctions, ends of parking lanes, shoulders that begin or end."""

from collections.abc import Iterator

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry
from shapely.ops import substring

from simbev_ros.assets.placement.region_ground import MARGIN_M, RegionGround
from simbev_ros.assets.roads.symbols import width_m
from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.geometry.plan_view import left_of, polygon_parts
from simbev_ros.maps.roads.lane_kind import ROAD_KINDS, LaneKind
from simbev_ros.maps.roads.layout import Layout
from simbev_ros.maps.roads.surface import strip_polygons

_OUTLINE_M, _STRIPE_M, _PITCH_M = 0.12, 0.25, 1.3  # widths, and distance from stripe to stripe
_CLEAR_M, _CLEAR_OF_CROSSINGS_M = 0.3, 0.7  # of lanes, and of crosswalks and stop lines
_MIN_HALF_M, _MIN_ISLAND_M2, _MIN_END_M2 = 0.55, 5.0, 3.0
_BESIDE_M = 1.6  # distance of an island from a crosswalk, sidewalk or median; others lie in the middle of junctions
_ENDS_M = {LaneKind.PARKING: 4.6, LaneKind.SHOULDER: 14.0}  # parked vehicles keep clear of the former
_JUNCTION_M = 6.0


def hatched_areas(ground: RegionGround, level: int) -> Iterator[BaseGeometry]:
    """Painted areas of a level in and around a region, map frame; those across its border are in both regions."""
    layout = ground.network.layout.near(ground.region.area, MARGIN_M)
    lanes = strip_polygons(layout.strips_of(*ROAD_KINDS, level=level))
    stops = [shapely.LineString(line.ends_m[:, :2]) for line in layout.stop_lines if line.level == level]
    streets = ground.streets[level]
    crossings = shapely.buffer(overlay.union_all([streets.crosswalk, *stops]), _CLEAR_OF_CROSSINGS_M)
    driven = overlay.union(shapely.buffer(overlay.union_all(lanes), _CLEAR_M, quad_segs=2), crossings)
    beside = overlay.union(streets.crosswalk, streets.raised)
    shapely.prepare(beside)
    free = overlay.difference(streets.road, driven)
    wide = shapely.buffer(shapely.buffer(free, -_MIN_HALF_M, quad_segs=3), _MIN_HALF_M * 1.1, quad_segs=3)
    for island in polygon_parts(overlay.intersection(free, wide)):
        if island.area > _MIN_ISLAND_M2 and shapely.dwithin(beside, island, _BESIDE_M):
            yield hatching(island)
    ends = overlay.intersection(list(_lane_ends(layout, level)), streets.area)
    for part in polygon_parts(overlay.union_all(overlay.difference(ends, crossings))):
        if part.area > _MIN_END_M2:
            yield hatching(part)


def hatching(area: shapely.Polygon) -> BaseGeometry:
    """Outline of an area, and stripes across it at 45 degrees to its longer side."""
    sides_m = np.diff(shapely.get_coordinates(shapely.minimum_rotated_rectangle(area))[:3], axis=0)
    along = sides_m[np.argmax(np.hypot(*sides_m.T))]
    stripe = (along + left_of(along)) / np.hypot(*(along + left_of(along)))
    across = left_of(stripe)
    center_m, half_m = shapely.get_coordinates(area.centroid)[0], np.hypot(*np.ptp(area.exterior.coords, axis=0))
    offsets_m = np.arange(-half_m, half_m, _PITCH_M)[:, None, None] * across
    ends_m = center_m + offsets_m + np.array([-half_m, half_m])[:, None] * stripe
    stripes = shapely.buffer(shapely.multilinestrings(ends_m), _STRIPE_M / 2.0, cap_style="flat")
    outline = overlay.difference(area, shapely.buffer(area, -_OUTLINE_M, join_style="mitre"))
    return overlay.union(outline, overlay.intersection(stripes, area))


def _lane_ends(layout: Layout, level: int) -> Iterator[BaseGeometry]:
    """Areas at the ends of lanes that end at junctions."""
    crossing = [strip for strip in layout.strips_of(LaneKind.DRIVING, level=level) if strip.junction]
    tree = shapely.STRtree(strip_polygons([strip for strip in crossing if not strip.continues]))
    for strip in layout.strips_of(*_ENDS_M, level=level):
        line, reach_m = shapely.LineString(strip.center_m[:, :2]), _ENDS_M[strip.kind]
        if strip.junction or line.length < 3.0 * reach_m:
            continue
        for end in (substring(line, _CLEAR_M, reach_m), substring(line, -reach_m, -_CLEAR_M)):
            if len(tree.query(end, predicate="dwithin", distance=_JUNCTION_M)):
                yield shapely.buffer(end, width_m(strip) / 2.0 - _CLEAR_M, cap_style="flat")
