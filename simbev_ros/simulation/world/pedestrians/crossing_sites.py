"""Sites where pedestrians may cross a street without a crosswalk: straight from one sidewalk to the opposite one."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.geometry.plan_view import left_of
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.network import Lane, RoadNetwork
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.polylines import Polylines
from simbev_ros.maps.roads.surface import FAST_MPS
from simbev_ros.schema.scene.hazard import HazardSpec

_CROSSED_KINDS = (LaneKind.DRIVING, LaneKind.BICYCLE, LaneKind.PARKING, LaneKind.SHOULDER)
_MAX_LENGTH_M = 26.0
_END_MARGIN_M = 12.0  # closer to a sidewalk's end there is a junction or a crosswalk
_MAX_LANE_GAP_M = 0.6  # maximum gap between neighboring lanes; wider gaps contain something that cannot be walked over
_LEVEL_TOLERANCE_M = 1.0  # lanes with a larger height difference are on other levels
_MIN_HAZARD_DISTANCE_M = 4.0
_MIN_CROSSING_SINE = 0.97  # minimum sine of the angle between a lane and the path that crosses it


@dataclass(frozen=True, slots=True)
class CrossedCarriageway:
    """The lanes of one edge that a crossing path crosses.

    Attributes:
        edge: SUMO's id.
        position_m: SUMO's position on the edge where pedestrians cross it.
        cleared_m: Distance along the path at which the last of the lanes is behind the pedestrian.
    """

    edge: str
    position_m: float
    cleared_m: float


@dataclass(frozen=True, slots=True)
class CrossingSite:
    """A straight path from the center line of a sidewalk to that of another.

    Attributes:
        ends_m: (2, 3) map frame, on the carriageway's plane.
        along: (2,) unit vector along the sidewalk at the start of the path.
        position_m: SUMO's position on the sidewalk where the path starts.
        end_edge: Edge of the sidewalk where the path ends.
        end_position_m: SUMO's position on that sidewalk.
        curbs_m: Distances along the path to the two curbs.
        carriageways: The carriageways that are crossed.
    """

    ends_m: Float64Array
    along: Float64Array
    position_m: float
    end_edge: str
    end_position_m: float
    curbs_m: tuple[float, float]
    carriageways: tuple[CrossedCarriageway, ...]

    @property
    def start_m(self) -> Float64Array:
        """(3,) start of the path."""
        return self.ends_m[0]

    @property
    def length_m(self) -> float:
        """Length from center line to center line, in plan."""
        return float(np.linalg.norm(self.ends_m[1, :2] - self.ends_m[0, :2]))


class CrossingSites:
    """Crossing sites on the streets of a network."""

    def __init__(self, network: RoadNetwork, hazards: Sequence[HazardSpec] = ()) -> None:
        """For a network, away from its hazard areas."""
        self._network = network
        self._lanes = tuple(network.lanes.values())
        self._sidewalks = {lane.edge: lane for lane in network.lanes_of(LaneKind.SIDEWALK)}
        lines = Polylines.from_lines([lane.centerline_m for lane in self._lanes])
        self._shapes = np.asarray(shapely.linestrings(lines.points_m[:, :2], indices=lines.row), object)
        self._tree = shapely.STRtree(self._shapes)
        self._hazard_areas = overlay.union_all([shapely.Polygon(hazard.outline_m) for hazard in hazards])

    def stations_m(self, edge: str) -> tuple[float, float]:
        """Range of distances along an edge's sidewalk where crossing is allowed; empty if the second is smaller."""
        return _END_MARGIN_M, self.length_m(edge) - _END_MARGIN_M

    def length_m(self, edge: str) -> float:
        """Length of an edge's sidewalk; 0 if there is none."""
        return self._sidewalks[edge].length_m if edge in self._sidewalks else 0.0

    def site_at(self, edge: str, s_m: float) -> CrossingSite | None:
        """The crossing site at a distance along an edge's sidewalk; None if crossing is not possible there."""
        lane = self._sidewalks[edge]
        start_m, yaw_rad = self._network.pose_on_lane(lane.id, s_m)
        along = np.array([np.cos(yaw_rad), np.sin(yaw_rad)])
        for left in (1.0, -1.0):
            across = left * left_of(along)
            site = self._site_across(lane, s_m, start_m, along, across)
            if site is not None:
                return site
        return None

    def _site_across(
        self, lane: Lane, s_m: float, start_m: Float64Array, along: Float64Array, across: Float64Array
    ) -> CrossingSite | None:
        """The crossing site in one direction, a (2,) unit vector."""
        crossed: list[CrossedCarriageway] = []
        near_curb_m = crossed_m = lane.width_m / 2.0
        for lane_met, station_m, distance_m, height_m in self._lanes_met(lane, start_m, across):
            half_m, position_m = lane_met.width_m / 2.0, station_m * lane_met.sumo_s_per_m
            if lane_met.junction or lane_met.speed_mps > FAST_MPS or distance_m - half_m > crossed_m + _MAX_LANE_GAP_M:
                return None
            if lane_met.kind is LaneKind.SIDEWALK and crossed:
                if lane_met.edge == lane.edge or min(station_m, lane_met.length_m - station_m) < _END_MARGIN_M:
                    return None
                end_m = np.append(start_m[:2] + distance_m * across, height_m)
                curbs_m = near_curb_m, distance_m - half_m
                ends_m, start_position_m = np.stack([start_m, end_m]), s_m * lane.sumo_s_per_m
                return CrossingSite(ends_m, along, start_position_m, lane_met.edge, position_m, curbs_m, tuple(crossed))
            if lane_met.kind not in _CROSSED_KINDS:
                return None
            crossed = _add_lane(crossed, lane_met.edge, position_m, distance_m + half_m)
            crossed_m = max(crossed_m, distance_m + half_m)
        return None

    def _lanes_met(
        self, lane: Lane, start_m: Float64Array, across: Float64Array
    ) -> Iterator[tuple[Lane, float, float, float]]:
        """Yield the lanes that a path meets, with distances along each lane and along the path, and heights.

        Ascends along the path. Skips the lane where the path starts and lanes on other levels; ends at a lane that is
        met at a slant.
        """
        path = shapely.LineString([start_m[:2], start_m[:2] + _MAX_LENGTH_M * across])
        if shapely.dwithin(path, self._hazard_areas, _MIN_HAZARD_DISTANCE_M):
            return
        rows = np.sort(self._tree.query(path, predicate="intersects"))
        rows = rows[[self._lanes[row] is not lane for row in rows]]
        points = shapely.point_on_surface(overlay.intersection(self._shapes[rows], path))
        station_m = shapely.line_locate_point(self._shapes[rows], points)
        distance_m = (shapely.get_coordinates(points) - start_m[:2]) @ across
        lines = Polylines.from_lines([self._lanes[row].centerline_m for row in rows])
        parameter = lines.parameter(np.arange(len(rows)), station_m)
        height_m, heading = lines.values(parameter)[:, 2], lines.headings(parameter)
        sine = np.abs(heading[:, 0] * across[1] - heading[:, 1] * across[0])
        for index in np.argsort(distance_m, kind="stable").tolist():
            if abs(height_m[index] - start_m[2]) > _LEVEL_TOLERANCE_M:
                continue
            if sine[index] < _MIN_CROSSING_SINE:
                return
            yield self._lanes[rows[index]], float(station_m[index]), float(distance_m[index]), float(height_m[index])


def _add_lane(
    crossed: list[CrossedCarriageway], edge: str, position_m: float, cleared_m: float
) -> list[CrossedCarriageway]:
    """The carriageways with one more lane."""
    if crossed and crossed[-1].edge == edge:
        last = crossed[-1]
        return [
            *crossed[:-1],
            CrossedCarriageway(edge, min(position_m, last.position_m), max(cleared_m, last.cleared_m)),
        ]
    return [*crossed, CrossedCarriageway(edge, position_m, cleared_m)]
