"""The driving lanes of a map and which follow which; ``StreetGraph`` says where a vehicle class can drive on them."""

from collections.abc import Mapping, Set
from functools import cached_property
from itertools import compress

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from simbev_ros.foundation.latest_value import LatestValue
from simbev_ros.foundation.types import BoolArray, Int64Array
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.polylines import Polylines
from simbev_ros.scene.blueprints import Blueprint, VehicleFootprint
from simbev_ros.scene.cached_method import cached_method
from simbev_ros.scene.streets.off_tracking import is_long
from simbev_ros.scene.streets.relations import between_groups, only_pairs, relation
from simbev_ros.scene.streets.street_graph import StreetGraph
from simbev_ros.scene.streets.tight_turns import tight_lanes
from simbev_ros.scene.streets.turns import Turns

_MAX_LANES_IN_JUNCTION = 20  # limits the search in a broken net; real junctions have fewer lanes in a row


class Streets:
    """The driving lanes of a map and their successors, for all vehicle classes.

    Attributes:
        lanes: The L driving lanes.
        row: Index of each lane by its id.
        following: (K, 2) rows of lanes and their successors.
        outside: (L,) whether each lane lies outside junctions.
        edge: (L,) index of each lane's edge.
        edges: Ids of the E edges.
        edge_number: Index of each edge by its id.
        edge_length_m: (E,) lengths.
    """

    def __init__(self, network: RoadNetwork, edges: Set[str] | None = None) -> None:
        """All driving lanes of a map, or only those on the given edges."""
        lanes = network.lanes_of(LaneKind.DRIVING)
        self._kept = np.array([edges is None or lane.edge in edges for lane in lanes], bool)
        self.lanes = tuple(compress(lanes, self._kept.tolist()))
        self.row = {lane.id: row for row, lane in enumerate(self.lanes)}
        pairs = [
            (row, self.row[successor])
            for row, lane in enumerate(self.lanes)
            for successor in lane.successors
            if successor in self.row
        ]
        self.following = np.array(pairs, np.int64).reshape(-1, 2)
        self.outside = np.array([not lane.junction for lane in self.lanes], bool)
        numbers: dict[str, int] = {}
        self.edge = np.array([numbers.setdefault(lane.edge, len(numbers)) for lane in self.lanes], np.int64)
        self.edges = tuple(numbers)
        self.edge_number = numbers
        self.edge_length_m = np.zeros(len(numbers))
        self.edge_length_m[self.edge] = Polylines.from_lines([lane.centerline_m for lane in self.lanes]).length_m
        self._network = network

    def usable_lanes(self, sumo_class: str) -> BoolArray:
        """(L,) whether a vehicle class may use each lane."""
        return np.array([sumo_class in lane.classes for lane in self.lanes], bool)

    @cached_property
    def is_closed(self) -> bool:
        """Whether cars get from every street of the map to every other and need not turn round for it.

        Maps cut out of a city are open.
        """
        streets = streets_of(self._network)
        usable = streets.usable_lanes("passenger")
        after_lane = streets.edges_after(usable)
        onward = only_pairs(after_lane, ~streets.turns.lead_back(*after_lane.nonzero()))
        after_edge = between_groups(onward, streets.edge)
        _, component = connected_components(after_edge, directed=True, connection="strong")
        return len(np.unique(component[streets.edge[usable & streets.outside]])) <= 1

    def lanes_after(self, rows: Int64Array, usable: BoolArray) -> Int64Array:
        """Rows of the usable lanes outside junctions that follow lanes across a junction; ``usable`` is (L,)."""
        found = [np.empty(0, np.int64)]
        for _ in range(_MAX_LANES_IN_JUNCTION):
            following = self.following[np.isin(self.following[:, 0], rows), 1]
            following = np.unique(following[usable[following]])
            found.append(following[self.outside[following]])
            rows = following[~self.outside[following]]
        return np.unique(np.concatenate(found))

    def edges_after(self, usable: BoolArray) -> csr_array:
        """(L, E) edges reached from the usable lanes outside junctions, through the junctions' lanes."""
        count = len(self.lanes)
        pairs = self.following[usable[self.following].all(axis=1)]
        steps = relation(pairs[:, 0], pairs[:, 1], (count, count))
        lane, at_lane = np.flatnonzero(usable & self.outside), np.flatnonzero(usable & self.outside)
        lanes, edges = [np.empty(0, np.int64)], [np.empty(0, np.int64)]
        for _ in range(_MAX_LANES_IN_JUNCTION):
            index, next_lane = steps[at_lane].nonzero()
            lane, arrived = lane[index], self.outside[next_lane]
            lanes.append(lane[arrived])
            edges.append(self.edge[next_lane[arrived]])
            lane, at_lane = lane[~arrived], next_lane[~arrived]
            if not len(at_lane):
                break
        return relation(np.concatenate(lanes), np.concatenate(edges), (count, len(self.edges)))

    @cached_property
    def turns(self) -> Turns:
        """Finds turns back onto the same road."""
        return Turns(self.lanes, self.edge)

    def for_blueprint(
        self, blueprint: Blueprint, closed: frozenset[str] = frozenset(), tight: bool = False
    ) -> StreetGraph:
        """The graph for a blueprint: without ``closed`` edges and, unless ``tight``, without turns too tight for it."""
        if tight or not is_long(blueprint):
            graph = self.for_class(blueprint.sumo_class)
        else:
            graph = self._for_long(blueprint.sumo_class, blueprint.turning_footprint)
        return self._without_edges(graph, closed) if closed else graph

    @cached_method()
    def for_class(self, sumo_class: str) -> StreetGraph:
        """The graph for one of SUMO's vehicle classes."""
        return StreetGraph(self, sumo_class, self.usable_lanes(sumo_class))

    @cached_method()
    def _for_long(self, sumo_class: str, body: VehicleFootprint) -> StreetGraph:
        """The graph for long vehicles of a class with this footprint."""
        tight = streets_of(self._network).tight[body][self._kept]
        return StreetGraph(self, sumo_class, self.usable_lanes(sumo_class) & ~tight)

    @cached_method(maxsize=64)
    def _without_edges(self, graph: StreetGraph, closed: frozenset[str]) -> StreetGraph:
        """A graph of these streets without ``closed`` edges and the edges that they cut off."""
        return graph.without_edges(closed)

    @cached_property
    def tight(self) -> Mapping[VehicleFootprint, BoolArray]:
        """For each long vehicle's footprint, (L,) lanes that it must not take; only for ``Streets`` of a whole map."""
        return tight_lanes(self._network, self.following)


_STREETS = LatestValue[int, Streets]()


def streets_of(network: RoadNetwork) -> Streets:
    """All streets of a map; the most recent map is cached."""
    return _STREETS.get(id(network), lambda: Streets(network))  # which refer to it, so no other one gets its id
