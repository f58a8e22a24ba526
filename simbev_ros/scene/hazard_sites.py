"""Where on a map a hazard area finds room: on a street whose lanes do not all have to be closed for it."""

from collections import defaultdict
from typing import NamedTuple

import numpy as np

from simbev_ros.maps.network import Lane, RoadNetwork
from simbev_ros.maps.roads.lane_kind import WALKABLE_KINDS, LaneKind
from simbev_ros.scene.hazard_area import HazardArea, Place
from simbev_ros.types import Float64Array

SHORTEST_M = 24.0
"""Of an area between its tapers: room for an emergency vehicle and two cars."""

_ENTRY_M, _ENTRY_S = 15.0, 1.5  # from the lane's start at least, to get off the closed lanes; and time at the limit
_EXIT_M = 30.0  # to the lane's end, to get where one wants to turn
_CORNER_M = 8.0  # from both ends of a shoulder or parking lane
_END_TAPER_M = 6.0
_LONGEST_TAPER_M = 80.0
_BESIDE = (LaneKind.SHOULDER, LaneKind.PARKING)
_SHOULDER_M = 2.1  # so wide they hold cars
_ROADSIDE_M = 0.5  # from the road's edge to the middle of a sign
_BESIDE_LANE_M = 0.3  # so far at least it is from lanes of other roads
_SHOULDER_TAPER = 1.0 / 3.0  # over that of a driving lane (MUTCD 2009, table 6C-3)
_USUAL = "passenger"
_KMH_PER_MPS = 3.6


class Site(NamedTuple):
    """Lanes of one edge that a hazard closes.

    Attributes:
        closed: From the road's edge, or the median, inwards; one shoulder or parking lane, or driving lanes.
        side: 1 if the lanes that stay open are on the left, -1 if on the right.
        from_s_m: Where the area may begin on the first of the lanes at the earliest, and ...
        to_s_m: ... where it ends at the latest.
        taper_m: Length over which the lanes are closed little by little.
    """

    closed: tuple[Lane, ...]
    side: int
    from_s_m: float
    to_s_m: float
    taper_m: float

    @property
    def room_m(self) -> float:
        """Length for the area between its tapers."""
        return self.to_s_m - self.from_s_m - self.taper_m - _END_TAPER_M

    def area(self, center_s_m: float, length_m: float) -> HazardArea:
        """The area with its middle as near as the lane allows to a distance from the lane's start.

        Args:
            center_s_m: Along the first of the closed lanes.
            length_m: Between the tapers, at most ``room_m``.
        """
        whole_m = self.taper_m + length_m + _END_TAPER_M
        wanted_m = center_s_m - self.taper_m - length_m / 2.0
        from_s_m = min(max(wanted_m, self.from_s_m), self.to_s_m - whole_m)
        return HazardArea(self.closed, self.side, from_s_m, self.taper_m, length_m, _END_TAPER_M)


