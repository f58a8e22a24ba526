"""Where vehicles of a class can drive: the distance that can be driven from a lane, and random routes.

Routes are long enough for a whole scene and avoid dead ends where possible, so that no vehicle has to be re-routed,
removed or inserted during a scene.
"""

from collections.abc import Set
from copy import copy
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components, dijkstra

from simbev_ros.foundation.errors import SimulationError
from simbev_ros.foundation.types import BoolArray, Float64Array, Int64Array
from simbev_ros.scene.streets.relations import (
    between_groups,
    longest_path_beyond,
    loops,
    only_pairs,
    related,
    without_columns,
)
from simbev_ros.scene.streets.turns import without_needless_turns

if TYPE_CHECKING:
    from simbev_ros.scene.streets.streets import Streets

_MAX_TRAP_M, _TRAP_SHARE = 1000.0, 0.5  # a loop that is shorter, and less than half as long as the longest one
_MIN_OPEN_SHARE = 0.75
_MIN_TURN_ROAD_M = 30.0  # on a shorter road, those who wait for others to turn would block the junction behind them
_COMPONENT_TOLERANCE = (
    0.9  # tolerance for "the largest part": the two directions of a single road differ slightly in length
)


class StreetGraph:
    """Reachability between lanes and edges for one vehicle class."""

    def __init__(self, streets: "Streets", sumo_class: str, usable: BoolArray) -> None:
        """From a mask of the (L,) lanes that the class may use."""
        self._streets = streets
        self._sumo_class = sumo_class
        self._usable = usable
        self._starts = usable & streets.outside
        after_lane = streets.edges_after(usable)
        turns = streets.turns.lead_back(*after_lane.nonzero())
        if not streets.is_closed:
            roomy = ~(turns & (streets.edge_length_m[streets.edge[after_lane.nonzero()[0]]] < _MIN_TURN_ROAD_M))
            after_lane, turns = only_pairs(after_lane, roomy), turns[roomy]
        self._turns = between_groups(only_pairs(after_lane, turns), streets.edge)
        without_turns = without_needless_turns(after_lane, turns, streets.edge)
        variants = without_turns, after_lane
        longest_m = 0.0 if streets.is_closed else max(map(self._longest_loop_m, variants))
        self._trap_m = min(_MAX_TRAP_M, _TRAP_SHARE * longest_m)
        self._set_successors(without_turns)
        if not np.isinf(self._beyond_m).any():
            self._set_successors(after_lane)  # on a map cut out of a city, turns may be all that leads back into it
        count = len(streets.edges)
        _, component = connected_components(self._after_edge, directed=True, connection="weak")
        used_m = np.where(np.isin(np.arange(count), streets.edge[self._starts]), streets.edge_length_m, 0.0)
        self._component_m = np.bincount(component, used_m, count)[component]
        self._beyond_lane_m = self._longest_path_beyond_lanes()

    def _set_successors(self, after_lane: csr_array) -> None:
        """Set the edges after lanes and after edges, and the lengths of the longest paths beyond edges."""
        self._after_lane = after_lane
        self._after_edge = between_groups(after_lane, self._streets.edge)
        self._beyond_m = longest_path_beyond(self._after_edge, self._streets.edge_length_m, self._trap_m)

    def _longest_loop_m(self, after_lane: csr_array) -> float:
        """Total length of the edges from each of which all others can be reached, where it is greatest."""
        after_edge = between_groups(after_lane, self._streets.edge)
        return float(loops(after_edge, self._streets.edge_length_m).length_m.max(initial=0.0))

    def _longest_path_beyond_lanes(self) -> Float64Array:
        """(L,) length of the longest path beyond each lane's end."""
        beyond_m = np.zeros(len(self._streets.lanes))
        lane, edge = self._after_lane.nonzero()
        np.maximum.at(beyond_m, lane, self._streets.edge_length_m[edge] + self._beyond_m[edge])
        return beyond_m

    def never_ends(self, edges: Set[str]) -> bool:
        """Whether an endless path exists beyond each of these edges."""
        return all(np.isinf(self._beyond_m[self._streets.edge_number[edge]]) for edge in edges)

    @cached_property
    def _predecessors(self) -> csr_array:
        """(E, E) relation from each edge to the edges that lead to it."""
        return self._after_edge.T.tocsr()

    def cut_off_edges(self, closed: Set[str]) -> frozenset[str]:
        """The ``closed`` edges, and all edges that lead only to them and to dead ends because of the closure."""
        cut: set[int] = set()
        numbers = self._streets.edge_number
        pending = [numbers[edge] for edge in sorted(closed) if edge in numbers]
        while pending:
            cut.add(edge := pending.pop())
            for before in map(int, related(self._predecessors, edge)):
                onward = [int(each) for each in related(self._after_edge, before) if int(each) not in cut]
                if (
                    before not in cut
                    and np.isinf(self._beyond_m[before])
                    and not np.isinf(self._beyond_m[onward]).any()
                ):
                    pending.append(before)
        return frozenset(self._streets.edges[edge] for edge in cut)

    def without_edges(self, closed: Set[str]) -> "StreetGraph":
        """This graph without paths onto ``closed`` edges and onto the edges that they cut off."""
        cut = np.zeros(len(self._streets.edges), bool)
        cut[[self._streets.edge_number[edge] for edge in self.cut_off_edges(closed)]] = True
        graph = copy(self)
        vars(graph).pop("_predecessors", None)
        graph._after_lane = without_columns(self._after_lane, cut)
        graph._after_edge = without_columns(self._after_edge, cut)
        graph._beyond_lane_m = graph._longest_path_beyond_lanes()
        return graph

    def usable_starts(self, row: Int64Array, s_m: Float64Array, distance_m: float) -> BoolArray:
        """(N,) starts from which a vehicle ``can_drive`` a distance.

        On small maps without such a start, those on the largest part from which streets, driven repeatedly, lead that
        far; if there are none either, all on the largest part.
        """
        is_enough, may_start = self.can_drive(row, s_m, distance_m), self._starts[row]
        if is_enough.any():
            return is_enough
        component_m = np.where(may_start, self._component_m[self._streets.edge[row]], 0.0)
        is_on_largest: BoolArray = may_start & (component_m >= _COMPONENT_TOLERANCE * component_m.max(initial=0.0))
        leads_far = is_on_largest & (self._ahead_m(row, s_m) >= distance_m)
        return leads_far if leads_far.any() else is_on_largest

    def can_drive(self, row: Int64Array, s_m: Float64Array, distance_m: float) -> BoolArray:
        """(N,) whether a vehicle can start at each position and then drive ``distance_m``.

        Each street counts only once: a vehicle that can only circle on a small island cannot drive far.

        Args:
            row: (N,) index into ``Streets.lanes`` of each position's lane.
            s_m: (N,) distance from the lane's start.
            distance_m: Required distance.
        """
        component_m = self._component_m[self._streets.edge[row]]
        return self._starts[row] & (np.minimum(self._ahead_m(row, s_m), component_m) >= distance_m)

    def _ahead_m(self, row: Int64Array, s_m: Float64Array) -> Float64Array:
        """(N,) length of the longest path from each position; streets count as often as they are driven."""
        return self._streets.edge_length_m[self._streets.edge[row]] - s_m + self._beyond_lane_m[row]

    def loop_lanes_m(self) -> float:
        """Total length of the lanes on which vehicles can circulate; 0 if all paths end."""
        number, loop_m = loops(self._after_edge, self._streets.edge_length_m)
        circulates = (loop_m > 0.0)[number] & np.isinf(self._beyond_m)
        rows = np.flatnonzero(self._starts)
        return float(self._streets.edge_length_m[self._streets.edge[rows]] @ circulates[self._streets.edge[rows]])

    def keeps_loops(self, closed: Set[str]) -> bool:
        """Whether, with these edges closed, vehicles can still circulate on most of the streets where they can now."""
        open_m = self.loop_lanes_m()
        return self._streets.is_closed or self.without_edges(closed).loop_lanes_m() >= _MIN_OPEN_SHARE * open_m

    def turns_at_ends(self) -> dict[str, str]:
        """Edges that only a turn follows, at the ends of roads, each with the edge that leads back."""
        pairs = zip(*self._turns.nonzero(), strict=True)
        only = [(there, back) for there, back in pairs if len(related(self._after_edge, there)) == 1]
        return {self._streets.edges[there]: self._streets.edges[back] for there, back in only}

    def has_successor(self, start_lane: str) -> bool:
        """Whether a vehicle can drive on beyond a lane."""
        return bool(len(related(self._after_lane, self._streets.row[start_lane])))

    def is_dead_end(self, edge: str) -> bool:
        """Whether no edge follows an edge."""
        return not len(related(self._after_edge, self._streets.edge_number[edge]))

    def draw_route(self, start_lane: str, length_m: float, rng: np.random.Generator) -> tuple[str, ...]:
        """Draw a random route from a lane: its edges, at least ``length_m`` long beyond the first edge.

        The route is shorter only where no path is that long; then it is the longest one. Its first turn is one that the
        start lane allows, so that a vehicle starting close to a junction need not change lanes at once.

        Raises:
            SimulationError: This vehicle class may not use the start lane.
        """
        row = self._streets.row.get(start_lane, -1)
        if row < 0 or not self._starts[row]:
            raise SimulationError(f"a vehicle of SUMO's class {self._sumo_class} cannot start on lane {start_lane}")
        start = int(self._streets.edge[row])
        return self._streets.edges[start], *self._draw_onward(start, related(self._after_lane, row), length_m, rng)

    def draw_route_without_lane_changes(
        self, start_lane: str, lanes_m: float, length_m: float, rng: np.random.Generator
    ) -> tuple[str, ...]:
        """Draw a random route as ``draw_route`` does, but without lane changes for the first ``lanes_m``.

        Raises:
            SimulationError: This vehicle class may not use the start lane.
        """
        edges: list[str] = []
        lane = start_lane
        while lanes_m > 0.0 and len(following := self._lanes_after(self._streets.row[lane])):
            edges.append(self._streets.lanes[self._streets.row[lane]].edge)
            edge, next_edges = int(self._streets.edge[self._streets.row[lane]]), self._streets.edge[following]
            choices = following[np.isin(next_edges, self._onward_choices(edge, np.unique(next_edges), length_m))]
            lane = self._streets.lanes[int(choices[rng.integers(len(choices))])].id
            lanes_m -= self._streets.lanes[self._streets.row[lane]].length_m
        return *edges, *self.draw_route(lane, length_m, rng)

    def _lanes_after(self, row: int) -> Int64Array:
        """Rows of the usable lanes outside junctions that are reached from a lane without changing lanes."""
        reached: Int64Array = self._streets.lanes_after(np.array([row]), self._usable)
        return reached[np.isin(self._streets.edge[reached], related(self._after_lane, row))]

    def draw_continuation(self, edge: str, length_m: float, rng: np.random.Generator) -> tuple[str, ...]:
        """Draw the edges of a random route after an edge, with the rules of ``draw_route``."""
        start = self._streets.edge_number[edge]
        return self._draw_onward(start, related(self._after_edge, start), length_m, rng)

    def shortest_path(self, edge: str, goal: str) -> tuple[str, ...]:
        """Edges after an edge on the shortest path to another one, which is the last; empty if there is no path."""
        streets, start, end = self._streets, self._streets.edge_number[edge], self._streets.edge_number[goal]
        before, after = self._after_edge.nonzero()
        lengths_m = csr_array((streets.edge_length_m[after], (before, after)), self._after_edge.shape)
        distance_m, previous = dijkstra(lengths_m, indices=start, return_predecessors=True)
        if start == end or np.isinf(distance_m[end]):
            return ()
        path = [end]
        while previous[path[-1]] != start:
            path.append(int(previous[path[-1]]))
        return tuple(streets.edges[each] for each in reversed(path))

    def distances_m(self, edge: str, *, ahead: bool) -> Float64Array:
        """(E,) length of the shortest path from the start of an edge to that of each edge or, if not ahead, back.

        Junctions have no length. Infinite where there is no path.
        """
        before, after = self._after_edge.nonzero()
        pairs = (before, after) if ahead else (after, before)
        lengths_m = csr_array((self._streets.edge_length_m[before], pairs), self._after_edge.shape)
        distance_m: Float64Array = dijkstra(lengths_m, indices=self._streets.edge_number[edge])
        return distance_m

    def first_lane(self, edge: str) -> str:
        """Id of the first lane of an edge that the class may use."""
        on_edge = self._streets.edge == self._streets.edge_number[edge]
        return self._streets.lanes[int(np.flatnonzero(on_edge & self._starts)[0])].id

    def _draw_onward(
        self, edge: int, following: Int64Array, length_m: float, rng: np.random.Generator
    ) -> tuple[str, ...]:
        """Draw edges after an edge, the first one of those ``following``."""
        route: list[int] = []
        while len(following) and length_m > 0.0:
            choices = self._onward_choices(edge, following, length_m)
            edge = int(choices[rng.integers(len(choices))])
            route.append(edge)
            length_m -= self._streets.edge_length_m[edge]
            following = related(self._after_edge, edge)
        return tuple(self._streets.edges[edge] for edge in route)

    def _onward_choices(self, edge: int, following: Int64Array, length_m: float) -> Int64Array:
        """The following edges of an edge from which the longest paths lead, of at least ``length_m`` if there are any.

        On a map cut out of a city, a vehicle does not turn back onto its road where it can drive on.
        """
        distance_m = self._streets.edge_length_m[following] + self._beyond_m[following]
        choices = following[distance_m >= min(length_m, distance_m.max())]
        if self._streets.is_closed or not len(turns := related(self._turns, edge)):
            return choices
        onward = choices[~np.isin(choices, turns)]
        return onward if len(onward) else choices
