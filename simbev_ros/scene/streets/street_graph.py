"""Where vehicles can drive: which street leads to which, how far one gets, and random routes long enough for a scene.

Since nobody reaches an end where that can be avoided, nobody has to be re-routed, removed or inserted in a scene.
"""

from collections.abc import Mapping, Set
from copy import copy
from functools import cache, cached_property, lru_cache
from itertools import compress

import numpy as np
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import connected_components

from simbev_ros.errors import SimulationError
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.polylines import Polylines
from simbev_ros.scene.blueprints import Blueprint, Footprint
from simbev_ros.scene.streets.off_tracking import is_long
from simbev_ros.scene.streets.tight_turns import tight_lanes
from simbev_ros.types import BoolArray, Float64Array, Int64Array

_LANES_IN_A_JUNCTION = 20  # more never follow each other inside of one; bounds the search in a broken net
_ABOUT = 0.9  # the two directions of a road that is all there is are about equally long


class Streets:
    """The driving lanes of a map and what follows them, for all vehicle classes."""

    def __init__(self, network: RoadNetwork, edges: Set[str] | None = None) -> None:
        """All of a map, or only those on the given edges."""
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
        self.edge_length_m[self.edge] = Polylines.of([lane.centerline_m for lane in self.lanes]).length_m
        self._network = network
        self.for_class = cache(self._for_class)
        self._for_body = cache(self._for_long)
        self._avoiding = lru_cache(maxsize=64)(StreetGraph.avoiding)

    def open_to(self, sumo_class: str) -> BoolArray:
        """(L,) whether a class may use each lane."""
        return np.array([sumo_class in lane.classes for lane in self.lanes], bool)

    def for_blueprint(
        self, blueprint: Blueprint, closed: frozenset[str] = frozenset(), tight: bool = False
    ) -> "StreetGraph":
        """The graph of a blueprint: without the turns that are too tight for it, unless it takes ``tight`` ones, too.

        No way leads onto ``closed`` edges.
        """
        if tight or not is_long(blueprint):
            graph = self.for_class(blueprint.sumo_class)
        else:
            graph = self._for_body(blueprint.sumo_class, blueprint.footprint)
        return self._avoiding(graph, closed) if closed else graph

    def _for_class(self, sumo_class: str) -> "StreetGraph":
        """The graph of one of SUMO's vehicle classes."""
        return StreetGraph(self, sumo_class, self.open_to(sumo_class))

    def _for_long(self, sumo_class: str, body: Footprint) -> "StreetGraph":
        """The graph of long vehicles of a class."""
        tight = streets_of(self._network).tight[body][self._kept]
        return StreetGraph(self, sumo_class, self.open_to(sumo_class) & ~tight)

    @cached_property
    def tight(self) -> Mapping[Footprint, BoolArray]:
        """For each long vehicle's footprint, (L,) which lanes it must not take; to be asked for all of a map."""
        return tight_lanes(self._network, self.following)


_latest: list[tuple[RoadNetwork, Streets]] = []


def streets_of(network: RoadNetwork) -> Streets:
    """All streets of a map, kept for the map that was asked for last."""
    if not _latest or _latest[0][0] is not network:
        _latest[:] = [(network, Streets(network))]
    return _latest[0][1]


