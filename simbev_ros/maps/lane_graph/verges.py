"""Adds footways on the verges of slow roads to a map without sidewalks: people walk along the edge of the road there.

They are lanes of the SUMO net alone. The layout keeps what the map's file has, so that verges stay unpaved.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import shapely
from scipy.spatial import cKDTree

from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.findings import WALKED_VERGES, Findings
from simbev_ros.maps.lane_graph.traffic import LaneOfEdge, Traffic, TrafficEdge, TrafficLane
from simbev_ros.maps.roads.lane_kind import ROAD_KINDS, LaneKind
from simbev_ros.maps.roads.layout import Strip
from simbev_ros.maps.roads.surface import strip_polygons

VERGE_M = 1.5
"""Width of the footway on a verge."""
VERGE_MAX_MPS = 17.0
"""Nobody walks beside faster roads."""

_GAPS_M = (0.15, 1.0, 2.65)  # from the outermost lane to the footway; the first one that is free, as beside parked cars
_MAX_ON_ROAD = 0.15
_SPACING_M = 0.1
_LEVEL_TOLERANCE_M = 2.0
_BESIDE_M = 4.5  # reaches the edge's own lanes
_MIN_STRETCH = 0.3  # of the footway's length to the lane's: it is shorter on the inside of bends
_WALK_MPS = 2.78


def with_verges(traffic: Traffic, strips: Sequence[Strip], left_hand: bool, notes: Findings) -> Traffic:
    """The traffic with a footway as the outermost lane of each slow edge, if no edge has a sidewalk.

    Args:
        traffic: Edges and connections.
        strips: All strips of the map; edges on structures and edges without free ground beside them get no footway.
        left_hand: Traffic keeps to the left.
        notes: Receives a note if there are footways.
    """
    if any(lane.kind is LaneKind.SIDEWALK for edge in traffic.edges for lane in edge.lanes):
        return traffic
    roads = _Roads(strips)
    added: dict[str, TrafficEdge] = {}
    for edge in traffic.edges:
        line_m = _footway_m(edge, roads, left_hand)
        if line_m is not None:
            lane = TrafficLane((), LaneKind.SIDEWALK, line_m, VERGE_M, _WALK_MPS, "pedestrian", False, False)
            added[edge.id] = replace(edge, lanes=(lane, *edge.lanes))
    if not added:
        return traffic
    notes.assumed(WALKED_VERGES)

    def shifted(end: LaneOfEdge) -> LaneOfEdge:
        return end[0], end[1] + (end[0] in added)

    return Traffic(
        tuple(added.get(edge.id, edge) for edge in traffic.edges),
        tuple(replace(each, start=shifted(each.start), goal=shifted(each.goal)) for each in traffic.connections),
    )


class _Roads:
    """The area of the lanes that vehicles use, in plan, with heights."""

    def __init__(self, strips: Sequence[Strip]) -> None:
        self._strips = [strip for strip in strips if strip.kind in ROAD_KINDS]
        self._tree = shapely.STRtree(strip_polygons(self._strips))

    def are_clear_of(self, line_m: Float64Array) -> bool:
        """Whether hardly any of an (N, 3) line lies on them, and none above or below them or on a structure."""
        line = shapely.LineString(line_m[:, :2])
        rows = self._tree.query(shapely.buffer(line, _BESIDE_M), predicate="intersects").tolist()
        for row in rows:
            center_m = self._strips[row].center_m
            gaps_m, nearest = cKDTree(center_m[:, :2]).query(line_m[:, :2])
            there = int(gaps_m.argmin())
            if self._strips[row].structure or self._strips[row].tunnel:
                return False
            if abs(center_m[nearest[there], 2] - line_m[there, 2]) > _LEVEL_TOLERANCE_M:
                return False
        area = overlay.union_all(self._tree.geometries[rows])
        return bool(overlay.intersection(line, area).length <= _MAX_ON_ROAD * line.length)


def _footway_m(edge: TrafficEdge, roads: _Roads, left_hand: bool) -> Float64Array | None:
    """(N, 3) center line of the footway beside an edge; None if there is none."""
    outer = edge.lanes[0]
    if max(lane.speed_mps for lane in edge.lanes) > VERGE_MAX_MPS:
        return None
    line = shapely.LineString(outer.line_m[:, :2])
    for gap_m in _GAPS_M:
        outward_m = outer.width_m / 2.0 + gap_m + VERGE_M / 2.0
        footway = max(
            shapely.get_parts(shapely.offset_curve(line, outward_m if left_hand else -outward_m)),
            key=shapely.length,
            default=shapely.LineString(),
        )
        if footway.length > _MIN_STRETCH * line.length:
            at_m = np.maximum.accumulate(shapely.line_locate_point(footway, shapely.points(outer.line_m[:, :2])))
            at_m[0], at_m[-1] = 0.0, footway.length
            apart = np.append((np.diff(at_m) > _SPACING_M) & (at_m[:-1] < footway.length - _SPACING_M), True)
            apart[0] = True
            xy_m = shapely.get_coordinates(shapely.line_interpolate_point(footway, at_m[apart]))
            line_m = np.column_stack([xy_m, outer.line_m[apart, 2]])
            if roads.are_clear_of(line_m):
                return line_m
    return None
