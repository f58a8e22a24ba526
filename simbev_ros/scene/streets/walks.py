"""Where pedestrians can walk: a graph of sidewalks, walking areas and crossings, and random walks on it."""

from collections import defaultdict, deque

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from simbev_ros.maps.network import Lane, RoadNetwork
from simbev_ros.maps.roads.lane_kind import WALKABLE_KINDS, LaneKind

_MAX_REACHED = 300  # limits the search for a destination on large maps
_SUMO_CLASS = "pedestrian"


class WalkGraph:
    """Adjacency of the lanes for pedestrians; all of them can be walked in both directions."""

    def __init__(self, network: RoadNetwork) -> None:
        walkable = {lane.id: lane for lane in network.lanes_of(*WALKABLE_KINDS) if _is_walked(lane)}
        self.sidewalks = tuple(lane for lane in walkable.values() if lane.kind is LaneKind.SIDEWALK)
        self._length_m = {lane.edge: lane.length_m for lane in self.sidewalks}
        neighbors: dict[str, dict[str, None]] = defaultdict(dict)
        for lane in walkable.values():
            for successor in lane.successors:
                if successor in walkable:
                    neighbors[lane.edge][walkable[successor].edge] = None
                    neighbors[walkable[successor].edge][lane.edge] = None
        self._neighbors = {edge: tuple(adjacent) for edge, adjacent in neighbors.items()}

    def component_length_m(self) -> dict[str, float]:
        """For each edge with a sidewalk, the total length of all sidewalks connected to it, itself included."""
        edges = tuple(dict.fromkeys((*self._length_m, *self._neighbors)))
        row = {edge: index for index, edge in enumerate(edges)}
        pairs = np.array(
            [(row[edge], row[other]) for edge, adjacent in self._neighbors.items() for other in adjacent], np.int64
        ).reshape(-1, 2)
        adjacent = coo_array((np.ones(len(pairs), bool), pairs.T), shape=(len(edges), len(edges)))
        _, component = connected_components(adjacent.tocsr(), directed=False)
        total_m = np.bincount(component, [self._length_m.get(edge, 0.0) for edge in edges])
        return {edge: float(total_m[component[row[edge]]]) for edge in self._length_m}

    def draw_walk(self, start_edge: str, length_m: float, rng: np.random.Generator) -> tuple[str, ...]:
        """Draw a walk over random destinations: its edges, at least ``length_m`` long beyond the first edge.

        The direction along the first edge is random, but leads to a dead end, as do later edges, only where nothing
        else can be reached. Pedestrians do not turn back in the middle of a sidewalk. The walk lists crossings and
        walking areas, so that SUMO does not re-choose them while a pedestrian waits. It is shorter than ``length_m``
        only where nothing more can be reached.
        """
        walk = [start_edge]
        adjacent = self._neighbors.get(start_edge, ())
        previous = adjacent[int(rng.integers(len(adjacent)))] if adjacent else ""
        while length_m > 0.0:
            came_from = self._search(walk[-1], previous)
            if len(walk) == 1 and len(came_from) == 1:
                came_from = self._search(start_edge, "")
            destinations = [edge for edge in came_from if edge in self._length_m and edge != walk[-1]]
            destinations = [edge for edge in destinations if len(self._neighbors[edge]) > 1] or destinations
            if not destinations:
                break
            leg = [destinations[int(rng.integers(len(destinations)))]]
            while came_from[leg[-1]] != walk[-1]:
                leg.append(came_from[leg[-1]])
            walk += reversed(leg)
            previous = walk[-2]
            length_m -= sum(self._length_m.get(edge, 0.0) for edge in leg)
        return tuple(walk)

    def _search(self, start: str, previous: str) -> dict[str, str]:
        """Nearest edges reachable without stepping back to ``previous``, each with the edge before it."""
        came_from = {start: ""}
        pending = deque([start])
        while pending and len(came_from) < _MAX_REACHED:
            edge_at = pending.popleft()
            for edge in self._neighbors.get(edge_at, ()):
                if edge not in came_from and not (edge_at == start and edge == previous):
                    came_from[edge] = edge_at
                    pending.append(edge)
        return came_from


def _is_walked(lane: Lane) -> bool:
    """Whether SUMO's pedestrians use a lane; in junctions, they use crossings and walking areas only."""
    return _SUMO_CLASS in lane.classes and not (lane.junction and lane.kind is LaneKind.SIDEWALK)