class StreetGraph:
    """Which edges one can drive on after which lanes, for one vehicle class."""

    def __init__(self, streets: Streets, sumo_class: str, usable: BoolArray) -> None:
        """With the (L,) usable lanes."""
        self._streets = streets
        self._sumo_class = sumo_class
        self._starts = usable & streets.outside
        self._after_lane = _edges_after(streets, usable)
        count = len(streets.edges)
        lane, edge = self._after_lane.nonzero()
        self._after_edge = _relation(streets.edge[lane], edge, (count, count))
        self._beyond_m = _way_beyond(self._after_edge, streets.edge_length_m)
        _, component = connected_components(self._after_edge, directed=True, connection="weak")
        used_m = np.where(np.isin(np.arange(count), streets.edge[self._starts]), streets.edge_length_m, 0.0)
        self._component_m = np.bincount(component, used_m, count)[component]
        self._beyond_lane_m = self._way_beyond_lanes()

    def _way_beyond_lanes(self) -> Float64Array:
        """(L,) length of the longest way behind each lane's end."""
        beyond_m = np.zeros(len(self._streets.lanes))
        lane, edge = self._after_lane.nonzero()
        np.maximum.at(beyond_m, lane, self._streets.edge_length_m[edge] + self._beyond_m[edge])
        return beyond_m

    def endless(self, edges: Set[str]) -> bool:
        """Whether one can drive on for ever behind each of some edges."""
        return all(np.isinf(self._beyond_m[self._streets.edge_number[edge]]) for edge in edges)

    @cached_property
    def _leading(self) -> csr_array:
        """(E, E) which edges lead to each."""
        return self._after_edge.T.tocsr()

    def cut_off(self, closed: Set[str]) -> frozenset[str]:
        """The ``closed`` edges, and all from which one gets to nothing but them and dead ends, though not before."""
        cut: set[int] = set()
        numbers = self._streets.edge_number
        waiting = [numbers[edge] for edge in sorted(closed) if edge in numbers]
        while waiting:
            cut.add(edge := waiting.pop())
            for before in map(int, _row(self._leading, edge)):
                onward = [int(each) for each in _row(self._after_edge, before) if int(each) not in cut]
                if (
                    before not in cut
                    and np.isinf(self._beyond_m[before])
                    and not np.isinf(self._beyond_m[onward]).any()
                ):
                    waiting.append(before)
        return frozenset(self._streets.edges[edge] for edge in cut)

    def avoiding(self, closed: Set[str]) -> "StreetGraph":
        """The same without ways onto ``closed`` edges, and onto those that are cut off by that."""
        cut = np.zeros(len(self._streets.edges), bool)
        cut[[self._streets.edge_number[edge] for edge in self.cut_off(closed)]] = True
        graph = copy(self)
        vars(graph).pop("_leading", None)
        graph._after_lane = _without(self._after_lane, cut)
        graph._after_edge = _without(self._after_edge, cut)
        graph._beyond_lane_m = graph._way_beyond_lanes()
        return graph

    def fit(self, row: Int64Array, s_m: Float64Array, way_m: float) -> BoolArray:
        """Where a vehicle ``gets_far``; where that is nowhere possible, all of the largest part."""
        enough, may_start = self.gets_far(row, s_m, way_m), self._starts[row]
        component_m = np.where(may_start, self._component_m[self._streets.edge[row]], 0.0)
        return enough if enough.any() else may_start & (component_m >= _ABOUT * component_m.max(initial=0.0))

    def gets_far(self, row: Int64Array, s_m: Float64Array, way_m: float) -> BoolArray:
        """Where a vehicle can start and then drive ``way_m``.

        Streets count only once: who can but go round on a small island does not get far.

        Args:
            row: (N,) which of ``Streets.lanes`` each place is on.
            s_m: (N,) distance from the lane's start.
            way_m: How far.

        Returns:
            (N,) whether each place is fit.
        """
        edge, may_start = self._streets.edge[row], self._starts[row]
        ahead_m = self._streets.edge_length_m[edge] - s_m + self._beyond_lane_m[row]
        enough: BoolArray = may_start & (np.minimum(ahead_m, self._component_m[edge]) >= way_m)
        return enough

    def leads_on(self, start_lane: str) -> bool:
        """Whether one can drive on from a lane."""
        return bool(len(_row(self._after_lane, self._streets.row[start_lane])))

    def ends_at(self, edge: str) -> bool:
        """Whether nothing follows an edge."""
        return not len(_row(self._after_edge, self._streets.edges.index(edge)))

    def route(self, start_lane: str, length_m: float, rng: np.random.Generator) -> tuple[str, ...]:
        """Edges of a random route from a lane, at least ``length_m`` long beyond the first edge.

        It ends early only where no way is that long; then it is the longest. The first turn is one that the start lane
        itself allows, so that a vehicle that starts close to a junction need not change lanes at once.

        Raises:
            SimulationError: this vehicle class may not use the start lane.
        """
        row = self._streets.row.get(start_lane, -1)
        if row < 0 or not self._starts[row]:
            raise SimulationError(f"a vehicle of SUMO's class {self._sumo_class} cannot start on lane {start_lane}")
        start = self._streets.edges[self._streets.edge[row]]
        return start, *self._onward(_row(self._after_lane, row), length_m, rng)

    def onward(self, edge: str, length_m: float, rng: np.random.Generator) -> tuple[str, ...]:
        """Edges of a random route after an edge, as ``route``."""
        return self._onward(_row(self._after_edge, self._streets.edges.index(edge)), length_m, rng)

    def lane_of(self, edge: str) -> str:
        """Id of the first lane of an edge that the class may use."""
        on_edge = self._streets.edge == self._streets.edges.index(edge)
        return self._streets.lanes[int(np.flatnonzero(on_edge & self._starts)[0])].id

    def _onward(self, following: Int64Array, length_m: float, rng: np.random.Generator) -> tuple[str, ...]:
        route: list[int] = []
        while len(following) and length_m > 0.0:
            way_m = self._streets.edge_length_m[following] + self._beyond_m[following]
            choices = following[way_m >= min(length_m, way_m.max())]
            route.append(int(choices[rng.integers(len(choices))]))
            length_m -= self._streets.edge_length_m[route[-1]]
            following = _row(self._after_edge, route[-1])
        return tuple(self._streets.edges[edge] for edge in route)


