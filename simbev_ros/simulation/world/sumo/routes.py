"""Route extensions for vehicles that approach the end of their route, so that they stay in the simulation."""

from collections.abc import Set
from typing import NamedTuple

from simbev_ros.foundation.random import stream
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.scene.blueprints import blueprint_named
from simbev_ros.scene.streets.streets import Streets
from simbev_ros.schema.scene.spec import SceneSpec

_EXTENSION_M = 2000.0
_ON_LANES_M = 100.0  # a new route needs no lane change within this distance


class RouteExtension(NamedTuple):
    """Edges that follow or replace a route, and, in a dead end, the lane where a vehicle must stop at the end."""

    edges: tuple[str, ...]
    last_lane: str | None


class Routes:
    """Draws random route extensions on the simulated edges."""

    def __init__(self, spec: SceneSpec, network: RoadNetwork, edges: Set[str]) -> None:
        """For the simulated edges, including those inside junctions."""
        self._spec = spec
        self._streets = Streets(network, edges)

    def draw_extension(self, vehicle: int, edge: str, step: int) -> RouteExtension:
        """Extend the route of a vehicle (its index in the specification) that ends with ``edge`` by random edges."""
        rng = stream(self._spec.seed, f"v{vehicle}.onward", step)
        blueprint = blueprint_named(self._spec.vehicles[vehicle].blueprint)
        graph = self._streets.for_blueprint(blueprint, self._spec.closed_edges)
        if graph.is_dead_end(edge):
            graph = self._streets.for_blueprint(blueprint, self._spec.closed_edges, tight=True)
        edges = graph.draw_continuation(edge, _EXTENSION_M, rng)
        last = edges[-1] if edges else edge
        return RouteExtension(edges, graph.first_lane(last) if graph.is_dead_end(last) else None)

    def draw_detour(self, vehicle: int, lane: str, step: int) -> RouteExtension:
        """Draw a random route for a vehicle (its index in the specification) from its lane, as far as that leads."""
        rng = stream(self._spec.seed, f"v{vehicle}.detour", step)
        blueprint = blueprint_named(self._spec.vehicles[vehicle].blueprint)
        graph = self._streets.for_blueprint(blueprint, self._spec.closed_edges, tight=True)
        edges = graph.draw_route_without_lane_changes(lane, _ON_LANES_M, _EXTENSION_M, rng)
        return RouteExtension(edges, graph.first_lane(edges[-1]) if graph.is_dead_end(edges[-1]) else None)
