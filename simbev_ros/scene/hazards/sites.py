"""Where on a map a hazard area finds room: on some of a street's lanes, or, where there is but one, on all of it."""

from typing import NamedTuple

from simbev_ros.maps.network import Lane, RoadNetwork
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.scene.hazards.area import HazardArea
from simbev_ros.scene.hazards.roadside import Roadside, side_of

SHORTEST_M = 24.0
"""Of an area between its tapers: room for an emergency vehicle and two cars."""

_ENTRY_M, _ENTRY_S = 15.0, 1.5  # from the lane's start at least, to get off the closed lanes; and time at the limit
_EXIT_M = 30.0  # to the lane's end, to get where one wants to turn
_CORNER_M = 8.0  # from both ends of a shoulder or parking lane
_END_TAPER_M = 6.0
_LONGEST_TAPER_M = 80.0
_BESIDE = (LaneKind.SHOULDER, LaneKind.PARKING)
_SHOULDER_M = 2.6  # so wide they hold cars behind guards
_SHOULDER_TAPER = 1.0 / 3.0  # over that of a driving lane (MUTCD 2003, table 6C-3)
_SLOW_KMH = 65.0  # formulas are given up to 60 km/h (40 mph), and from 70 km/h (45 mph)
_LEAST_ROAD_M = 2.9  # a narrower one-lane road is too narrow for vehicles behind guards
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
        closes_road: Nobody can pass.
    """

    closed: tuple[Lane, ...]
    side: int
    from_s_m: float
    to_s_m: float
    taper_m: float
    closes_road: bool = False

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
        self._taper_factor = taper_factor
        self.roadside = Roadside(network)

    def at(self, lane: Lane) -> Site | None:
        """The site that a hazard on a driving lane takes; None: there is no room.

        The driving lanes between it and the nearer side of the road are closed, but no more than stay open; where there
        is but one, its shoulder or, without a wide one, the whole road.
        """
        lanes = self.roadside.edges[lane.edge]
        driving = [each for each in lanes if each.kind is LaneKind.DRIVING and _USUAL in each.classes]
        if lane.junction or lane not in driving:
            return None
        closed = self._closed(lane, driving)
        if closed[0].kind is not LaneKind.DRIVING:
            taper_m = _SHOULDER_TAPER * self._taper_m(lane.speed_mps, closed[0].width_m)
            site = Site(closed, side_of(lane, closed[0]), _CORNER_M, closed[0].length_m - _CORNER_M, taper_m)
        elif len(closed) == len(driving):
            site = Site(closed, self.roadside.hand, _CORNER_M, lane.length_m - _CORNER_M, _END_TAPER_M, True)
        else:
            taper_m = self._taper_m(lane.speed_mps, sum(each.width_m for each in closed))
            side = side_of(next(each for each in driving if each not in closed), closed[0])
            from_s_m = max(_ENTRY_M, _ENTRY_S * lane.speed_mps)
            site = Site(closed, side, from_s_m, closed[0].length_m - _EXIT_M, taper_m)
        too_narrow = site.closes_road and lane.width_m < _LEAST_ROAD_M
        return None if too_narrow or site.room_m < SHORTEST_M else site

    def _closed(self, lane: Lane, driving: list[Lane]) -> tuple[Lane, ...]:
        """Which lanes are closed, the outermost first, for a hazard on one of the driving lanes of an edge."""
        place = driving.index(lane)
        if len(driving) == 1:
            beside = [each for each in self.roadside.edges[lane.edge] if each.index < lane.index][-1:]
            return tuple(each for each in beside if each.kind in _BESIDE and each.width_m >= _SHOULDER_M) or (lane,)
        most = len(driving) // 2
        if 2 * place < len(driving) - 1:
            return tuple(driving[: min(place + 1, most)])
        return tuple(reversed(driving[max(place, len(driving) - most) :]))

    def _taper_m(self, speed_mps: float, width_m: float) -> float:
        """Length of a merging taper (MUTCD 2003, tables 6C-3 and 6C-4: metric), scaled, no longer than streets bear.

        The MUTCD of 2009 has the same formulas in feet and miles per hour, W S² / 60 and W S.
        """
        speed_kmh = speed_mps * _KMH_PER_MPS
        length_m = width_m * (speed_kmh**2 / 155.0 if speed_kmh < _SLOW_KMH else speed_kmh / 1.6)
        return min(self._taper_factor * length_m, _LONGEST_TAPER_M)
