"""Where the vehicles and pedestrians of a map can start: worked out once for a map, shared by all of its scenes."""

from functools import cache, cached_property, lru_cache, partial

import numpy as np

from simbev_ros.maps.network import RoadNetwork
from simbev_ros.scene.blueprints import Blueprint, load_blueprints
from simbev_ros.scene.hazards.sites import HazardSites
from simbev_ros.scene.streets.lane_positions import Places, places_along
from simbev_ros.scene.streets.off_tracking import is_long
from simbev_ros.scene.streets.street_graph import streets_of
from simbev_ros.scene.streets.walks import WalkGraph
from simbev_ros.types import BoolArray, Float64Array

_TAIL_M = 1.0  # of a long vehicle may stick out of its lane
_WALK_MPS = 2.0  # where one can walk at this speed for the whole scene is room enough


class Starts:
    """The places of one map."""

    def __init__(self, network: RoadNetwork, waypoint_spacing_m: float) -> None:
        """Lay the places for vehicles along the streets, and those for pedestrians along the sidewalks."""
        self._streets = streets_of(network)
        self.vehicles = places_along(self._streets.lanes, waypoint_spacing_m / 2.0, waypoint_spacing_m)
        walks = WalkGraph(network)
        component_m = walks.component_m()
        self._component_m = np.array([component_m[lane.edge] for lane in walks.sidewalks])
        self.pedestrians: Places = places_along(walks.sidewalks, 1.0, 1.0, end_margin_m=0.5)
        self._network = network
        self.fit = lru_cache(maxsize=8)(self._fit)
        self.hazard_sites = lru_cache(maxsize=8)(partial(HazardSites, network))

    @cached_property
    def is_hilly(self) -> bool:
        """Whether the map has non-zero elevation."""
        return any(bool(np.any(np.abs(lane.centerline_m[:, 2]) > 0.01)) for lane in self._network.lanes.values())

    @cached_property
    def programmes(self) -> tuple[str, ...]:
        """The traffic lights' programmes."""
        return tuple(sorted({signal.programme for signal in self._network.signals}))

    def _fit(self, duration_s: float, closed: frozenset[str] = frozenset()) -> dict[str, BoolArray]:
        """For each vehicle's blueprint (N,) from which places it gets as far as it could drive in that time.

        Nobody drives onto ``closed`` edges.
        """
        vehicles = [each for each in load_blueprints() if each.kind == "vehicle"]
        return {each.name: self._fit_for(each, duration_s, closed) for each in vehicles}

    def anyhow(self, blueprint: Blueprint, duration_s: float, closed: frozenset[str] = frozenset()) -> BoolArray:
        """(N,) from which places a vehicle gets as far as it could drive, be the turns ever so tight."""
        graph = self._streets.for_blueprint(blueprint, closed, tight=True)
        return graph.fit(self.vehicles.row, self.vehicles.s_m, self._way_m(blueprint, duration_s))

    def _fit_for(self, blueprint: Blueprint, duration_s: float, closed: frozenset[str]) -> BoolArray:
        """(N,) where a vehicle gets far; a long one stands on its lane but for the tail."""
        if not is_long(blueprint):
            return self.anyhow(blueprint, duration_s, closed)
        places, way_m = self.vehicles, self._way_m(blueprint, duration_s)
        far = self._streets.for_blueprint(blueprint, closed).gets_far(places.row, places.s_m, way_m)
        return far & (places.s_m + _TAIL_M >= blueprint.size_m[0])

    def _way_m(self, blueprint: Blueprint, duration_s: float) -> float:
        return duration_s * min(self._fastest_mps, _top_mps()[blueprint.sumo_class])

    @cached_property
    def _fastest_mps(self) -> float:
        return max((lane.speed_mps for lane in self._streets.lanes), default=0.0)

    def walkable(self, duration_s: float, center_m: Float64Array, radius_m: float) -> BoolArray:
        """(P,) from which of the pedestrians' places near a (3,) point one can walk on for so long.

        Where that is nowhere possible, those of the largest part count.
        """
        needed_m = min(duration_s * _WALK_MPS, self._component_m.max(initial=0.0))
        enough: BoolArray = (self._component_m >= needed_m)[self.pedestrians.row]
        return enough & self.pedestrians.within(center_m, radius_m)


@cache
def _top_mps() -> dict[str, float]:
    """Highest speed of each of SUMO's vehicle classes."""
    vehicles = [each for each in load_blueprints() if each.kind == "vehicle"]
    return {
        each.sumo_class: max(other.max_speed_mps for other in vehicles if other.sumo_class == each.sumo_class)
        for each in vehicles
    }
