"""Start positions of vehicles and pedestrians on a map, computed once per map and shared by all of its scenes."""

from functools import cache, cached_property

import numpy as np

from simbev_ros.foundation.types import AnyArray, BoolArray, Float64Array
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.scene.blueprints import Blueprint, load_blueprints
from simbev_ros.scene.cached_method import cached_method
from simbev_ros.scene.drawing.mast_places import MastPlaces
from simbev_ros.scene.hazards.sites import HazardSites
from simbev_ros.scene.streets.lane_positions import LanePositions, positions_along
from simbev_ros.scene.streets.off_tracking import is_long
from simbev_ros.scene.streets.streets import streets_of
from simbev_ros.scene.streets.walks import WalkGraph

_LANE_PER_VEHICLE_M = 30.0  # that of a dense but moving flow in a city
_TAIL_M = 1.0  # length by which a long vehicle may protrude behind its lane
_COUNTRY_MPS = 25.0  # limit above which a road is a motorway, where farm tractors must not be
_WALK_MPS = 2.0  # a sidewalk network on which one can walk at this speed for the whole scene is large enough


class StartPositions:
    """Start positions on one map.

    Attributes:
        vehicles: Positions on driving lanes.
        pedestrians: Positions on sidewalks.
    """

    def __init__(self, network: RoadNetwork, waypoint_spacing_m: float) -> None:
        """Sample the vehicles' positions along the streets and the pedestrians' along the sidewalks."""
        self._streets = streets_of(network)
        self.vehicles = positions_along(self._streets.lanes, waypoint_spacing_m / 2.0, waypoint_spacing_m)
        walks = WalkGraph(network)
        component_length_m = walks.component_length_m()
        self._component_length_m = np.array([component_length_m[lane.edge] for lane in walks.sidewalks])
        self.pedestrians: LanePositions = positions_along(walks.sidewalks, 1.0, 1.0, end_margin_m=0.5)
        self._network = network

    @cached_property
    def signal_programs(self) -> tuple[str, ...]:
        """Ids of the map's traffic-light programs, sorted."""
        return tuple(sorted({signal.programme for signal in self._network.signals}))

    @cached_property
    def masts(self) -> MastPlaces:
        """Places for the masts of roadside units."""
        return MastPlaces(self._network)

    @cached_property
    def is_under_sky(self) -> BoolArray:
        """(N,) whether the vehicles' positions are neither in a tunnel nor below another road."""
        return self.masts.is_open(self.vehicles.position_m)

    @cached_method(maxsize=8)
    def usable(self, duration_s: float, closed: frozenset[str] = frozenset()) -> dict[str, BoolArray]:
        """For each vehicle blueprint, (N,) positions from which it has enough road for this duration.

        No vehicle drives onto ``closed`` edges.
        """
        vehicles = [each for each in load_blueprints() if each.kind == "vehicle"]
        return {each.name: self._usable_for(each, duration_s, closed) & self._has_land(each) for each in vehicles}

    def capacity(self, duration_s: float) -> float:
        """Maximum number of vehicles that can keep driving for this duration; infinite where streets lead far enough.

        On a small map cut out of a city, all vehicles end up on the few streets that do not lead out of it.
        """
        lanes_m = self._streets.for_class("passenger").loop_lanes_m()
        distance_m = duration_s * min(self._max_limit_mps, _max_speed_by_class_mps()["passenger"])
        is_ample = self._streets.is_closed or not 0.0 < lanes_m < distance_m
        return np.inf if is_ample else lanes_m / _LANE_PER_VEHICLE_M

    @cached_method(maxsize=8)
    def hazard_sites(self, taper_factor: float) -> HazardSites:
        """The map's sites for hazards with tapers scaled by this factor."""
        return HazardSites(self._network, taper_factor)

    def usable_on_tight_turns(
        self, blueprint: Blueprint, duration_s: float, closed: frozenset[str] = frozenset()
    ) -> BoolArray:
        """(N,) positions from which a vehicle has enough road if it may take turns that are too tight for it."""
        graph = self._streets.for_blueprint(blueprint, closed, tight=True)
        return graph.usable_starts(self.vehicles.row, self.vehicles.s_m, self._max_distance_m(blueprint, duration_s))

    def _usable_for(self, blueprint: Blueprint, duration_s: float, closed: frozenset[str]) -> BoolArray:
        """(N,) positions with enough road ahead; a long vehicle must also fit on its lane, except for its tail."""
        if not is_long(blueprint):
            return self.usable_on_tight_turns(blueprint, duration_s, closed)
        positions, distance_m = self.vehicles, self._max_distance_m(blueprint, duration_s)
        can_drive = self._streets.for_blueprint(blueprint, closed).can_drive(positions.row, positions.s_m, distance_m)
        return can_drive & (positions.s_m + _TAIL_M >= blueprint.train_length_m)

    def _has_land(self, blueprint: Blueprint) -> BoolArray:
        """(N,) whether a blueprint is at home there: farm tractors on country roads, and others everywhere."""
        is_slow = np.array([lane.speed_mps <= _COUNTRY_MPS for lane in self._streets.lanes], bool)[self.vehicles.row]
        there: BoolArray = is_slow & (self._land == blueprint.land)
        return there if blueprint.land else np.ones(len(there), bool)

    @cached_property
    def _land(self) -> AnyArray:
        """(N,) land uses at the vehicles' positions."""
        return self._network.features.uses_at(self.vehicles.position_m[:, :2])

    def _max_distance_m(self, blueprint: Blueprint, duration_s: float) -> float:
        return duration_s * min(self._max_limit_mps, _max_speed_by_class_mps()[blueprint.sumo_class])

    @cached_property
    def _max_limit_mps(self) -> float:
        return max((lane.speed_mps for lane in self._streets.lanes), default=0.0)

    def walkable_near(self, duration_s: float, centers_m: Float64Array, radius_m: float) -> BoolArray:
        """(P,) pedestrian positions near one of the (N, 3) points with enough sidewalk to walk for this duration.

        If no sidewalk network is that large, the positions on the largest one count.
        """
        min_component_m = min(duration_s * _WALK_MPS, self._component_length_m.max(initial=0.0))
        is_large_enough: BoolArray = (self._component_length_m >= min_component_m)[self.pedestrians.row]
        return is_large_enough & np.any(
            [self.pedestrians.within_radius(center_m, radius_m) for center_m in centers_m], axis=0
        )


@cache
def _max_speed_by_class_mps() -> dict[str, float]:
    """Maximum speed of each of SUMO's vehicle classes."""
    vehicles = [each for each in load_blueprints() if each.kind == "vehicle"]
    return {
        each.sumo_class: max(other.max_speed_mps for other in vehicles if other.sumo_class == each.sumo_class)
        for each in vehicles
    }
