"""Where pedestrians can walk: which sidewalks, walking areas and crossings touch, and random walks over them."""

from collections import defaultdict, deque

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.roads.lane_kind import WALKABLE_KINDS, LaneKind

_MOST_REACHED = 300  # bounds the search for a walk's destination on large maps
_WALKER = "pedestrian"


class WalkGraph:
    """Which of the lanes for pedestrians touch; all of them are walked in both directions."""

    def __init__(self, network: RoadNetwork) -> None:
        walkable = {lane.id: lane for lane in network.lanes_of(*WALKABLE_KINDS) if _WALKER in lane.classes}
        self.sidewalks = tuple(lane for lane in walkable.values() if lane.kind is LaneKind.SIDEWALK)
        self._length_m = {lane.edge: lane.length_m for lane in self.sidewalks}
        neighbours: dict[str, dict[str, None]] = defaultdict(dict)
        for lane in walkable.values():
            for successor in lane.successors:
                if successor in walkable:
                    neighbours[lane.edge][walkable[successor].edge] = None
                    neighbours[walkable[successor].edge][lane.edge] = None
        self._neighbours = {edge: tuple(touching) for edge, touching in neighbours.items()}

    def component_m(self) -> dict[str, float]:
        """Edge with a sidewalk → length of all sidewalks that can be walked to from it, itself included."""
        edges = tuple(dict.fromkeys((*self._length_m, *self._neighbours)))
        row = {edge: index for index, edge in enumerate(edges)}
        pairs = np.array(
            [(row[edge], row[other]) for edge, touching in self._neighbours.items() for other in touching], np.int64
        ).reshape(-1, 2)
        touching = coo_array((np.ones(len(pairs), bool), pairs.T), shape=(len(edges), len(edges)))
        _, component = connected_components(touching.tocsr(), directed=False)
        total_m = np.bincount(component, [self._length_m.get(edge, 0.0) for edge in edges])
        return {edge: float(total_m[component[row[edge]]]) for edge in self._length_m}

    def walk(self, start_edge: str, length_m: float, rng: np.random.Generator) -> tuple[str, ...]:
        """Edges of a walk to one random destination after the other, at least ``length_m`` long beyond the first edge.

        The direction along the first edge is random, and nobody turns back in the middle of a sidewalk. Crossings and
        walking areas are included, so that SUMO does not choose them anew while somebody waits. The walk ends early
        only where nothing can be reached.
        """
        walk = [start_edge]
        touching = self._neighbours.get(start_edge, ())
        behind = touching[int(rng.integers(len(touching)))] if touching else ""
        while length_m > 0.0:
            came_from = self._reachable(walk[-1], behind)
            destinations = [edge for edge in came_from if edge in self._length_m and edge != walk[-1]]
            if not destinations:
                break
            leg = [destinations[int(rng.integers(len(destinations)))]]
            while came_from[leg[-1]] != walk[-1]:
                leg.append(came_from[leg[-1]])
            walk += reversed(leg)
            behind = walk[-2]
            length_m -= sum(self._length_m.get(edge, 0.0) for edge in leg)
        return tuple(walk)

    def _reachable(self, start: str, behind: str) -> dict[str, str]:
        """Nearest edges that can be walked to without stepping back to ``behind``, each with the edge before it."""
        came_from = {start: ""}
        waiting = deque([start])
        while waiting and len(came_from) < _MOST_REACHED:
            here = waiting.popleft()
            for edge in self._neighbours.get(here, ()):
                if edge not in came_from and not (here == start and edge == behind):
                    came_from[edge] = here
                    waiting.append(edge)
        return came_from
