"""Positions for signs and barriers along the streets of a map, clear of all lanes that lead elsewhere."""

from collections import defaultdict
from collections.abc import Iterator, Set
from functools import cached_property

import numpy as np
import shapely

from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.types import AnyArray, BoolArray, Float64Array
from simbev_ros.maps.network import Lane, RoadNetwork
from simbev_ros.maps.roads.lane_kind import ROAD_KINDS, WALKABLE_KINDS, LaneKind
from simbev_ros.maps.roads.layout import Strip
from simbev_ros.maps.roads.polylines import Polylines
from simbev_ros.maps.roads.surface import strip_polygons
from simbev_ros.scene.cached_method import cached_method
from simbev_ros.scene.footprints import footprints
from simbev_ros.scene.hazards.area import HazardArea

_SIGN_OFFSETS_M = (0.5, 0.9, 1.4, 2.0)  # distances from the road's edge to the center of a sign, in order of preference
_ROW_DISTANCES_M = (3.0, 4.0, 5.0, 6.0, 2.0)  # from a street's start to a row of barriers, in order of preference
_CLEAR_M = 0.05
_LEVEL_TOLERANCE_M = 2.5
_NEAR_STRUCTURE_M = 6.0
_MAX_PATHS = 24  # number of lanes searched for a sign upstream of an area


