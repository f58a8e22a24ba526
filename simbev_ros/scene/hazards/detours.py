"""Check whether traffic can detour around a road that a hazard area closes entirely."""

from collections.abc import Sequence

import numpy as np

from simbev_ros.foundation.types import BoolArray
from simbev_ros.maps.network import Lane, RoadNetwork
from simbev_ros.scene.blueprints import Blueprint, blueprint_named
from simbev_ros.scene.streets.lane_positions import LanePositions
from simbev_ros.scene.streets.streets import streets_of
from simbev_ros.schema.scene.spec import VehicleSpec

_REFERENCE_VEHICLE = "vehicle.compact"
_MAX_CUT_OFF_M = 300.0  # total length of streets that lead only to the closed ones and are closed, too
_MIN_OPEN_SHARE = 0.75  # of the start positions around the agents that stay usable


class Detours:
    """Finds the edges that closing roads would take from the traffic of one scene."""

    def __init__(
        self, network: RoadNetwork, agents: Sequence[VehicleSpec], positions: LanePositions, near: BoolArray
    ) -> None:
        """For agents in vehicles, already drawn; other vehicles start at the ``near`` ones of the (N,) positions."""
        self._streets = streets_of(network)
        self._agents = [(blueprint_named(agent.blueprint), network.lanes[agent.start.lane]) for agent in agents]
        self._passed = {edge for agent in agents for edge in agent.via}
        self._edges = np.array([lane.edge for lane in positions.lanes])[positions.row[near]]

    def closure_for(self, closed: frozenset[str]) -> frozenset[str] | None:
        """All edges to close if ``closed`` are closed; None: too much is lost, or an agent is among it."""
        reference = self._streets.for_blueprint(blueprint_named(_REFERENCE_VEHICLE))
        cut_off = reference.cut_off_edges(closed)
        if (
            not closed <= cut_off
            or self._passed & cut_off
            or any(self._loses(*agent, closed, cut_off) for agent in self._agents)
        ):
            return None
        dead_ends = [self._streets.edge_number[edge] for edge in sorted(cut_off - closed)]
        if self._streets.edge_length_m[dead_ends].sum() > _MAX_CUT_OFF_M:
            return None
        open_share = np.mean(~np.isin(self._edges, list(cut_off))) if len(self._edges) else 0.0
        is_open = reference.never_ends(closed) and reference.keeps_loops(cut_off)
        return cut_off if open_share >= _MIN_OPEN_SHARE and is_open else None

    def _loses(self, agent: Blueprint, lane: Lane, closed: frozenset[str], cut_off: frozenset[str]) -> bool:
        """Whether an agent that starts on a lane would be on a cut-off edge, or lose every exit of its lane."""
        graph = self._streets.for_blueprint(agent)
        if lane.edge in cut_off | graph.cut_off_edges(closed):
            return True
        return graph.has_successor(lane.id) and not self._streets.for_blueprint(agent, closed).has_successor(lane.id)
