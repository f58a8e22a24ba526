"""What covers the ground, level by level: exact shapely geometry in plan, map frame, metres.

A carriageway is the union of its strips, those inside junctions included, with the gaps between them closed; where the
map describes lanes only, junction corners are rounded too. Of surfaces that would overlap the first of carriageway,
shoulder, sidewalk and median holds, so that neighbours share their border and nothing else.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from shapely import MultiPolygon
from shapely.geometry.base import BaseGeometry

from simbev_ros.maps.roads.lane_kind import ROAD_KINDS, LaneKind
from simbev_ros.maps.roads.layout import Crosswalk, Layout, Strip
from simbev_ros.types import AnyArray

_ROAD_CLOSING_M = 0.3  # where lanes are all there is
_WALK_CLOSING_M = 0.75
_MIDDLE_CLOSING_M = 1.0  # between the medians or inner shoulders of both directions
_GRID_M = 0.001
_SPECK_M2 = 0.01
_WALK_KINDS = (LaneKind.SIDEWALK, LaneKind.WALKING_AREA)


@dataclass(frozen=True, slots=True)
class Surfaces:
    """All surfaces of one level.

    Attributes:
        road: Driving, bicycle and parking lanes and all between them, under crosswalks too.
        shoulder: Paved, but no road.
        sidewalk: Sidewalks and walking areas, up to the curb.
        median: Between carriageways.
        crosswalk: The part of the road that is marked for walking.
    """

    road: MultiPolygon
    shoulder: MultiPolygon
    sidewalk: MultiPolygon
    median: MultiPolygon
    crosswalk: MultiPolygon


def surfaces_of(layout: Layout, level: int = 0, area: shapely.Polygon | None = None) -> Surfaces:
    """The surfaces of one level.

    Args:
        layout: Where lanes lie.
        level: Which level.
        area: A rectangle: give what is inside of it only, which is the same as that part of the whole.
    """
    if area is not None:
        layout = layout.near(area, 4.0 * max(layout.corner_radius_m, _MIDDLE_CLOSING_M))
    crosswalks = crosswalk_polygons([each for each in layout.crosswalks if each.level == level])
    road = _road(layout, level, crosswalks)
    shoulder = _without(_shoulders(layout, level, road), road)
    paved = shapely.union(road, shoulder)
    sidewalk = _without(_walks(layout, level, paved), paved)
    median = _without(_joined(layout.strips_of(LaneKind.MEDIAN, level=level)), shapely.union(paved, sidewalk))
    crosswalk = shapely.intersection(shapely.union_all(crosswalks), road)
    parts = road, shoulder, sidewalk, median, crosswalk
    return Surfaces(*(_polygons(part if area is None else shapely.intersection(part, area)) for part in parts))


def road_surface(layout: Layout, level: int = 0, area: shapely.Polygon | None = None) -> MultiPolygon:
    """As ``Surfaces.road``."""
    return surfaces_of(layout, level, area).road


def sidewalk_surface(layout: Layout, level: int = 0, area: shapely.Polygon | None = None) -> MultiPolygon:
    """As ``Surfaces.sidewalk``."""
    return surfaces_of(layout, level, area).sidewalk


def drivable_area(layout: Layout) -> MultiPolygon:
    """The carriageways of all levels, one on the other, in plan."""
    return _polygons(shapely.union_all([road_surface(layout, level) for level in layout.levels]))


def strip_polygons(strips: Sequence[Strip]) -> AnyArray:
    """(N,) polygons or multipolygons: the area of each strip."""
    shapes = [
        np.concatenate([strip.left_m[:, :2], strip.right_m[::-1, :2]]) if strip.outline_m is None else strip.outline_m
        for strip in strips
    ]
    return _valid([shapely.Polygon(shape) for shape in shapes])


def crosswalk_polygons(crosswalks: Sequence[Crosswalk]) -> AnyArray:
    """(N,) polygons: the area of each crosswalk."""
    return _valid([shapely.Polygon(crosswalk.outline_m[:, :2]) for crosswalk in crosswalks])


def _road(layout: Layout, level: int, crosswalks: AnyArray) -> BaseGeometry:
    """The carriageway; closing may fill what no strip outside junctions claims for something else."""
    lanes = strip_polygons(layout.strips_of(*ROAD_KINDS, level=level))
    bare = shapely.union_all([*lanes, *crosswalks] if layout.corner_radius_m else lanes)
    outside = [strip for strip in layout.strips if strip.level == level and not strip.junction]
    shoulders, medians, sidewalks = (
        [strip for strip in outside if strip.kind is kind]
        for kind in (LaneKind.SHOULDER, LaneKind.MEDIAN, LaneKind.SIDEWALK)
    )
    claimed = shapely.union_all([_joined(shoulders), _joined(medians), *strip_polygons(sidewalks)])
    closed = _closed(bare, max(layout.corner_radius_m, _ROAD_CLOSING_M))
    return shapely.difference(closed, shapely.difference(claimed, bare), grid_size=_GRID_M)


def _shoulders(layout: Layout, level: int, road: BaseGeometry) -> BaseGeometry:
    """Shoulders; where lanes are all there is, also what is left between them and lanes that begin and end there."""
    shoulders = _joined(layout.strips_of(LaneKind.SHOULDER, level=level))
    if not layout.corner_radius_m or shoulders.is_empty:
        return shoulders
    beside = shapely.intersection(road, shapely.buffer(shoulders, 2.0 * _MIDDLE_CLOSING_M))
    others = strip_polygons(layout.strips_of(*_WALK_KINDS, LaneKind.MEDIAN, level=level))
    return _without(_closed(shapely.union(shoulders, beside), _MIDDLE_CLOSING_M), shapely.union_all(others))


def _joined(strips: Sequence[Strip]) -> BaseGeometry:
    """Strips of one kind, and what is left between those of two directions."""
    return _closed(shapely.union_all(strip_polygons(strips)), _MIDDLE_CLOSING_M)


def _walks(layout: Layout, level: int, paved: BaseGeometry) -> BaseGeometry:
    """Sidewalks and walking areas, and the corners between them and what is paved."""
    walks = shapely.union_all(strip_polygons(layout.strips_of(*_WALK_KINDS, level=level)))
    closing_m = max(layout.corner_radius_m, _WALK_CLOSING_M)
    street = _closed(shapely.union(walks, paved), closing_m)
    return _polygons(shapely.intersection(street, shapely.buffer(walks, closing_m)))


def _without(surface: BaseGeometry, others: BaseGeometry) -> MultiPolygon:
    """What is left of a surface; the lines that a difference may leave besides, no later one would take."""
    return _polygons(shapely.difference(surface, others, grid_size=_GRID_M))


def _closed(area: BaseGeometry, radius_m: float) -> MultiPolygon:
    """The area with narrow gaps and inner corners filled (morphological closing), on a millimetre grid."""
    grown = shapely.buffer(area, radius_m, quad_segs=12)
    closed = shapely.union(shapely.buffer(grown, -radius_m, quad_segs=12), area)
    return _polygons(shapely.set_precision(shapely.simplify(closed, 2 * _GRID_M), _GRID_M))


def _valid(polygons: Sequence[shapely.Polygon]) -> AnyArray:
    """(N,) the same areas without self-intersections."""
    valid = np.array(polygons, object)
    wrong = ~shapely.is_valid(valid)
    valid[wrong] = [_polygons(area) for area in shapely.make_valid(valid[wrong])]
    return valid


def _polygons(area: BaseGeometry) -> MultiPolygon:
    """Only the two-dimensional parts, without specks."""
    parts = shapely.get_parts(shapely.get_parts(area))
    parts = parts[shapely.get_type_id(parts) == shapely.GeometryType.POLYGON]
    return MultiPolygon(list(parts[shapely.area(parts) > _SPECK_M2]))
