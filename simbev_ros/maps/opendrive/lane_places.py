"""Road coordinates of a map: from road, lane and distances to the map frame, back, and along the lanes."""

import heapq
import math
from collections.abc import Collection
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np
import shapely

from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.findings import Findings
from simbev_ros.maps.opendrive.borders import lane_edges_m, point_m
from simbev_ros.maps.opendrive.links import LaneLinks
from simbev_ros.maps.opendrive.reading.attributes import keep_leading_numbers
from simbev_ros.maps.opendrive.reading.document import Contact, LaneKey, Road, Section
from simbev_ros.maps.opendrive.reading.reader import read_document
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.safe_xml import parse

_SEARCH_M = 40.0
_SAMPLE_M = 2.0
_CURVATURE_STEP_M = 0.05
_MAX_DISTANCE_M = 20_000.0


class RoadPoint(NamedTuple):
    """A position in the coordinates of a road; t is positive to the left of its reference line."""

    road: str
    s_m: float
    t_m: float


@dataclass(frozen=True, slots=True)
class LanePlace:
    """A position on a lane, of something that moves along it.

    Attributes:
        road: Id of the road.
        lane: Id of the lane, never 0.
        s_m: Distance along the road.
        offset_m: Distance from the lane's center line in direction of t.
        forward: Whether it moves in the direction of s.
    """

    road: str
    lane: int
    s_m: float
    offset_m: float = 0.0
    forward: bool = True


def wrapped(angle_rad: float) -> float:
    """An angle between -π and π."""
    return math.remainder(angle_rad, 2.0 * math.pi)


