"""What covers the ground, level by level: exact shapely geometry in plan, map frame, meters.

A carriageway is the union of its strips, those inside junctions included, with the gaps between them closed; where the
map describes lanes only, junction corners are rounded too. Of surfaces that would overlap the first of carriageway,
shoulder, sidewalk and median holds, so that neighbors share their border and nothing else.
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

FAST_MPS = 22.3
"""Roads with a higher speed limit are motorways."""

_ROAD_CLOSING_M = 0.3  # where lanes are all there is
_WALK_CLOSING_M = 0.75
_MIDDLE_CLOSING_M = 1.0  # between the medians or inner shoulders of both directions
_NODE_CLOSING_M = 2.2  # of shoulders, which end where lanes change
_GRID_M = 0.001
_SPECK_M2 = 0.01
_AREAS = (shapely.GeometryType.POLYGON, shapely.GeometryType.MULTIPOLYGON)
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
    reach = None
    if area is not None:
        reach_m = 4.0 * max(layout.corner_radius_m, _MIDDLE_CLOSING_M)
        layout, reach = layout.near(area, reach_m), shapely.buffer(area, reach_m, join_style="mitre")
    plan = _Plan.of(layout, level, reach)
    crosswalks = crosswalk_polygons([each for each in layout.crosswalks if each.level == level])
    closed = _road(plan, crosswalks)
    gores = _gores(plan, closed)
    road = _polygons(shapely.difference(closed, gores, grid_size=_GRID_M)) if not gores.is_empty else closed
    shoulder = _without(shapely.union(_shoulders(plan, road), gores), road)
    paved = shapely.union(road, shoulder)
    sidewalk = _without(_walks(plan, paved), paved)
    median = _without(_joined(plan.areas_of(LaneKind.MEDIAN)), shapely.union(paved, sidewalk))
    crosswalk = _common(shapely.union_all(crosswalks), road)
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
    row = np.repeat(np.arange(len(shapes)), [len(shape) for shape in shapes])
    rings = shapely.linearrings(np.concatenate([np.empty((0, 2)), *shapes]), indices=row)
    return _valid(np.asarray(shapely.polygons(rings), object))


def crosswalk_polygons(crosswalks: Sequence[Crosswalk]) -> AnyArray:
    """(N,) polygons: the area of each crosswalk."""
    return _valid([shapely.Polygon(crosswalk.outline_m[:, :2]) for crosswalk in crosswalks])


@dataclass(frozen=True, slots=True)
class _Plan:
    """(N,) strips of one level and (N,) the area of each, with what else of the layout shapes the surfaces."""

    strips: tuple[Strip, ...]
    areas: AnyArray
    corner_radius_m: float

    @classmethod
    def of(cls, layout: Layout, level: int, reach: BaseGeometry | None) -> "_Plan":
        """Those of a layout; of long strips only what lies in reach, if given, which is much less work."""
        strips = layout.strips_of(*LaneKind, level=level)
        areas = strip_polygons(strips)
        if reach is not None:
            areas = shapely.intersection(areas, reach)
            touching = ~np.isin(shapely.get_type_id(areas), _AREAS)  # the rectangle, with a side or a corner
            areas[touching] = [_polygons(area) for area in areas[touching]]
        return cls(strips, areas, layout.corner_radius_m)

    def areas_of(self, *kinds: LaneKind, outside_junctions: bool = False) -> AnyArray:
        """Areas of strips of these kinds, in order."""
        chosen = [strip.kind in kinds and not (outside_junctions and strip.junction) for strip in self.strips]
        return np.asarray(self.areas[np.array(chosen, bool)])


def _road(plan: _Plan, crosswalks: AnyArray) -> BaseGeometry:
    """The carriageway; closing may fill what no strip outside junctions claims for something else."""
    lanes = plan.areas_of(*ROAD_KINDS)
    bare = shapely.union_all([*lanes, *crosswalks] if plan.corner_radius_m else lanes)
    shoulders, medians, sidewalks = (
        plan.areas_of(kind, outside_junctions=True) for kind in (LaneKind.SHOULDER, LaneKind.MEDIAN, LaneKind.SIDEWALK)
    )
    claimed = shapely.union_all([_joined(shoulders), _joined(medians), *sidewalks])
    closed = _closed(bare, max(plan.corner_radius_m, _ROAD_CLOSING_M))
    return shapely.difference(closed, shapely.difference(claimed, bare), grid_size=_GRID_M)


def _gores(plan: _Plan, road: BaseGeometry) -> BaseGeometry:
    """What closing has filled between a motorway and its ramps: the pieces that go over into shoulders."""
    fast = np.array([strip.kind is LaneKind.DRIVING and strip.speed_mps > FAST_MPS for strip in plan.strips], bool)
    shoulders = shapely.union_all(plan.areas_of(LaneKind.SHOULDER))
    if not plan.corner_radius_m or shoulders.is_empty or not fast.any():
        return MultiPolygon()
    filled = shapely.get_parts(_without(road, shapely.union_all(plan.areas_of(*ROAD_KINDS))))
    for neighbor in (shoulders, shapely.union_all(plan.areas[fast])):
        filled = filled[shapely.dwithin(filled, neighbor, 2.0 * _GRID_M)]
    return MultiPolygon(list(filled))


def _shoulders(plan: _Plan, road: BaseGeometry) -> BaseGeometry:
    """Shoulders; where lanes are all there is, also what is left between them and lanes that begin and end there."""
    shoulders = _joined(plan.areas_of(LaneKind.SHOULDER))
    if not plan.corner_radius_m or shoulders.is_empty:
        return shoulders
    beside = _common(road, shapely.buffer(shoulders, 2.0 * _NODE_CLOSING_M))
    paved = shapely.union(shoulders, beside)
    inside = [bool(strip.junction) and strip.kind in ROAD_KINDS for strip in plan.strips]
    nodes = shapely.buffer(shapely.union_all(plan.areas[np.array(inside, bool)]), 2.0 * _NODE_CLOSING_M)
    at_nodes = _common(_closed(paved, _NODE_CLOSING_M), nodes)
    filled = shapely.union(_closed(paved, _MIDDLE_CLOSING_M), at_nodes)
    return _without(filled, shapely.union_all(plan.areas_of(*_WALK_KINDS, LaneKind.MEDIAN)))


def _joined(areas: AnyArray) -> BaseGeometry:
    """Strips of one kind, and what is left between those of two directions."""
    return _closed(shapely.union_all(areas), _MIDDLE_CLOSING_M)


def _walks(plan: _Plan, paved: BaseGeometry) -> BaseGeometry:
    """Sidewalks and walking areas, and the corners between them and what is paved."""
    walks = shapely.union_all(plan.areas_of(*_WALK_KINDS))
    closing_m = max(plan.corner_radius_m, _WALK_CLOSING_M)
    street = _closed(shapely.union(walks, paved), closing_m)
    return _common(street, shapely.buffer(walks, closing_m))


def _common(surface: BaseGeometry, other: BaseGeometry) -> MultiPolygon:
    """What two areas share; where they only touch, an intersection has lines besides, which no later one would take."""
    return _polygons(shapely.intersection(surface, other))


def _without(surface: BaseGeometry, others: BaseGeometry) -> MultiPolygon:
    """What is left of a surface; the lines that a difference may leave besides, no later one would take."""
    return _polygons(shapely.difference(surface, others, grid_size=_GRID_M))


def _closed(area: BaseGeometry, radius_m: float) -> MultiPolygon:
    """The area with narrow gaps and inner corners filled (morphological closing), on a millimetre grid."""
    if area.is_empty:
        return MultiPolygon()
    grown = shapely.buffer(area, radius_m, quad_segs=12)
    closed = shapely.union(shapely.buffer(grown, -radius_m, quad_segs=12), area)
    return _polygons(shapely.set_precision(shapely.simplify(closed, 2 * _GRID_M), _GRID_M))


def _valid(polygons: Sequence[shapely.Polygon] | AnyArray) -> AnyArray:
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