class Roadside:
    """The sides and the starts of a map's streets.

    Attributes:
        edges: Lanes of each edge except walkable ones, outermost first.
    """

    def __init__(self, network: RoadNetwork) -> None:
        self._network = network
        self.edges: dict[str, list[Lane]] = defaultdict(list)
        self._predecessors: dict[str, list[Lane]] = defaultdict(list)
        hand = 0
        for lane in network.lanes.values():
            if lane.kind not in WALKABLE_KINDS:
                self.edges[lane.edge].append(lane)
                for successor in lane.successors:
                    self._predecessors[successor].append(lane)
        for lanes in self.edges.values():
            lanes.sort(key=lambda lane: lane.index)
            hand += side_of(lanes[1], lanes[0]) if len(lanes) > 1 else 0
        for lane in network.lanes_of(LaneKind.SIDEWALK):
            if lane.edge in self.edges:
                hand += side_of(self.edges[lane.edge][-1], lane)
        self.hand = 1 if hand >= 0 else -1
        """1 if traffic keeps to the right, -1 if to the left."""

    def width_m(self, edge: str) -> float:
        """Total width of an edge's driving lanes."""
        return sum(lane.width_m for lane in self._driving(edge))

    def entrances(self, edges: Set[str]) -> tuple[str, ...]:
        """The subset of edges that can be entered from other edges, sorted."""
        return tuple(sorted(edge for edge in edges if not self._edges_before(edge) <= edges))

    def _edges_before(self, edge: str) -> set[str]:
        """The edges that lead to an edge through junctions."""
        before_edges, pending = set[str](), [*self._driving(edge)]
        while pending:
            for before in self._predecessors[pending.pop().id]:
                if before.junction:
                    pending.append(before)
                else:
                    before_edges.add(before.edge)
        return before_edges

    def row_across(
        self, edge: str, across_m: Float64Array, size_m: tuple[float, float]
    ) -> tuple[Float64Array, Float64Array]:
        """(N, 3) positions and (N,) headings in a row across the start of an edge, off its crosswalks.

        Args:
            edge: The edge.
            across_m: (N,) distances from the outer border of its driving lanes.
            size_m: Length and width of the objects to place.
        """
        lane = self._driving(edge)[0]
        for s_m in _ROW_DISTANCES_M:
            position_m, yaw_rad = self._network.pose_on_lane(lane.id, min(s_m, lane.length_m))
            inwards = self.hand * np.array([-np.sin(yaw_rad), np.cos(yaw_rad), 0.0])
            positions_m = position_m + (across_m - lane.width_m / 2.0)[:, None] * inwards
            yaws_rad = np.full(len(positions_m), yaw_rad)
            boxes = footprints(np.array(size_m), positions_m, yaws_rad)
            if not self._hits(boxes, float(position_m[2]), self._lane_mask(LaneKind.CROSSING)).any():
                break
        return positions_m, yaws_rad

    def sign_ahead_of(
        self, area: HazardArea, distance_m: float, size_m: tuple[float, float]
    ) -> tuple[Float64Array, Float64Array] | None:
        """(1, 3) position and (1,) heading of a sign at the roadside, at a distance ahead of an area; None: no room.

        The sign stands on the straightest path to the area that has room: on the sidewalk or verge or, as on bridges,
        on the hard shoulder.
        """
        for lane, s_m in self._paths_to(area, distance_m):
            lanes = self.edges[lane.edge]
            to_border_m = sum(each.width_m for each in lanes[: lanes.index(lane)]) + lane.width_m / 2.0
            position_m, yaw_rad = self._network.pose_on_lane(lane.id, s_m)
            outwards = self.hand * np.array([np.sin(yaw_rad), -np.cos(yaw_rad), 0.0])
            beside_m = np.array(_SIGN_OFFSETS_M)
            if lanes[0].kind is LaneKind.SHOULDER:
                beside_m = np.append(beside_m, -np.array(size_m).max() / 2.0 - _CLEAR_M)
            positions_m = position_m + (to_border_m + beside_m)[:, None] * outwards
            boxes = footprints(np.array(size_m), positions_m, np.full(len(positions_m), yaw_rad))
            off_road = (beside_m < 0.0) | ~self._hits(boxes, float(position_m[2]), self._lane_mask(LaneKind.SHOULDER))
            clear = ~self._hits(boxes, float(position_m[2]), self._lane_mask(*ROAD_KINDS, LaneKind.CROSSING))
            room = np.flatnonzero(off_road & clear & self._is_on_structure(boxes, position_m))
            if len(room):
                return positions_m[room[:1]], np.array([yaw_rad])
        return None

    def _driving(self, edge: str) -> list[Lane]:
        return [lane for lane in self.edges[edge] if lane.kind is LaneKind.DRIVING]

    def _paths_to(self, area: HazardArea, distance_m: float) -> Iterator[tuple[Lane, float]]:
        """Yield lanes outside junctions, and positions on them, at a distance before an area; the straightest first."""
        first = self._driving(area.closed[0].edge)[0]
        open_paths, searched = [(first, area.from_s_m - distance_m)], 0
        while open_paths and searched < _MAX_PATHS:
            lane, s_m = open_paths.pop()
            searched += 1
            if s_m >= 0.0:
                if not lane.junction:
                    yield lane, s_m
                continue
            heading = start_heading(lane)
            before = sorted(
                self._predecessors[lane.id], key=lambda each: (float(start_heading(each) @ heading), each.id)
            )
            open_paths += [(each, s_m + each.length_m) for each in before]

    @cached_property
    def _lines(self) -> tuple[shapely.STRtree, AnyArray, Float64Array, Float64Array]:
        """The lanes' center lines, half widths and mean heights."""
        lanes = list(self._network.lanes.values())
        lines = Polylines.from_lines([lane.centerline_m for lane in lanes])
        shapes = np.asarray(shapely.linestrings(lines.points_m[:, :2], indices=lines.row), object)
        half_width_m = np.array([lane.width_m / 2.0 for lane in lanes])
        return (
            shapely.STRtree(shapes),
            shapes,
            half_width_m,
            np.array([lane.centerline_m[:, 2].mean() for lane in lanes]),
        )

    @cached_method()
    def _lane_mask(self, *kinds: LaneKind) -> BoolArray:
        """(L,) whether each lane is of one of these kinds."""
        return np.array([lane.kind in kinds for lane in self._network.lanes.values()], bool)

    @cached_property
    def _raised_strips(self) -> tuple[shapely.STRtree, list[Strip]]:
        """The strips that structures carry."""
        raised = [strip for strip in self._network.layout.strips if strip.level > 0]
        return shapely.STRtree(strip_polygons(raised)), raised

    def _is_on_structure(self, boxes: AnyArray, road_m: Float64Array) -> BoolArray:
        """(N,) whether boxes beside a (3,) road position are on its structure, or on the ground if the road is."""
        tree, raised = self._raised_strips
        nearby = tree.query(shapely.Point(road_m[:2]), predicate="dwithin", distance=_NEAR_STRUCTURE_M)
        on_level = [
            row for row in nearby.tolist() if np.abs(raised[row].left_m[:, 2] - road_m[2]).min() < _LEVEL_TOLERANCE_M
        ]
        if not on_level:
            return np.ones(len(boxes), bool)
        return shapely.covers(overlay.union_all(tree.geometries[on_level]).buffer(_CLEAR_M), boxes)

    def _hits(self, boxes: AnyArray, z_m: float, lanes: BoolArray) -> BoolArray:
        """(N,) whether boxes at a height touch any of the lanes in a mask."""
        tree, shapes, half_width_m, height_m = self._lines
        box, lane = tree.query(boxes, predicate="dwithin", distance=float(half_width_m.max(initial=0.0)))
        nearby = lanes[lane] & (np.abs(height_m[lane] - z_m) < _LEVEL_TOLERANCE_M)
        box, lane = box[nearby], lane[nearby]
        on_lane = shapely.distance(boxes[box], shapes[lane]) < half_width_m[lane] + _CLEAR_M
        hits = np.zeros(len(boxes), bool)
        hits[box[on_lane]] = True
        return hits


def start_heading(lane: Lane) -> Float64Array:
    """(2,) unit vector of a lane's direction at its start."""
    direction_m = lane.centerline_m[1, :2] - lane.centerline_m[0, :2]
    return direction_m / max(float(np.linalg.norm(direction_m)), 1e-9)


def side_of(other: Lane, lane: Lane) -> int:
    """1 if another lane of the edge is on the left of a lane, otherwise -1."""
    heading = start_heading(lane)
    gap_m = other.centerline_m[0, :2] - lane.centerline_m[0, :2]
    return 1 if heading[0] * gap_m[1] - heading[1] * gap_m[0] > 0.0 else -1
