"""Where everybody goes: random routes through streets and walks over sidewalks, each long enough for the whole scene.

Since nobody reaches an end, nobody has to be re-routed, removed or inserted while the scene runs.
"""

from collections import defaultdict, deque
from collections.abc import Iterator, Mapping
from xml.etree import ElementTree

import numpy as np

from simbev_ros.errors import SimulationError
from simbev_ros.maps.lane_kind import LaneKind
from simbev_ros.maps.network import RoadNetwork

_WALKABLE = (LaneKind.SIDEWALK, LaneKind.WALKING_AREA, LaneKind.CROSSING)
_MOST_REACHED = 300  # bounds the search for a walk's destination on large maps


class StreetGraph:
    """Which edges one can drive on after which, for one vehicle class."""

    def __init__(self, network: RoadNetwork, net: ElementTree.Element, sumo_class: str) -> None:
        """Build the graph.

        Args:
            network: The roads.
            net: Root of the same roads' SUMO net file, for the lanes' permissions.
            sumo_class: SUMO's vehicle class.
        """
        self._lanes = network.lanes
        self._sumo_class = sumo_class
        allowed = {lane.attrib["id"] for lane in net.iter("lane") if _allows(lane.attrib, sumo_class)}
        usable = {
            lane.id
            for lane in network.lanes.values()
            if lane.kind is LaneKind.DRIVING and not lane.junction and lane.id in allowed
        }
        self._following = {lane: tuple(dict.fromkeys(self._edges_after(lane, usable))) for lane in sorted(usable)}
        self._next: dict[str, tuple[str, ...]] = {}
        for lane, edges in self._following.items():
            edge = self._lanes[lane].edge
            self._next[edge] = tuple(dict.fromkeys((*self._next.get(edge, ()), *edges)))
        self._length_m = {network.lanes[lane].edge: network.lanes[lane].length_m for lane in sorted(usable)}
        self._endless = self._without_dead_ends()

    def route(self, start_lane: str, length_m: float, rng: np.random.Generator) -> tuple[str, ...]:
        """Edges of a random route from a lane, at least ``length_m`` long beyond the first edge.

        It ends early only where no edge follows. The first turn is one that the start lane itself allows, so that a
        vehicle that starts close to a junction need not change lanes at once.

        Raises:
            SimulationError: this vehicle class may not use the start lane.
        """
        if start_lane not in self._following:
            raise SimulationError(f"a vehicle of SUMO's class {self._sumo_class} cannot start on lane {start_lane}")
        route = [self._lanes[start_lane].edge]
        following = self._following[start_lane]
        while following and length_m > 0.0:
            choices = [edge for edge in following if edge in self._endless] or list(following)
            route.append(choices[int(rng.integers(len(choices)))])
            length_m -= self._length_m[route[-1]]
            following = self._next[route[-1]]
        return tuple(route)

    def _edges_after(self, lane: str, usable: set[str]) -> Iterator[str]:
        """Edges of the usable lanes behind a lane, through the junction's internal lanes."""
        waiting, seen = deque(self._lanes[lane].successors), {lane}
        while waiting:
            following = waiting.popleft()
            if following in usable:
                yield self._lanes[following].edge
            elif self._lanes[following].junction and following not in seen:
                seen.add(following)
                waiting.extend(self._lanes[following].successors)

    def _without_dead_ends(self) -> set[str]:
        """Edges from which one can drive on for ever."""
        endless = set(self._next)
        while dead := {edge for edge in endless if not endless.intersection(self._next[edge])}:
            endless -= dead
        return endless


class WalkGraph:
    """Which of sidewalks, walking areas and crossings touch; all of them are walked in both directions."""

    def __init__(self, network: RoadNetwork) -> None:
        walkable = {lane.id: lane for lane in network.lanes.values() if lane.kind in _WALKABLE}
        self._length_m = {lane.edge: lane.length_m for lane in walkable.values() if lane.kind is LaneKind.SIDEWALK}
        neighbours: dict[str, dict[str, None]] = defaultdict(dict)
        for lane in walkable.values():
            for successor in lane.successors:
                if successor in walkable:
                    neighbours[lane.edge][walkable[successor].edge] = None
                    neighbours[walkable[successor].edge][lane.edge] = None
        self._neighbours = {edge: tuple(touching) for edge, touching in neighbours.items()}

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


def _allows(lane: Mapping[str, str], sumo_class: str) -> bool:
    """Whether SUMO lets a vehicle class use a lane."""
    if "allow" in lane:
        return bool({"all", sumo_class}.intersection(lane["allow"].split()))
    return not {"all", sumo_class}.intersection(lane.get("disallow", "").split())
