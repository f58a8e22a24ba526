"""A route on the lanes of a map, as the finders of places for events read it."""

from collections.abc import Iterator, Mapping
from functools import cached_property
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
import shapely

from simbev_ros.foundation.types import BoolArray, Float64Array
from simbev_ros.maps.network import Lane, RoadNetwork
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.schema.scene.drive_spec import RouteSpec
from simbev_ros.schema.scene.spec import WaypointSpec


class Place(NamedTuple):
    """A place for one event.

    Attributes:
        at_m: Distance along the route.
        start: Where its vehicle starts; None: it has none in traffic.
        via: Edges that this vehicle passes.
        measures: Geometry that the event needs, by parameter name.
        stand: Center of a vehicle beside the lane: x, y, z and yaw; None: there is none.
        walk: Where its pedestrian starts; None: it has none.
    """

    at_m: float
    start: WaypointSpec | None = None
    via: tuple[str, ...] = ()
    measures: Mapping[str, float] = MappingProxyType({})
    stand: tuple[float, float, float, float] | None = None
    walk: WaypointSpec | None = None


class RouteLine:
    """A route with its headings and lanes.

    Attributes:
        spec: The route.
        network: The roads of its map.
        station_m: (N,) distances of its points along it.
        point_m: (N, 3) its points, map frame.
        yaw_rad: (N,) its headings, without jumps.
    """

    def __init__(self, spec: RouteSpec, network: RoadNetwork) -> None:
        self.spec, self.network = spec, network
        self.station_m, self.point_m = np.array(spec.distance_m), spec.points_m
        step_m = np.diff(self.point_m[:, :2], axis=0, append=2.0 * self.point_m[-1:, :2] - self.point_m[-2:-1, :2])
        self.yaw_rad: Float64Array = np.unwrap(np.arctan2(step_m[:, 1], step_m[:, 0]))

    @property
    def length_m(self) -> float:
        """Its length."""
        return float(self.station_m[-1])

    @cached_property
    def in_junction(self) -> BoolArray:
        """(N,) whether each point is in a junction."""
        return np.array([bool(self.network.lanes[name].junction) for name in self.spec.lane])

    def row_at(self, at_m: float) -> int:
        """Index of the last point up to a distance."""
        return int(np.clip(np.searchsorted(self.station_m, at_m, side="right") - 1, 0, len(self.station_m) - 1))

    def lane_at(self, at_m: float) -> Lane:
        """The lane at a distance."""
        return self.network.lanes[self.spec.lane[self.row_at(at_m)]]

    def waypoint(self, at_m: float, lane: Lane | None = None) -> WaypointSpec:
        """The position on the route's lane, or abreast of it on another lane."""
        lane = self.lane_at(at_m) if lane is None else lane
        line = shapely.LineString(lane.centerline_m[:, :2])
        return WaypointSpec(lane=lane.id, s_m=float(line.project(shapely.Point(self.point_m[self.row_at(at_m), :2]))))

    def turn_rad(self, from_m: float, to_m: float) -> float:
        """Greatest change of heading between two distances."""
        return float(np.ptp(self.yaw_rad[self.row_at(from_m) : self.row_at(to_m) + 1]))

    def is_open(self, from_m: float, to_m: float) -> bool:
        """Whether the route stays on one edge outside junctions between two distances, and has both."""
        rows = slice(self.row_at(from_m), self.row_at(to_m) + 1)
        one = len({self.network.lanes[name].edge for name in self.spec.lane[rows]}) == 1
        return from_m >= 0.0 and to_m <= self.length_m and one and not self.in_junction[rows].any()

    def edges_after(self, at_m: float) -> tuple[str, ...]:
        """Edges of the route outside junctions after that at a distance."""
        edges = [self.network.lanes[name].edge for name in self.spec.lane[self.row_at(at_m) :]]
        outside = [edge for edge in dict.fromkeys(edges) if not edge.startswith(":")]
        return tuple(edge for edge in outside if edge != self.lane_at(at_m).edge)

    def beside(self, lane: Lane) -> Iterator[Lane]:
        """The driving lanes of the same direction next to a lane."""
        for other in self.network.lanes_of_edge(lane.edge):
            is_open = other.kind is LaneKind.DRIVING and "passenger" in other.classes
            if is_open and abs(other.index - lane.index) == 1:
                yield other
