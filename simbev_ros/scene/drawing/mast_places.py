"""Ground on which the masts of roadside units can stand on a map: at junctions, above lanes, and at given poses."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.types import AnyArray, BoolArray, Float64Array, Int64Array
from simbev_ros.maps.land.terrain import Terrain
from simbev_ros.maps.network import Lane, RoadNetwork
from simbev_ros.maps.roads.lane_kind import ROAD_KINDS, LaneKind
from simbev_ros.maps.roads.surface import strip_polygons
from simbev_ros.maps.roads.tunnels import Tunnels
from simbev_ros.scene.cached_method import cached_method

_MIN_ROADS = 3  # where fewer meet without traffic lights, a road only continues or ends
_BESIDE_M = 2.5  # distance from a junction, equal to that of its traffic-light poles
_BRACKET_M = 0.5  # from the axis of a pole, so that sensors are neither in it nor in its arm
_SPACING_M = 1.0
_OFF_ROAD_M = 0.3
_SAME_LEVEL_M = 2.5  # a road with a surface closer in height is on the level of a foot
_IN_TUNNEL_M = 1.0


@dataclass(frozen=True, eq=False)
class Crossing:
    """A junction at which roads meet.

    Attributes:
        junction: Its id.
        signalised: Whether it has traffic lights.
        lanes: The lanes inside it, at least one.
    """

    junction: str
    signalised: bool
    lanes: tuple[Lane, ...]

    @cached_property
    def center_m(self) -> Float64Array:
        """(3,) center of the bounds of its lanes, map frame."""
        positions_m = np.concatenate([lane.centerline_m for lane in self.lanes])
        return (positions_m.min(axis=0) + positions_m.max(axis=0)) / 2.0

    @property
    def area(self) -> BaseGeometry:
        """The ground of its lanes in plan."""
        lines = [shapely.LineString(lane.centerline_m[:, :2]) for lane in self.lanes]
        return overlay.union_all(shapely.buffer(lines, [lane.width_m / 2.0 for lane in self.lanes]))


class MastPlaces:
    """Places for masts on one map, computed on first use.

    Args:
        network: The roads of the map.
    """

    def __init__(self, network: RoadNetwork) -> None:
        self._network = network

    @cached_property
    def crossings(self) -> tuple[Crossing, ...]:
        """Junctions with traffic lights, or at which at least three roads arrive."""
        inside: dict[str, list[Lane]] = {}
        arriving: dict[str, set[str]] = {}
        for lane in self._network.lanes_of(*ROAD_KINDS):
            inside.setdefault(lane.junction, []).append(lane)
            if not lane.junction and lane.kind is LaneKind.DRIVING:
                for following in lane.successors:
                    arriving.setdefault(self._network.lanes[following].junction, set()).add(lane.edge)
        return tuple(
            Crossing(junction.id, junction.signalised, tuple(inside[junction.id]))
            for junction in self._network.junctions.values()
            if junction.id in inside and (junction.signalised or len(arriving.get(junction.id, ())) >= _MIN_ROADS)
        )

    @cached_method(maxsize=1024)
    def feet_m(self, index: int) -> Float64Array:
        """(K, 3) feet of masts at a crossing, map frame: at its poles of traffic lights, else around it off roads.

        At a pole, they are below the end of a bracket that points to the center.
        """
        crossing = self.crossings[index]
        poles_m = self._poles_m.get(crossing.junction, np.empty((0, 3)))
        poles_m = poles_m[~self._is_on_road(poles_m, ROAD_KINDS)]
        inward_m = (crossing.center_m - poles_m) * [1.0, 1.0, 0.0]
        inward_m *= _BRACKET_M / np.maximum(np.linalg.norm(inward_m, axis=1, keepdims=True), _BRACKET_M)
        feet_m = poles_m + inward_m
        feet_m = feet_m[~self._is_on_road(feet_m, ROAD_KINDS, 0.0)]
        if len(feet_m):
            return feet_m
        rings = shapely.get_parts(shapely.buffer(crossing.area, _BESIDE_M).boundary)
        feet_m = np.concatenate([_points_along(ring) for ring in rings])
        level = int(self._network.elevation.level_at(crossing.center_m[None])[0])
        feet_m = np.column_stack([feet_m, self._network.elevation.height_m(feet_m, level)])
        return feet_m[~self._is_on_road(feet_m, ROAD_KINDS) & ~self._is_in_building(feet_m)]

    def is_open(self, positions_m: Float64Array) -> BoolArray:
        """(N,) whether there is neither a tunnel nor another road above (N, 3) positions on roads, map frame."""
        inside = Tunnels.of_layout(self._network.layout).holds(positions_m + np.array([0.0, 0.0, _IN_TUNNEL_M]))
        point, above_m = self._roads_at(positions_m, tuple(LaneKind))
        inside[point[above_m > _SAME_LEVEL_M]] = True
        return ~inside

    def is_on_lane(self, foot_m: Float64Array) -> bool:
        """Whether a (3,) foot, map frame, is on a driving lane."""
        return bool(self._is_on_road(foot_m[None], (LaneKind.DRIVING,), 0.0)[0])

    def distance_m(self, x_m: float, y_m: float) -> float:
        """Distance in plan of a point from the nearest road."""
        elevation = self._network.elevation
        return float(min(elevation.distance_m(np.array([[x_m, y_m]]), level)[0] for level in elevation.levels))

    @cached_method(maxsize=1024)
    def ground_m(self, x_m: float, y_m: float) -> float:
        """Height of the land at a point, without structures above it."""
        return float(self._terrain.height_m(np.array([[x_m, y_m]]))[0])

    def _is_on_road(
        self, feet_m: Float64Array, kinds: tuple[LaneKind, ...], distance_m: float = _OFF_ROAD_M
    ) -> BoolArray:
        """(K,) whether (K, 3) feet are on lanes of these kinds on their level, or within a distance of them."""
        point, above_m = self._roads_at(feet_m, kinds, distance_m)
        is_on_road = np.zeros(len(feet_m), bool)
        is_on_road[point[np.abs(above_m) <= _SAME_LEVEL_M]] = True
        return is_on_road

    def _roads_at(
        self, positions_m: Float64Array, kinds: tuple[LaneKind, ...], distance_m: float = 0.0
    ) -> tuple[Int64Array, Float64Array]:
        """For each lane of these kinds in plan at one of (N, 3) positions, its index and the height above."""
        tree, levels = self._trees(kinds)
        point, strip = tree.query(shapely.points(positions_m[:, :2]), predicate="dwithin", distance=distance_m)
        above_m = np.empty(len(point))
        for level in np.unique(levels[strip]).tolist():
            rows = levels[strip] == level
            at_m = positions_m[point[rows]]
            above_m[rows] = self._network.elevation.height_m(at_m[:, :2], level) - at_m[:, 2]
        return point, above_m

    @cached_method()
    def _trees(self, kinds: tuple[LaneKind, ...]) -> tuple[shapely.STRtree, Int64Array]:
        """The (S,) areas of all lanes of these kinds, and their levels."""
        strips = self._network.layout.strips_of(*kinds)
        return shapely.STRtree(strip_polygons(strips)), np.array([strip.level for strip in strips], np.int64)

    @cached_property
    def _poles_m(self) -> dict[str, Float64Array]:
        """(P, 3) poles of the traffic lights of each junction, each once."""
        poles: dict[str, list[Float64Array]] = {}
        lanes = self._network.lanes
        for signal in self._network.signals:
            for junction in {lanes[following].junction for following in lanes[signal.lane].successors}:
                poles.setdefault(junction, []).append(signal.pole_m)
        return {junction: np.unique(np.round(poles_m, 3), axis=0) for junction, poles_m in poles.items()}

    def _is_in_building(self, feet_m: Float64Array) -> BoolArray:
        """(K,) whether (K, 3) feet are in buildings that the map prescribes; all others keep off its roads."""
        is_inside = np.zeros(len(feet_m), bool)
        points: AnyArray = np.asarray(shapely.points(feet_m[:, :2]), object)
        is_inside[self._buildings.query(points, predicate="dwithin", distance=_OFF_ROAD_M)[0]] = True
        return is_inside

    @cached_property
    def _buildings(self) -> shapely.STRtree:
        return shapely.STRtree([building.outline for building in self._network.features.buildings or ()])

    @cached_property
    def _terrain(self) -> Terrain:
        return Terrain(self._network)


def _points_along(ring: shapely.LineString) -> Float64Array:
    """(N, 2) points along a line."""
    return shapely.get_coordinates(shapely.line_interpolate_point(ring, np.arange(0.0, ring.length, _SPACING_M)))
