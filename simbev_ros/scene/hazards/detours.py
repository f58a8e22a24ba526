"""Whether traffic finds a way around roads that are closed altogether."""

import numpy as np

from simbev_ros.maps.network import RoadNetwork
from simbev_ros.scene.blueprints import Blueprint, blueprint_index, load_blueprints
from simbev_ros.scene.streets.lane_positions import Places
from simbev_ros.scene.streets.street_graph import streets_of
from simbev_ros.types import BoolArray

_USUAL = "vehicle.compact"
_MOST_M = 300.0  # of streets that lead only to the closed ones, and are closed, too
_LEAST_SHARE = 0.75  # of the places around the ego where one can still start


class Detours:
    """The ways around closed roads, in a scene."""

    def __init__(self, network: RoadNetwork, ego: Blueprint, ego_lane: str, places: Places, near: BoolArray) -> None:
        """For an ego that starts on a lane, and the others at those of the (N,) places that are ``near``."""
        self._streets = streets_of(network)
        self._ego, self._ego_lane = ego, ego_lane
        self._ego_edge = network.lanes[ego_lane].edge
        self._edges = np.array([lane.edge for lane in places.lanes])[places.row[near]]

    def around(self, closed: frozenset[str]) -> frozenset[str] | None:
        """Edges that nobody enters if some are ``closed``; None: that is too much, or the ego is among them."""
        usual = self._streets.for_blueprint(load_blueprints()[blueprint_index()[_USUAL]])
        cut_off = usual.cut_off(closed)
        own = self._streets.for_blueprint(self._ego)
        if self._ego_edge in cut_off | own.cut_off(closed) or not closed <= cut_off:
            return None
        if own.leads_on(self._ego_lane) and not self._streets.for_blueprint(self._ego, closed).leads_on(self._ego_lane):
            return None
        led_there = [self._streets.edge_number[edge] for edge in sorted(cut_off - closed)]
        if self._streets.edge_length_m[led_there].sum() > _MOST_M:
            return None
        open_share = np.mean(~np.isin(self._edges, list(cut_off))) if len(self._edges) else 0.0
        return cut_off if open_share >= _LEAST_SHARE and usual.endless(closed) else None