class Roads:
    """The roads of an OpenDRIVE file in the map frame."""

    def __init__(self, path: Path) -> None:
        """Read the file of a built map, whose coordinates are those of the map frame."""
        notes, root = Findings(path), parse(path, "OpenDRIVE")
        keep_leading_numbers(root, notes)
        document = read_document(path, root, notes)
        self._roads, self._links = document.roads, LaneLinks(document)

    def __contains__(self, road: object) -> bool:
        return road in self._roads

    def length_m(self, road: str) -> float:
        """Length of a road."""
        return self._roads[road].length_m

    def pose(self, point: RoadPoint) -> tuple[Float64Array, float]:
        """(3,) position in the map frame, and the direction of the road there."""
        road = self._roads[point.road]
        s_m = min(max(point.s_m, 0.0), road.length_m)
        return point_m(road, s_m, point.t_m), float(road.plan(np.array([s_m]))[2][0])

    def point_of(self, place: LanePlace) -> RoadPoint:
        """The position on a lane in the coordinates of its road."""
        return RoadPoint(place.road, place.s_m, self.lane_t_m(place.road, place.lane, place.s_m) + place.offset_m)

    def lane_t_m(self, road_id: str, lane: int, s_m: float) -> float:
        """T of a lane's center line; raises KeyError if there is no such lane."""
        road = self._roads[road_id]
        at_m = np.array([min(max(s_m, 0.0), road.length_m)])
        center_m = float(road.offset(at_m)[0])
        section = self._section(road, lane > 0, s_m)
        position = next((index for index, each in enumerate(section.lanes) if each.id == lane), None)
        if position is None:
            raise KeyError(f"road {road_id} has no lane {lane} at s = {s_m:g}")
        edges_m = lane_edges_m(section, at_m)[:, 0]
        return center_m + math.copysign(float(edges_m[position] + edges_m[position + 1]) / 2.0, lane)

    def place_of(self, point: RoadPoint, yaw_rad: float | None = None) -> LanePlace | None:
        """The lane at a point, as a place of something with a direction; without one, with the lane's traffic.

        None if the road has no lanes there.
        """
        road, at_m = self._roads[point.road], np.array([point.s_m])
        from_center_m = point.t_m - float(road.offset(at_m)[0])
        sides = (self._section(road, left == (from_center_m > 0.0), point.s_m) for left in (True, False))
        section = next((each for each in sides if each.lanes), None)
        if section is None:
            return None
        edges_m = lane_edges_m(section, at_m)[:, 0]
        index = min(int(np.searchsorted(edges_m, abs(from_center_m))), len(section.lanes)) - 1
        lane = section.lanes[max(index, 0)]
        offset_m = point.t_m - self.lane_t_m(point.road, lane.id, point.s_m)
        forward = road.drives_forward(lane)
        if yaw_rad is not None:
            forward = math.cos(yaw_rad - self.pose(point)[1]) >= 0.0
        return LanePlace(point.road, lane.id, point.s_m, offset_m, forward)

    def drives_forward(self, road_id: str, lane: int, s_m: float) -> bool:
        """Whether traffic on a lane runs in the direction of s."""
        road = self._roads[road_id]
        lanes = self._section(road, lane > 0, s_m).lanes
        return next((road.drives_forward(each) for each in lanes if each.id == lane), (lane < 0) != road.left_hand)

    def next_lane(self, place: LanePlace, count: int) -> int:
        """Id of the lane that is a number of lanes to the left of a place in its direction; no lane has the id 0."""
        lane = place.lane + (count if place.forward else -count)
        return lane + int(math.copysign(1, count if place.forward else -count)) if lane * place.lane <= 0 else lane

    def locate(self, position_m: Float64Array, yaw_rad: float | None = None) -> RoadPoint | None:
        """The road at a (3,) position, map frame: one with a lane there, if possible in this direction.

        None if there is no road within 40 m.
        """
        tree, owners = self._index
        best: tuple[float, RoadPoint] | None = None
        for row in sorted(tree.query(shapely.Point(position_m[:2]), "dwithin", _SEARCH_M).tolist()):
            road = self._roads[owners[row]]
            s_m = self._project_s_m(road, tree.geometries[row], position_m)
            point_xyz_m, heading_rad = self.pose(RoadPoint(road.id, s_m, 0.0))
            arm_m = position_m[:2] - point_xyz_m[:2]
            t_m = float(-math.sin(heading_rad) * arm_m[0] + math.cos(heading_rad) * arm_m[1])
            along_m = float(math.cos(heading_rad) * arm_m[0] + math.sin(heading_rad) * arm_m[1])
            place = self.place_of(RoadPoint(road.id, s_m, t_m))
            if place is None:
                continue
            outside_m = max(abs(place.offset_m) - self.half_width_m(place), 0.0) + abs(along_m)
            turn = 0.0
            if yaw_rad is not None:
                ahead_rad = heading_rad + (0.0 if place.forward else math.pi)
                turn = 1.0 - math.cos(yaw_rad - ahead_rad)
            height_m = abs(float(position_m[2] - point_m(road, s_m, t_m)[2])) if math.isfinite(position_m[2]) else 0.0
            cost = outside_m + 0.5 * turn + 0.01 * abs(place.offset_m) + max(height_m - 2.0, 0.0)
            if best is None or cost < best[0]:
                best = cost, RoadPoint(road.id, s_m, t_m)
        return None if best is None else best[1]

    def advance(
        self, place: LanePlace, distance_m: float, route: Collection[str] = (), *, along_s: bool = False
    ) -> LanePlace | None:
        """The place some distance ahead on the same lane, over junctions straight ahead or over the roads of a route.

        Args:
            place: Where it starts.
            distance_m: Distance along the line that keeps its offset from the lane's center; negative: back.
            route: Ids of roads.
            along_s: The distance is along reference lines instead.

        Returns:
            None if the lane ends before, or it is very far.
        """
        left_m = distance_m
        while abs(distance_m) <= _MAX_DISTANCE_M:
            road = self._roads[place.road]
            direction = math.copysign(1.0, left_m) * (1.0 if place.forward else -1.0)
            end_m = _next_break_m(road, place.s_m, direction)
            step_m = abs(left_m) * direction
            step_m = step_m if along_s else self._step_s_m(road, place, end_m, step_m)
            if (end_m - place.s_m - step_m) * direction >= -1e-9:
                s_m = place.s_m + step_m
                return replace(place, s_m=s_m, lane=self._lane_after(road, place, s_m))
            left_m -= left_m * (end_m - place.s_m) / step_m
            end = replace(place, s_m=end_m, lane=self._lane_after(road, place, end_m))
            if 0.0 < end_m < road.length_m:
                place = end
                continue
            following = self._following(end, "end" if direction > 0.0 else "start", route)
            if following is None:
                return None
            key, contact = following
            # It goes into the next road at this contact: from its start in the direction of s.
            inward = contact == "start"
            same = inward == (direction > 0.0)
            place = LanePlace(
                key.road,
                key.lane,
                0.0 if inward else self._roads[key.road].length_m,
                place.offset_m if same else -place.offset_m,
                inward == (left_m >= 0.0),
            )
        return None

    def distance_m(self, start: LanePlace, end: RoadPoint) -> float | None:
        """Distance along the roads from a place to a point ahead of it (positive) or behind; None: no road leads there.

        It is the shorter one of both, along reference lines.
        """
        if start.road == end.road:
            return (end.s_m - start.s_m) * (1.0 if start.forward else -1.0)
        paths = [(sign, self._search(start, end, start.forward == (sign > 0.0))) for sign in (1.0, -1.0)]
        return min((sign * found[0] for sign, found in paths if found is not None), key=abs, default=None)

    def route_between(self, start: LanePlace, end: RoadPoint) -> tuple[str, ...] | None:
        """Ids of the roads from a place to a point, the shortest path ahead; None: no road leads there."""
        if start.road == end.road:
            return (start.road,)
        found = self._search(start, end, start.forward)
        return None if found is None else found[1]

    def _search(self, start: LanePlace, end: RoadPoint, forward: bool) -> tuple[float, tuple[str, ...]] | None:
        """Length and roads of the shortest path over roads (Dijkstra), leaving the first one in a direction of s."""
        first = self._roads[start.road]
        left_m = first.length_m - start.s_m if forward else start.s_m
        queue: list[tuple[float, tuple[str, ...], bool]] = [(left_m, (start.road,), forward)]
        seen: set[tuple[str, bool]] = set()
        while queue:
            length_m, roads, onward = heapq.heappop(queue)
            if roads[-1] == end.road and len(roads) > 1:
                return length_m, roads
            if (roads[-1], onward) in seen or length_m > _MAX_DISTANCE_M:
                continue
            seen.add((roads[-1], onward))
            for road_id, contact in self._neighbors(roads[-1], "end" if onward else "start"):
                inward, road = contact == "start", self._roads[road_id]
                into_m = end.s_m if inward else road.length_m - end.s_m
                extra_m = into_m if road_id == end.road else road.length_m
                heapq.heappush(queue, (length_m + extra_m, (*roads, road_id), inward))
        return None

    def _neighbors(self, road_id: str, contact: Contact) -> list[tuple[str, Contact]]:
        """Roads that follow at an end of a road, each with the end at which it is entered, by its driving lanes."""
        road, found = self._roads[road_id], dict[tuple[str, Contact], None]()
        for sections in (road.left, road.right):
            for section in sections[-1:] if contact == "end" else sections[:1]:
                for lane in section.lanes:
                    if lane.kind is LaneKind.DRIVING and road.drives_forward(lane) == (contact == "end"):
                        for key, at in self._links.touching(LaneKey(road_id, section.index, lane.id), contact):
                            found[key.road, at] = None
        return list(found)

    def _following(self, place: LanePlace, contact: Contact, route: Collection[str]) -> tuple[LaneKey, Contact] | None:
        """The lane that follows at an end of a road: on the route, else the straightest one."""
        road = self._roads[place.road]
        section = self._section(road, place.lane > 0, place.s_m)
        targets = self._links.touching(LaneKey(road.id, section.index, place.lane), contact)
        on_route = [each for each in targets if each[0].road in route]
        return min(on_route or targets, key=lambda each: self._turn_rad(road, contact, *each), default=None)

    def _turn_rad(self, road: Road, contact: Contact, key: LaneKey, entered: Contact) -> float:
        """By how much the direction changes over the whole following road."""
        following = self._roads[key.road]
        leaves_rad = float(road.plan(np.array([road.length_m if contact == "end" else 0.0]))[2][0])
        far_m = following.length_m if entered == "start" else 0.0
        far_rad = float(following.plan(np.array([far_m]))[2][0])
        turned = (contact == "end") != (entered == "start")
        return abs(wrapped(far_rad - leaves_rad + (math.pi if turned else 0.0)))

    def _lane_after(self, road: Road, place: LanePlace, s_m: float) -> int:
        """Id of a place's lane in the section at another s, by the links between the sections."""
        sections = road.left if place.lane > 0 else road.right
        first, last = (self._section(road, place.lane > 0, each).index for each in (place.s_m, s_m))
        lane, at = place.lane, first
        while at != last:
            onward = last > at
            current = next((each for each in sections if each.index == at), None)
            record = next((each for each in current.lanes if each.id == lane), None) if current else None
            linked = () if record is None else (record.successors if onward else record.predecessors)
            lane, at = (linked[0] if linked else lane), at + (1 if onward else -1)
        return lane

    def _step_s_m(self, road: Road, place: LanePlace, break_m: float, along_m: float) -> float:
        """Change of s for a distance along a line with constant offset, exact on lines and arcs up to a break of s."""
        t_m, low_m, high_m = self.point_of(place).t_m, *sorted((place.s_m, break_m))

        def scale(s_m: float) -> float:
            start_m = min(max(s_m - _CURVATURE_STEP_M, low_m), max(high_m - 2.0 * _CURVATURE_STEP_M, 0.0))
            headings_rad = road.plan(np.array([start_m, start_m + 2.0 * _CURVATURE_STEP_M]))[2]
            turn_rad = wrapped(float(headings_rad[1] - headings_rad[0]))
            return max(1.0 - t_m * turn_rad / (2.0 * _CURVATURE_STEP_M), 0.05)

        return along_m / scale(place.s_m + along_m / scale(place.s_m) / 2.0)

    @staticmethod
    def _section(road: Road, left: bool, s_m: float) -> Section:
        """The section of one side at a distance along a road."""
        sections = road.left if left else road.right
        return next((each for each in sections if s_m < each.end_m), sections[-1])

    def half_width_m(self, place: LanePlace) -> float:
        """Half the width of the lane at a place."""
        road = self._roads[place.road]
        section = self._section(road, place.lane > 0, place.s_m)
        edges_m = lane_edges_m(section, np.array([place.s_m]))[:, 0]
        position = next(index for index, each in enumerate(section.lanes) if each.id == place.lane)
        return float(edges_m[position + 1] - edges_m[position]) / 2.0

    @cached_property
    def _index(self) -> tuple[shapely.STRtree, list[str]]:
        """The sampled reference lines, searchable, and the roads that they belong to."""
        lines = [
            shapely.LineString(road.plan(np.linspace(0.0, road.length_m, 2 + int(road.length_m / _SAMPLE_M)))[0])
            for road in self._roads.values()
        ]
        return shapely.STRtree(lines), list(self._roads)

    @staticmethod
    def _project_s_m(road: Road, line: shapely.LineString, position_m: Float64Array) -> float:
        """S of the foot of a perpendicular from a position: on the sampled line, then refined (Newton)."""
        s_m = float(line.project(shapely.Point(position_m[:2]), normalized=True)) * road.length_m
        for _ in range(4):
            xy_m, _, heading_rad = road.plan(np.array([s_m]))
            ahead = np.array([math.cos(heading_rad[0]), math.sin(heading_rad[0])])
            s_m = min(max(s_m + float(ahead @ (position_m[:2] - xy_m[0])), 0.0), road.length_m)
        return s_m


def _next_break_m(road: Road, s_m: float, direction: float) -> float:
    """The next distance along a road, in a direction, at which a piece of its reference line, or the road, ends."""
    starts_m = road.plan.starts_m[(road.plan.starts_m > 0.0) & (road.plan.starts_m < road.length_m)]
    beyond_m = starts_m[(starts_m - s_m) * direction > 1e-9]
    end_m = road.length_m if direction > 0.0 else 0.0
    return end_m if not len(beyond_m) else float(beyond_m.min() if direction > 0.0 else beyond_m.max())