class HazardSites:
    """The sites of a map."""

    def __init__(self, network: RoadNetwork, taper_factor: float) -> None:
        """Their tapers are ``taper_factor`` times as long as the MUTCD's."""
        self._network = network
        self._taper_factor = taper_factor
        self._edges: dict[str, list[Lane]] = defaultdict(list)
        self._before: dict[str, list[Lane]] = defaultdict(list)
        for lane in network.lanes.values():
            if lane.kind not in WALKABLE_KINDS:
                self._edges[lane.edge].append(lane)
                for successor in lane.successors:
                    self._before[successor].append(lane)
        for lanes in self._edges.values():
            lanes.sort(key=lambda lane: lane.index)

    def at(self, lane: Lane) -> Site | None:
        """The site that a hazard on a driving lane takes; None: there is no room.

        The driving lanes between it and the nearer side of the road are closed; of a single one only its shoulder.
        """
        driving = [each for each in self._edges[lane.edge] if each.kind is LaneKind.DRIVING and _USUAL in each.classes]
        if lane.junction or lane not in driving:
            return None
        closed = self._closed(lane, driving)
        if not closed:
            return None
        open_lane = next(each for each in driving if each not in closed)
        taper_m = self._taper_m(lane.speed_mps, sum(each.width_m for each in closed))
        from_s_m, exit_m = max(_ENTRY_M, _ENTRY_S * lane.speed_mps), _EXIT_M
        if closed[0].kind is not LaneKind.DRIVING:
            taper_m, from_s_m, exit_m = _SHOULDER_TAPER * taper_m, _CORNER_M, _CORNER_M
        site = Site(closed, _side_of(open_lane, closed[0]), from_s_m, closed[0].length_m - exit_m, taper_m)
        return site if site.room_m >= SHORTEST_M else None

    def _closed(self, lane: Lane, driving: list[Lane]) -> tuple[Lane, ...]:
        """Which lanes are closed, the outermost first, for a hazard on one of the driving lanes of an edge."""
        place = driving.index(lane)
        if len(driving) == 1:
            beside = [each for each in self._edges[lane.edge] if each.kind in _BESIDE and each.index < lane.index]
            return tuple(each for each in beside[-1:] if each.width_m >= _SHOULDER_M)
        if 2 * place < len(driving) - 1:
            return tuple(driving[: place + 1])
        return tuple(reversed(driving[max(place, 1) :]))

    def _taper_m(self, speed_mps: float, width_m: float) -> float:
        """Length of a merging taper (MUTCD 2009, tables 6C-3 and 6C-4), scaled, and no longer than streets bear."""
        speed_kmh = speed_mps * _KMH_PER_MPS
        length_m = width_m * (speed_kmh**2 / 155.0 if speed_kmh <= 60.0 else speed_kmh / 1.6)
        return min(self._taper_factor * length_m, _LONGEST_TAPER_M)

    def roadside(self, area: HazardArea, distance_m: float) -> Place | None:
        """The road's edge at a distance ahead of an area, on the straightest way to it; None: there is no such place.

        It is where traffic keeps to, and never inside of a junction.
        """
        lanes = self._edges[area.closed[0].edge]
        lane, hand = next(each for each in lanes if each.kind is LaneKind.DRIVING), _side_of(lanes[-1], lanes[0])
        s_m = area.from_s_m - distance_m
        while s_m < 0.0:
            before = self._before[lane.id]
            if not before:
                return None
            heading = _start_heading(lane)
            lane = min(before, key=lambda each: (-float(_start_heading(each) @ heading), each.id))
            s_m += lane.length_m
        if lane.junction:
            return None
        outer = self._edges[lane.edge]
        middle_m = sum(each.width_m for each in outer[: outer.index(lane)]) + lane.width_m / 2.0 + _ROADSIDE_M
        position_m, yaw_rad = self._network.pose_on_lane(lane.id, s_m)
        aside = np.array([-np.sin(yaw_rad), np.cos(yaw_rad), 0.0])
        place_m = position_m - hand * middle_m * aside
        nearest = self._network.nearest_lane(place_m[None])
        gap_m = float(np.linalg.norm(nearest.position_m[0, :2] - place_m[:2]))
        on_lane = gap_m < self._network.lanes[nearest.lane[0]].width_m / 2.0 + _BESIDE_LANE_M
        return None if on_lane else Place(place_m, yaw_rad)


def _start_heading(lane: Lane) -> Float64Array:
    """(2,) unit vector in which a lane begins."""
    way_m = lane.centerline_m[1, :2] - lane.centerline_m[0, :2]
    heading: Float64Array = way_m / max(float(np.linalg.norm(way_m)), 1e-9)
    return heading


def _side_of(other: Lane, lane: Lane) -> int:
    """1 if another lane of the edge is on the left of a lane, else -1."""
    heading = _start_heading(lane)
    gap_m = other.centerline_m[0, :2] - lane.centerline_m[0, :2]
    return 1 if heading[0] * gap_m[1] - heading[1] * gap_m[0] > 0.0 else -1
