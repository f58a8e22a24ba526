"""Where signs and barriers can stand along the streets of a map: clear of all lanes that lead elsewhere."""

from collections import defaultdict
from collections.abc import Iterator, Set
from functools import cache, cached_property

import numpy as np
import shapely

from simbev_ros.maps.network import Lane, RoadNetwork
from simbev_ros.maps.roads.lane_kind import ROAD_KINDS, WALKABLE_KINDS, LaneKind
from simbev_ros.maps.roads.layout import Strip
from simbev_ros.maps.roads.polylines import Polylines
from simbev_ros.maps.roads.surface import strip_polygons
from simbev_ros.scene.footprints import footprints
from simbev_ros.scene.hazards.area import HazardArea
from simbev_ros.types import AnyArray, BoolArray, Float64Array

_OFF_ROAD_M = (0.5, 0.9, 1.4, 2.0)  # from the road's edge to the middle of a sign
_ROW_M = (3.0, 4.0, 5.0, 6.0, 2.0)  # from a street's beginning to a row of barriers
_CLEAR_M = 0.05
_LEVEL_M = 2.5
_BESIDE_M = 6.0
_MOST_WAYS = 24  # that lead to an area are looked at


class Roadside:
    """The sides and the beginnings of a map's streets."""

    def __init__(self, network: RoadNetwork) -> None:
        self._network = network
        self.edges: dict[str, list[Lane]] = defaultdict(list)
        self._before: dict[str, list[Lane]] = defaultdict(list)
        hand = 0
        for lane in network.lanes.values():
            if lane.kind not in WALKABLE_KINDS:
                self.edges[lane.edge].append(lane)
                for successor in lane.successors:
                    self._before[successor].append(lane)
        for lanes in self.edges.values():
            lanes.sort(key=lambda lane: lane.index)
            hand += side_of(lanes[1], lanes[0]) if len(lanes) > 1 else 0
        for lane in network.lanes_of(LaneKind.SIDEWALK):
            if lane.edge in self.edges:
                hand += side_of(self.edges[lane.edge][-1], lane)
        self._of_kind = cache(self._lanes_of)
        self.hand = 1 if hand >= 0 else -1
        """1 if traffic keeps to the right, -1 if to the left."""

    def width_m(self, edge: str) -> float:
        """Width of an edge's driving lanes."""
        return sum(lane.width_m for lane in self._driving(edge))

    def entrances(self, edges: Set[str]) -> tuple[str, ...]:
        """Those of some edges that one drives onto from others, in order."""
        return tuple(sorted(edge for edge in edges if not self._edges_before(edge) <= edges))

    def _edges_before(self, edge: str) -> set[str]:
        """The edges that lead to an edge, through junctions."""
        found, waiting = set[str](), [*self._driving(edge)]
        while waiting:
            for before in self._before[waiting.pop().id]:
                if before.junction:
                    waiting.append(before)
                else:
                    found.add(before.edge)
        return found

    def across(
        self, edge: str, across_m: Float64Array, size_m: tuple[float, float]
    ) -> tuple[Float64Array, Float64Array]:
        """(N, 3) places and (N,) directions in a row across an edge's beginning, off its crosswalks.

        Args:
            edge: Which.
            across_m: (N,) from the outer border of its driving lanes.
            size_m: Of what shall stand there.
        """
        lane = self._driving(edge)[0]
        for s_m in _ROW_M:
            position_m, yaw_rad = self._network.pose_on_lane(lane.id, min(s_m, lane.length_m))
            inwards = self.hand * np.array([-np.sin(yaw_rad), np.cos(yaw_rad), 0.0])
            places_m = position_m + (across_m - lane.width_m / 2.0)[:, None] * inwards
            yaws_rad = np.full(len(places_m), yaw_rad)
            boxes = footprints(np.array(size_m), places_m, yaws_rad)
            if not self._hits(boxes, float(position_m[2]), self._of_kind(LaneKind.CROSSING)).any():
                break
        return places_m, yaws_rad

    def ahead_of(
        self, area: HazardArea, distance_m: float, size_m: tuple[float, float]
    ) -> tuple[Float64Array, Float64Array] | None:
        """The (1, 3) place and (1,) direction of a sign beside the road at a distance ahead of an area.

        It is on the straightest way to the area that has room for it: on the sidewalk or verge, or the hard shoulder,
        as on bridges. None: there is no such place.
        """
        for lane, s_m in self._ways(area, distance_m):
            lanes = self.edges[lane.edge]
            middle_m = sum(each.width_m for each in lanes[: lanes.index(lane)]) + lane.width_m / 2.0
            position_m, yaw_rad = self._network.pose_on_lane(lane.id, s_m)
            outwards = self.hand * np.array([np.sin(yaw_rad), -np.cos(yaw_rad), 0.0])
            beside_m = np.array(_OFF_ROAD_M)
            if lanes[0].kind is LaneKind.SHOULDER:
                beside_m = np.append(beside_m, -np.array(size_m).max() / 2.0 - _CLEAR_M)
            places_m = position_m + (middle_m + beside_m)[:, None] * outwards
            boxes = footprints(np.array(size_m), places_m, np.full(len(places_m), yaw_rad))
            off_road = (beside_m < 0.0) | ~self._hits(boxes, float(position_m[2]), self._of_kind(LaneKind.SHOULDER))
            clear = ~self._hits(boxes, float(position_m[2]), self._of_kind(*ROAD_KINDS, LaneKind.CROSSING))
            room = np.flatnonzero(off_road & clear & self._carried(boxes, position_m))
            if len(room):
                return places_m[room[:1]], np.array([yaw_rad])
        return None

    def _driving(self, edge: str) -> list[Lane]:
        return [lane for lane in self.edges[edge] if lane.kind is LaneKind.DRIVING]

    def _ways(self, area: HazardArea, distance_m: float) -> Iterator[tuple[Lane, float]]:
        """Lanes outside junctions, and distances on them, from where it is so far to an area; the straightest first."""
        first = self._driving(area.closed[0].edge)[0]
        ways, looked_at = [(first, area.from_s_m - distance_m)], 0
        while ways and looked_at < _MOST_WAYS:
            lane, s_m = ways.pop()
            looked_at += 1
            if s_m >= 0.0:
                if not lane.junction:
                    yield lane, s_m
                continue
            heading = start_heading(lane)
            before = sorted(self._before[lane.id], key=lambda each: (float(start_heading(each) @ heading), each.id))
            ways += [(each, s_m + each.length_m) for each in before]

    @cached_property
    def _lines(self) -> tuple[shapely.STRtree, AnyArray, Float64Array, Float64Array]:
        """The lanes' centre lines, half their widths and their heights."""
        lanes = list(self._network.lanes.values())
        lines = Polylines.of([lane.centerline_m for lane in lanes])
        shapes = np.asarray(shapely.linestrings(lines.points_m[:, :2], indices=lines.row), object)
        half_m = np.array([lane.width_m / 2.0 for lane in lanes])
        return shapely.STRtree(shapes), shapes, half_m, np.array([lane.centerline_m[:, 2].mean() for lane in lanes])

    def _lanes_of(self, *kinds: LaneKind) -> BoolArray:
        """(L,) which of the lanes are of some kinds."""
        return np.array([lane.kind in kinds for lane in self._network.lanes.values()], bool)

    @cached_property
    def _decks(self) -> tuple[shapely.STRtree, list[Strip]]:
        """What is carried by structures."""
        raised = [strip for strip in self._network.layout.strips if strip.level > 0]
        return shapely.STRtree(strip_polygons(raised)), raised

    def _carried(self, boxes: AnyArray, road_m: Float64Array) -> BoolArray:
        """(N,) whether boxes beside a (3,) place of a road stand on its structure, or are on the ground as that is."""
        tree, decks = self._decks
        near = tree.query(shapely.Point(road_m[:2]), predicate="dwithin", distance=_BESIDE_M)
        level = [row for row in near.tolist() if np.abs(decks[row].left_m[:, 2] - road_m[2]).min() < _LEVEL_M]
        if not level:
            return np.ones(len(boxes), bool)
        covered: BoolArray = shapely.covers(shapely.union_all(tree.geometries[level]).buffer(_CLEAR_M), boxes)
        return covered

    def _hits(self, boxes: AnyArray, z_m: float, lanes: BoolArray) -> BoolArray:
        """(N,) whether boxes at a height are on some of the lanes."""
        tree, shapes, half_m, height_m = self._lines
        box, lane = tree.query(boxes, predicate="dwithin", distance=float(half_m.max(initial=0.0)))
        near = lanes[lane] & (np.abs(height_m[lane] - z_m) < _LEVEL_M)
        box, lane = box[near], lane[near]
        on_lane = shapely.distance(boxes[box], shapes[lane]) < half_m[lane] + _CLEAR_M
        hits = np.zeros(len(boxes), bool)
        hits[box[on_lane]] = True
        return hits


def start_heading(lane: Lane) -> Float64Array:
    """(2,) unit vector in which a lane begins."""
    way_m = lane.centerline_m[1, :2] - lane.centerline_m[0, :2]
    heading: Float64Array = way_m / max(float(np.linalg.norm(way_m)), 1e-9)
    return heading


def side_of(other: Lane, lane: Lane) -> int:
    """1 if another lane of the edge is on the left of a lane, else -1."""
    heading = start_heading(lane)
    gap_m = other.centerline_m[0, :2] - lane.centerline_m[0, :2]
    return 1 if heading[0] * gap_m[1] - heading[1] * gap_m[0] > 0.0 else -1
