"""New routes for vehicles that come to the end of theirs, so that the population stays."""

from collections.abc import Set
from typing import NamedTuple

from simbev_ros.maps.network import RoadNetwork
from simbev_ros.random import stream
from simbev_ros.scene.spec import SceneSpec
from simbev_ros.scene.streets.street_graph import Streets
from simbev_ros.world.cast import blueprint_of

_AHEAD_M = 2000.0


class Onward(NamedTuple):
    """The edges that follow a route, and the lane at whose end the vehicle has to stay because nothing follows."""

    edges: tuple[str, ...]
    last_lane: str | None


class Routes:
    """Random ways on, through the streets that are simulated."""

    def __init__(self, spec: SceneSpec, network: RoadNetwork, edges: Set[str]) -> None:
        """For the streets ``edges``, those inside junctions included."""
        self._spec = spec
        self._streets = Streets(network, edges)

    def onward(self, vehicle: int, edge: str, step: int) -> Onward:
        """How vehicle number ``vehicle`` of the specification, whose route ends with ``edge``, drives on."""
        rng = stream(self._spec.seed, f"v{vehicle}.onward", step)
        blueprint = blueprint_of(self._spec.vehicles[vehicle].blueprint)
        graph = self._streets.for_blueprint(blueprint, self._spec.closed_edges)
        if graph.ends_at(edge):
            graph = self._streets.for_blueprint(blueprint, self._spec.closed_edges, tight=True)
        edges = graph.onward(edge, _AHEAD_M, rng)
        last = edges[-1] if edges else edge
        return Onward(edges, graph.lane_of(last) if graph.ends_at(last) else None)
