"""Where people may cross a street without a crosswalk: straight over, from one sidewalk to that on the other side."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from simbev_ros.maps.network import Lane, RoadNetwork
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.polylines import Polylines
from simbev_ros.maps.roads.surface import FAST_MPS
from simbev_ros.scene.hazards.hazard import HazardSpec
from simbev_ros.types import Float64Array

_CROSSED_KINDS = (LaneKind.DRIVING, LaneKind.BICYCLE, LaneKind.PARKING, LaneKind.SHOULDER)
_LONGEST_M = 26.0
_FROM_ENDS_M = 12.0  # nearer to a sidewalk's end there is a junction or a crosswalk
_GAP_M = 0.6  # between neighbouring lanes; wider ones hold something that cannot be walked over
_LEVEL_M = 1.0  # lanes that differ more in height are on other levels
_FROM_HAZARDS_M = 4.0
_SQUARE = 0.97  # sine of the angle at which lanes are crossed


@dataclass(frozen=True, slots=True)
class Carriageway:
    """The lanes of one edge on the way across.

    Attributes:
        edge: SUMO's id.
        position_m: SUMO's position on the edge at which people cross it.
        until_m: Distance along the way at which the last of the lanes is behind.
    """

    edge: str
    position_m: float
    until_m: float


@dataclass(frozen=True, slots=True)
class CrossingPlace:
    """A straight way from the middle of a sidewalk to the middle of another.

    Attributes:
        ends_m: (2, 3) map frame, on the carriageway's plane.
        along: (2,) unit vector along the sidewalk where the way begins.
        position_m: SUMO's position on the sidewalk where the way begins.
        far_edge: Edge of the sidewalk where it ends.
        far_position_m: SUMO's position on that.
        kerbs_m: Distances along the way to the two kerbs.
        carriageways: What is crossed.
    """

    ends_m: Float64Array
    along: Float64Array
    position_m: float
    far_edge: str
    far_position_m: float
    kerbs_m: tuple[float, float]
    carriageways: tuple[Carriageway, ...]

    @property
    def start_m(self) -> Float64Array:
        """(3,) where the way begins."""
        start_m: Float64Array = self.ends_m[0]
        return start_m

    @property
    def length_m(self) -> float:
        """From one middle to the other, in plan."""
        return float(np.linalg.norm(self.ends_m[1, :2] - self.ends_m[0, :2]))


class CrossingPlaces:
    """Ways across the streets of a network."""

    def __init__(self, network: RoadNetwork, hazards: Sequence[HazardSpec] = ()) -> None:
        """Of a network, away from the hazard areas on it."""
        self._network = network
        self._lanes = tuple(network.lanes.values())
        self._sidewalk = {lane.edge: lane for lane in network.lanes_of(LaneKind.SIDEWALK)}
        lines = Polylines.of([lane.centerline_m for lane in self._lanes])
        self._shapes = np.asarray(shapely.linestrings(lines.points_m[:, :2], indices=lines.row), object)
        self._tree = shapely.STRtree(self._shapes)
        self._closed = shapely.union_all([shapely.Polygon(hazard.outline_m) for hazard in hazards])

    def stations_m(self, edge: str) -> tuple[float, float]:
        """Between which distances along an edge's sidewalk one may cross; empty where the second is the smaller."""
        return _FROM_ENDS_M, self.length_m(edge) - _FROM_ENDS_M

    def length_m(self, edge: str) -> float:
        """Length of an edge's sidewalk; 0 where there is none."""
        return self._sidewalk[edge].length_m if edge in self._sidewalk else 0.0

    def place(self, edge: str, s_m: float) -> CrossingPlace | None:
        """The way across at a distance along an edge's sidewalk; None where there is none, or none that is fit."""
        lane = self._sidewalk[edge]
        start_m, yaw_rad = self._network.pose_on_lane(lane.id, s_m)
        along = np.array([np.cos(yaw_rad), np.sin(yaw_rad)])
        for left in (1.0, -1.0):
            across = left * np.array([-along[1], along[0]])
            place = self._across(lane, s_m, start_m, along, across)
            if place is not None:
                return place
        return None

    def _across(
        self, lane: Lane, s_m: float, start_m: Float64Array, along: Float64Array, across: Float64Array
    ) -> CrossingPlace | None:
        """The way across in one direction, a (2,) unit vector."""
        crossed: list[Carriageway] = []
        near_kerb_m = reached_m = lane.width_m / 2.0
        for met, station_m, way_m, height_m in self._met(lane, start_m, across):
            half_m, position_m = met.width_m / 2.0, station_m * met.sumo_s_per_m
            if met.junction or met.speed_mps > FAST_MPS or way_m - half_m > reached_m + _GAP_M:
                return None
            if met.kind is LaneKind.SIDEWALK and crossed:
                if met.edge == lane.edge or min(station_m, met.length_m - station_m) < _FROM_ENDS_M:
                    return None
                end_m = np.append(start_m[:2] + way_m * across, height_m)
                kerbs_m = near_kerb_m, way_m - half_m
                ends_m, start_position_m = np.stack([start_m, end_m]), s_m * lane.sumo_s_per_m
                return CrossingPlace(ends_m, along, start_position_m, met.edge, position_m, kerbs_m, tuple(crossed))
            if met.kind not in _CROSSED_KINDS:
                return None
            crossed = _with(crossed, met.edge, position_m, way_m + half_m)
            reached_m = max(reached_m, way_m + half_m)
        return None

    def _met(
        self, lane: Lane, start_m: Float64Array, across: Float64Array
    ) -> Iterator[tuple[Lane, float, float, float]]:
        """The lanes that a way meets, with distances along each and along the way, by which they ascend, and heights.

        Those on other levels, and the one that it starts from, are left out; one met at a slant ends it.
        """
        way = shapely.LineString([start_m[:2], start_m[:2] + _LONGEST_M * across])
        if shapely.dwithin(way, self._closed, _FROM_HAZARDS_M):
            return
        rows = np.sort(self._tree.query(way, predicate="intersects"))
        rows = rows[[self._lanes[row] is not lane for row in rows]]
        points = shapely.point_on_surface(shapely.intersection(self._shapes[rows], way))
        station_m = shapely.line_locate_point(self._shapes[rows], points)
        way_m = (shapely.get_coordinates(points) - start_m[:2]) @ across
        lines = Polylines.of([self._lanes[row].centerline_m for row in rows])
        parameter = lines.parameter(np.arange(len(rows)), station_m)
        height_m, heading = lines.values(parameter)[:, 2], lines.headings(parameter)
        sine = np.abs(heading[:, 0] * across[1] - heading[:, 1] * across[0])
        for index in np.argsort(way_m, kind="stable").tolist():
            if abs(height_m[index] - start_m[2]) > _LEVEL_M:
                continue
            if sine[index] < _SQUARE:
                return
            yield self._lanes[rows[index]], float(station_m[index]), float(way_m[index]), float(height_m[index])


def _with(crossed: list[Carriageway], edge: str, position_m: float, until_m: float) -> list[Carriageway]:
    """The carriageways with one more lane."""
    if crossed and crossed[-1].edge == edge:
        last = crossed[-1]
        return [*crossed[:-1], Carriageway(edge, min(position_m, last.position_m), max(until_m, last.until_m))]
    return [*crossed, Carriageway(edge, position_m, until_m)]
