"""Sites where a hazard area fits on a map: on some lanes of a street or, if there is only one lane, on all of it."""

from typing import NamedTuple

from simbev_ros.maps.network import Lane, RoadNetwork
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.scene.hazards.area import HazardArea
from simbev_ros.scene.hazards.roadside import Roadside, side_of

MIN_LENGTH_M = 24.0
"""Minimum length of an area between its tapers: room for an emergency vehicle and two cars."""

_ENTRY_M, _ENTRY_S = (
    15.0,
    1.5,
)  # minimum distance from the lane's start, and time at the speed limit, to leave the closed lanes
_EXIT_M = 30.0  # distance to the lane's end, to reach the lane for the next turn
_END_MARGIN_M = 8.0  # from both ends of a shoulder or parking lane
_END_TAPER_M = 6.0
_MAX_TAPER_M = 80.0
_SIDE_KINDS = (LaneKind.SHOULDER, LaneKind.PARKING)
_MIN_SHOULDER_M = 2.6  # a shoulder or parking lane of this width holds cars behind guards
_SHOULDER_TAPER = 1.0 / 3.0  # length of a shoulder taper relative to a driving lane's (MUTCD 2003, table 6C-3)
_SLOW_FORMULA_KMH = 65.0  # between the two formulas' ranges: up to 60 km/h (40 mph), and from 70 km/h (45 mph)
_MIN_ROAD_M = 2.9  # a narrower one-lane road has no room for vehicles behind guards
_SUMO_CLASS = "passenger"
_KMH_PER_MPS = 3.6


class HazardSite(NamedTuple):
    """Lanes of one edge that a hazard closes.

    Attributes:
        closed: Lanes from the road's edge, or from the median, inwards: one shoulder or parking lane, or driving lanes.
        side: 1 if the lanes that stay open are on the left, -1 if on the right.
        from_s_m: Earliest start of the area on the first of the lanes.
        to_s_m: Latest end of the area on it.
        taper_m: Length over which the lanes are closed gradually.
        closes_road: Whether no lane stays open.
    """

    closed: tuple[Lane, ...]
    side: int
    from_s_m: float
    to_s_m: float
    taper_m: float
    closes_road: bool = False

    @property
    def room_m(self) -> float:
        """Maximum length of the area between its tapers."""
        return self.to_s_m - self.from_s_m - self.taper_m - _END_TAPER_M

    def area_around(self, center_s_m: float, length_m: float) -> HazardArea:
        """The area centered as near as the lane allows to a distance from the lane's start.

        Args:
            center_s_m: Position along the first of the closed lanes.
            length_m: Length between the tapers, at most ``room_m``.
        """
        total_m = self.taper_m + length_m + _END_TAPER_M
        preferred_m = center_s_m - self.taper_m - length_m / 2.0
        from_s_m = min(max(preferred_m, self.from_s_m), self.to_s_m - total_m)
        return HazardArea(self.closed, self.side, from_s_m, self.taper_m, length_m, _END_TAPER_M)


class HazardSites:
    """The hazard sites of a map."""

    def __init__(self, network: RoadNetwork, taper_factor: float) -> None:
        """Tapers are ``taper_factor`` times as long as in the MUTCD."""
        self._taper_factor = taper_factor
        self.roadside = Roadside(network)

    def site_at(self, lane: Lane) -> HazardSite | None:
        """The site of a hazard on a driving lane; None if there is no room.

        The driving lanes between it and the nearer side of the road are closed, but never more than stay open. If there
        is only one driving lane, its shoulder is closed or, without a wide one, the whole road.
        """
        lanes = self.roadside.edges[lane.edge]
        driving = [each for each in lanes if each.kind is LaneKind.DRIVING and _SUMO_CLASS in each.classes]
        if lane.junction or lane not in driving:
            return None
        closed = self._closed(lane, driving)
        if closed[0].kind is not LaneKind.DRIVING:
            taper_m = _SHOULDER_TAPER * self._taper_m(lane.speed_mps, closed[0].width_m)
            site = HazardSite(
                closed, side_of(lane, closed[0]), _END_MARGIN_M, closed[0].length_m - _END_MARGIN_M, taper_m
            )
        elif len(closed) == len(driving):
            site = HazardSite(
                closed, self.roadside.hand, _END_MARGIN_M, lane.length_m - _END_MARGIN_M, _END_TAPER_M, True
            )
        else:
            taper_m = self._taper_m(lane.speed_mps, sum(each.width_m for each in closed))
            side = side_of(next(each for each in driving if each not in closed), closed[0])
            from_s_m = max(_ENTRY_M, _ENTRY_S * lane.speed_mps)
            site = HazardSite(closed, side, from_s_m, closed[0].length_m - _EXIT_M, taper_m)
        too_narrow = site.closes_road and lane.width_m < _MIN_ROAD_M
        return None if too_narrow or site.room_m < MIN_LENGTH_M else site

    def _closed(self, lane: Lane, driving: list[Lane]) -> tuple[Lane, ...]:
        """The lanes to close, outermost first, for a hazard on one of an edge's driving lanes."""
        index = driving.index(lane)
        if len(driving) == 1:
            side_lanes = [each for each in self.roadside.edges[lane.edge] if each.index < lane.index][-1:]
            return tuple(
                each for each in side_lanes if each.kind in _SIDE_KINDS and each.width_m >= _MIN_SHOULDER_M
            ) or (lane,)
        max_closed = len(driving) // 2
        if 2 * index < len(driving) - 1:
            return tuple(driving[: min(index + 1, max_closed)])
        return tuple(reversed(driving[max(index, len(driving) - max_closed) :]))

    def _taper_m(self, speed_mps: float, width_m: float) -> float:
        """Length of a merging taper (MUTCD 2003, tables 6C-3 and 6C-4, metric), scaled and limited to 80 m.

        The MUTCD of 2009 has the same formulas in feet and miles per hour, W S² / 60 and W S.
        """
        speed_kmh = speed_mps * _KMH_PER_MPS
        length_m = width_m * (speed_kmh**2 / 155.0 if speed_kmh < _SLOW_FORMULA_KMH else speed_kmh / 1.6)
        return min(self._taper_factor * length_m, _MAX_TAPER_M)
