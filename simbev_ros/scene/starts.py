"""Where the vehicles and pedestrians of a map can start: worked out once for a map, shared by all of its scenes."""

from functools import cached_property, lru_cache

import numpy as np

from simbev_ros.maps.network import RoadNetwork
from simbev_ros.scene.blueprints import load_blueprints
from simbev_ros.scene.places import Places, places_along
from simbev_ros.scene.streets import Streets
from simbev_ros.scene.walks import WalkGraph
from simbev_ros.types import BoolArray, Float64Array

_WALK_MPS = 2.0  # where one can walk at this speed for the whole scene is room enough


class Starts:
    """The places of one map."""

    def __init__(self, network: RoadNetwork, waypoint_spacing_m: float) -> None:
        """Lay the places for vehicles along the streets, and those for pedestrians along the sidewalks."""
        self._streets = Streets(network)
        self.vehicles = places_along(self._streets.lanes, waypoint_spacing_m / 2.0, waypoint_spacing_m)
        walks = WalkGraph(network)
        component_m = walks.component_m()
        self._component_m = np.array([component_m[lane.edge] for lane in walks.sidewalks])
        self.pedestrians: Places = places_along(walks.sidewalks, 1.0, 1.0, end_margin_m=0.5)
        self._network = network
        self.fit = lru_cache(maxsize=8)(self._fit)

    @cached_property
    def is_hilly(self) -> bool:
        """Whether the map has non-zero elevation."""
        return any(bool(np.any(np.abs(lane.centerline_m[:, 2]) > 0.01)) for lane in self._network.lanes.values())

    @cached_property
    def programmes(self) -> tuple[str, ...]:
        """The traffic lights' programmes."""
        return tuple(sorted({signal.programme for signal in self._network.signals}))

    def _fit(self, duration_s: float) -> dict[str, BoolArray]:
        """For each of SUMO's vehicle classes (N,) from which places it gets as far as it could drive in that time."""
        fastest_mps = max((lane.speed_mps for lane in self._streets.lanes), default=0.0)
        top_mps: dict[str, float] = {}
        for each in load_blueprints():
            if each.kind == "vehicle":
                top_mps[each.sumo_class] = max(each.max_speed_mps, top_mps.get(each.sumo_class, 0.0))
        return {
            name: self._streets.for_class(name).fit(
                self.vehicles.row, self.vehicles.s_m, duration_s * min(fastest_mps, top_mps[name])
            )
            for name in sorted(top_mps)
        }

    def walkable(self, duration_s: float, center_m: Float64Array, radius_m: float) -> BoolArray:
        """(P,) from which of the pedestrians' places near a (3,) point one can walk on for so long.

        Where that is nowhere possible, those of the largest part count.
        """
        needed_m = min(duration_s * _WALK_MPS, self._component_m.max(initial=0.0))
        enough: BoolArray = (self._component_m >= needed_m)[self.pedestrians.row]
        return enough & self.pedestrians.within(center_m, radius_m)