def _relation(first: Int64Array, second: Int64Array, shape: tuple[int, int]) -> csr_array:
    """The pairs as a boolean matrix, columns ascending."""
    relation = coo_array((np.ones(len(first), bool), (first, second)), shape=shape).tocsr()
    relation.sum_duplicates()
    relation.sort_indices()
    return relation


def _without(relation: csr_array, columns: BoolArray) -> csr_array:
    """The relation to other than some of the columns."""
    first, second = relation.nonzero()
    kept = ~columns[second]
    return _relation(first[kept], second[kept], relation.shape)


def _row(relation: csr_array, row: int) -> Int64Array:
    """What one row is related to."""
    columns: Int64Array = relation.indices[relation.indptr[row] : relation.indptr[row + 1]]
    return columns


def _edges_after(streets: Streets, usable: BoolArray) -> csr_array:
    """(L, E) edges behind the usable lanes outside junctions, through the junctions' lanes."""
    count = len(streets.lanes)
    pairs = streets.following[usable[streets.following].all(axis=1)]
    steps = _relation(pairs[:, 0], pairs[:, 1], (count, count))
    lane, here = np.flatnonzero(usable & streets.outside), np.flatnonzero(usable & streets.outside)
    lanes, edges = [np.empty(0, np.int64)], [np.empty(0, np.int64)]
    for _ in range(_LANES_IN_A_JUNCTION):
        index, there = steps[here].nonzero()
        lane, arrived = lane[index], streets.outside[there]
        lanes.append(lane[arrived])
        edges.append(streets.edge[there[arrived]])
        lane, here = lane[~arrived], there[~arrived]
        if not len(here):
            break
    return _relation(np.concatenate(lanes), np.concatenate(edges), (count, len(streets.edges)))


def _way_beyond(following: csr_array, length_m: Float64Array) -> Float64Array:
    """(E,) length of the longest way behind each edge's end; infinite where one can drive on for ever.

    Dead ends are taken away one after the other, last ones first, so that an edge's followers are done before it is.
    """
    leading = following.T.tocsr()
    left = np.diff(following.indptr)
    beyond_m = np.zeros(len(length_m))
    endless = np.ones(len(length_m), bool)
    done = np.flatnonzero(left == 0)
    while len(done):
        endless[done] = False
        index, before = leading[done].nonzero()
        np.maximum.at(beyond_m, before, (length_m + beyond_m)[done[index]])
        np.subtract.at(left, before, 1)
        done = np.unique(before[left[before] == 0])
    return np.where(endless, np.inf, beyond_m)
