"""Ground surfaces (road, shoulder, sidewalk, median) level by level, as exact shapely geometry.

In: a layout. Out: polygons in plan view, map frame, meters. A carriageway is the union of its strips, including those
inside junctions, with the gaps between them closed; for maps that describe only lanes, junction corners are rounded
too. Where surfaces would overlap, carriageway, shoulder, sidewalk and median take precedence in this order, so that
adjacent surfaces share only their border.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from shapely import MultiPolygon
from shapely.geometry.base import BaseGeometry

from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.geometry.plan_view import polygon_parts
from simbev_ros.foundation.types import AnyArray
from simbev_ros.maps.roads.lane_kind import ROAD_KINDS, LaneKind
from simbev_ros.maps.roads.layout import Crosswalk, Layout, Strip

FAST_MPS = 22.3
"""Speed limit above which a road counts as a motorway."""

_ROAD_CLOSING_M = 0.3  # for maps whose lanes describe the whole area
_WALK_CLOSING_M = 0.75
_MIDDLE_CLOSING_M = 1.0  # gap between the medians or inner shoulders of both directions
_NODE_CLOSING_M = 2.2  # gap between shoulders, which end where lanes change
_GRID_M, _SEAM_M = 0.001, 0.05
_SPECK_M2 = 0.01
_AREAS = (shapely.GeometryType.POLYGON, shapely.GeometryType.MULTIPOLYGON)
_WALK_KINDS = (LaneKind.SIDEWALK, LaneKind.WALKING_AREA)


@dataclass(frozen=True, slots=True)
class Surfaces:
    """All surfaces of one level.

    Attributes:
        road: Driving, bicycle and parking lanes and the area between them, including crosswalks.
        shoulder: Paved, but not road.
        sidewalk: Sidewalks and walking areas, up to the curb.
        median: Area between carriageways.
        crosswalk: The part of the road that is marked for pedestrians.
    """

    road: MultiPolygon
    shoulder: MultiPolygon
    sidewalk: MultiPolygon
    median: MultiPolygon
    crosswalk: MultiPolygon


def surfaces_of(layout: Layout, level: int = 0, area: shapely.Polygon | None = None) -> Surfaces:
    """The surfaces of one level.

    Args:
        layout: The layout of the roads.
        level: The level.
        area: A rectangle: restrict the result to its inside, which equals that part of the whole result.
    """
    extended_area = None
    if area is not None:
        margin_m = 4.0 * max(layout.corner_radius_m, _MIDDLE_CLOSING_M)
        layout, extended_area = layout.near(area, margin_m), shapely.buffer(area, margin_m, join_style="mitre")
    plan = _Plan.from_layout(layout, level, extended_area)
    crosswalks = crosswalk_polygons([each for each in layout.crosswalks if each.level == level])
    closed = _road(plan, crosswalks)
    gores = _gores(plan, closed)
    road = _polygons(overlay.difference(closed, gores, grid_size=_GRID_M)) if not gores.is_empty else closed
    shoulder = _difference(overlay.union(_shoulders(plan, road), gores), road)
    paved = overlay.union(road, shoulder)
    sidewalk = _difference(_sidewalks(plan, paved), paved)
    median = _difference(_merge_strips(plan.areas_of(LaneKind.MEDIAN)), overlay.union(paved, sidewalk))
    crosswalk = _intersection(overlay.union_all(crosswalks), road)
    parts = road, shoulder, sidewalk, median, crosswalk
    return Surfaces(*(_polygons(part if area is None else overlay.intersection(part, area)) for part in parts))


def strip_polygons(strips: Sequence[Strip]) -> AnyArray:
    """(N,) polygons or multipolygons: the area of each strip."""
    shapes = [
        np.concatenate([strip.left_m[:, :2], strip.right_m[::-1, :2]]) if strip.outline_m is None else strip.outline_m
        for strip in strips
    ]
    row = np.repeat(np.arange(len(shapes)), [len(shape) for shape in shapes])
    rings = shapely.linearrings(np.concatenate([np.empty((0, 2)), *shapes]), indices=row)
    return _make_valid(np.asarray(shapely.polygons(rings), object))


def crosswalk_polygons(crosswalks: Sequence[Crosswalk]) -> AnyArray:
    """(N,) polygons: the area of each crosswalk."""
    return _make_valid([shapely.Polygon(crosswalk.outline_m[:, :2]) for crosswalk in crosswalks])


@dataclass(frozen=True, slots=True)
class _Plan:
    """(N,) strips of one level and (N,) their areas, with the corner radius of the layout."""

    strips: tuple[Strip, ...]
    areas: AnyArray
    corner_radius_m: float

    @classmethod
    def from_layout(cls, layout: Layout, level: int, extended_area: BaseGeometry | None) -> "_Plan":
        """Select the strips of a level; if an area is given, clip the strips to it, which saves much work."""
        strips = layout.strips_of(*LaneKind, level=level)
        areas = strip_polygons(strips)
        if extended_area is not None:
            areas = overlay.intersection(areas, extended_area)
            is_degenerate = ~np.isin(shapely.get_type_id(areas), _AREAS)  # strips that only touch the rectangle
            areas[is_degenerate] = [_polygons(area) for area in areas[is_degenerate]]
        return cls(strips, areas, layout.corner_radius_m)

    def areas_of(self, *kinds: LaneKind, outside_junctions: bool = False) -> AnyArray:
        """Areas of strips of these kinds, in order."""
        chosen = [strip.kind in kinds and not (outside_junctions and strip.junction) for strip in self.strips]
        return np.asarray(self.areas[np.array(chosen, bool)])


def _road(plan: _Plan, crosswalks: AnyArray) -> BaseGeometry:
    """The carriageway; closing fills only areas that no strip outside junctions uses for something else.

    On maps that describe only lanes, parking lanes end before junctions, where the sidewalk reaches the driving lanes.
    """
    ends_early = (LaneKind.PARKING,) if plan.corner_radius_m else ()
    lanes = plan.areas_of(*(kind for kind in ROAD_KINDS if kind not in ends_early))
    parking = overlay.union_all(plan.areas_of(*ends_early))
    lanes_only = overlay.union_all([*lanes, *crosswalks] if plan.corner_radius_m else lanes)
    shoulders, medians, sidewalks = (
        plan.areas_of(kind, outside_junctions=True) for kind in (LaneKind.SHOULDER, LaneKind.MEDIAN, LaneKind.SIDEWALK)
    )
    other_uses = overlay.union_all([_merge_strips(shoulders), _merge_strips(medians), *sidewalks])
    closed = _close(lanes_only, max(plan.corner_radius_m, _ROAD_CLOSING_M))
    if not parking.is_empty:
        closed = _close(overlay.union_all([closed, parking, _close(parking, _NODE_CLOSING_M)]), _SEAM_M)
        lanes_only = overlay.union(lanes_only, parking)
    return overlay.difference(closed, overlay.difference(other_uses, lanes_only), grid_size=_GRID_M)


def _gores(plan: _Plan, road: BaseGeometry) -> BaseGeometry:
    """Areas filled by closing between a motorway and its ramps, which continue as shoulders."""
    fast = np.array([strip.kind is LaneKind.DRIVING and strip.speed_mps > FAST_MPS for strip in plan.strips], bool)
    shoulders = overlay.union_all(plan.areas_of(LaneKind.SHOULDER))
    if not plan.corner_radius_m or shoulders.is_empty or not fast.any():
        return MultiPolygon()
    filled = shapely.get_parts(_difference(road, overlay.union_all(plan.areas_of(*ROAD_KINDS))))
    for neighbor in (shoulders, overlay.union_all(plan.areas[fast])):
        filled = filled[shapely.dwithin(filled, neighbor, 2.0 * _GRID_M)]
    return MultiPolygon(list(filled))


def _shoulders(plan: _Plan, road: BaseGeometry) -> BaseGeometry:
    """Shoulders; for maps that describe only lanes, also the gaps between them and lanes that begin or end there."""
    shoulders = _merge_strips(plan.areas_of(LaneKind.SHOULDER))
    if not plan.corner_radius_m or shoulders.is_empty:
        return shoulders
    beside = _intersection(road, shapely.buffer(shoulders, 2.0 * _NODE_CLOSING_M))
    paved = overlay.union(shoulders, beside)
    inside = [bool(strip.junction) and strip.kind in ROAD_KINDS for strip in plan.strips]
    nodes = shapely.buffer(overlay.union_all(plan.areas[np.array(inside, bool)]), 2.0 * _NODE_CLOSING_M)
    at_nodes = _intersection(_close(paved, _NODE_CLOSING_M), nodes)
    filled = overlay.union(_close(paved, _MIDDLE_CLOSING_M), at_nodes)
    return _difference(filled, overlay.union_all(plan.areas_of(*_WALK_KINDS, LaneKind.MEDIAN)))


def _merge_strips(areas: AnyArray) -> BaseGeometry:
    """Union of strips of one kind, with the gap between both directions closed."""
    return _close(overlay.union_all(areas), _MIDDLE_CLOSING_M)


def _sidewalks(plan: _Plan, paved: BaseGeometry) -> BaseGeometry:
    """Sidewalks and walking areas, and the corners between them and the paved area."""
    walks = overlay.union_all(plan.areas_of(*_WALK_KINDS))
    closing_m = max(plan.corner_radius_m, _WALK_CLOSING_M)
    street = _close(overlay.union(walks, paved), closing_m)
    return _intersection(street, shapely.buffer(walks, closing_m))


def _intersection(surface: BaseGeometry, other: BaseGeometry) -> MultiPolygon:
    """Polygonal part of an intersection, without lines where areas only touch: later operations reject these."""
    return _polygons(overlay.intersection(surface, other))


def _difference(surface: BaseGeometry, others: BaseGeometry) -> MultiPolygon:
    """Polygonal part of a difference, without residual lines, which later operations reject."""
    return _polygons(overlay.difference(surface, others, grid_size=_GRID_M))


def _close(area: BaseGeometry, radius_m: float) -> MultiPolygon:
    """Fill narrow gaps and inner corners of an area (morphological closing), on a millimeter grid."""
    if area.is_empty:
        return MultiPolygon()
    dilated = shapely.buffer(area, radius_m, quad_segs=12)
    closed = overlay.union(shapely.buffer(dilated, -radius_m, quad_segs=12), area)
    return _polygons(shapely.set_precision(shapely.simplify(closed, 2 * _GRID_M), _GRID_M))


def _make_valid(polygons: Sequence[shapely.Polygon] | AnyArray) -> AnyArray:
    """(N,) the same areas without self-intersections."""
    valid = np.array(polygons, object)
    is_invalid = ~shapely.is_valid(valid)
    valid[is_invalid] = [_polygons(area) for area in shapely.make_valid(valid[is_invalid])]
    return valid


def _polygons(area: BaseGeometry) -> MultiPolygon:
    """The two-dimensional parts of a geometry, without specks."""
    parts = polygon_parts(area)
    return MultiPolygon(list(parts[shapely.area(parts) > _SPECK_M2]))
