"""Keeps the objects of a map off its carriageways: they are moved beside them, cut, or left out."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.geometry.plan_view import polygon_parts
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.findings import Finding, Outcome
from simbev_ros.maps.land_features import MapObject, ObjectKind
from simbev_ros.maps.roads.elevation import Elevation
from simbev_ros.maps.roads.lane_kind import ROAD_KINDS
from simbev_ros.maps.roads.layout import Layout
from simbev_ros.maps.roads.surface import strip_polygons

_CLEARANCE_M = 4.5  # objects that begin above this height hang over the traffic
_BESIDE_M, _MAX_MOVE_M = 0.5, 4.0
_NEAR_M = 10.0
_MIN_LENGTH_M = 1.0
_MIN_SHARE = 0.5
_CROSSING = (
    ObjectKind.RAILS,
    ObjectKind.ISLAND,
    ObjectKind.UTILITY_POLE,
    ObjectKind.PARKING_LOT,
    ObjectKind.PARKING_SPACE,
)


def clear_carriageways(
    objects: Sequence[MapObject], layout: Layout
) -> tuple[tuple[MapObject, ...], tuple[Finding, ...]]:
    """The objects with nothing left on a carriageway of their level, and what was changed.

    A thing on a carriageway is moved up to 4 m to its edge; of a line or an outline, the part outside remains; what
    would lose more than half of its outline is left out. Rails, traffic islands, power lines and parking lots stay,
    and so does what begins 4.5 m above the road.
    """
    if not objects:
        return (), ()
    roads = _Roads(layout)
    levels = Elevation(layout).level_at(np.array([item.points_m[0] for item in objects]))
    kept: list[MapObject] = []
    moved = lost = 0
    for item, level in zip(objects, levels.tolist(), strict=True):
        if item.kind in _CROSSING or item.bottom_m >= _CLEARANCE_M:
            kept.append(item)
            continue
        clear = roads.clear(item, level)
        kept += clear
        lost += not clear
        moved += bool(clear) and clear[0] is not item
    findings = (
        Finding("an object on a carriageway is moved to its edge, or cut", Outcome.REPAIRED, moved),
        Finding("an object that stands on a carriageway is left out", Outcome.LEFT_OUT, lost),
    )
    return tuple(kept), tuple(finding for finding in findings if finding.count)


class _Roads:
    """The carriageways of a map by level."""

    def __init__(self, layout: Layout) -> None:
        self._trees = [
            shapely.STRtree(strip_polygons(layout.strips_of(*ROAD_KINDS, level=level))) for level in layout.levels
        ]

    def clear(self, item: MapObject, level: int) -> list[MapObject]:
        """The part of an object that is kept."""
        plan = _plan(item)
        tree = self._trees[level]
        if len(tree.query(plan, predicate="intersects")) == 0:
            return [item]
        around = tree.geometries[tree.query(plan, predicate="dwithin", distance=_NEAR_M)]
        road = overlay.union_all(around, grid_size=0.001)
        if isinstance(plan, shapely.Point):
            return _moved(item, plan, road)
        if isinstance(plan, shapely.LineString):
            rest = shapely.get_parts(overlay.difference(plan, road))
            return [_cut(item, shapely.get_coordinates(part)) for part in rest if part.length >= _MIN_LENGTH_M]
        parts = polygon_parts(overlay.difference(plan, road))
        if shapely.area(parts).sum() < _MIN_SHARE * plan.area:
            return []
        return [_cut(item, shapely.get_coordinates(part.exterior)) for part in parts]


def _plan(item: MapObject) -> BaseGeometry:
    """The object in plan."""
    if len(item.points_m) == 1:
        return shapely.Point(item.points_m[0, :2])
    if item.is_outline:
        return shapely.make_valid(shapely.Polygon(item.points_m[:, :2]))
    return shapely.LineString(item.points_m[:, :2])


def _moved(item: MapObject, point: shapely.Point, road: BaseGeometry) -> list[MapObject]:
    """A thing just beside the road, if its edge is near."""
    edge = shapely.buffer(road, _BESIDE_M).boundary
    beside_m = shapely.get_coordinates(shapely.shortest_line(point, edge))[1]
    if float(np.hypot(*(beside_m - item.points_m[0, :2]))) > _MAX_MOVE_M + _BESIDE_M:
        return []
    return [_cut(item, beside_m[None])]


def _cut(item: MapObject, xy_m: Float64Array) -> MapObject:
    """The object at other (N, 2) positions on the same level."""
    return replace(item, points_m=np.column_stack([xy_m, np.full(len(xy_m), item.points_m[:, 2].mean())]))
