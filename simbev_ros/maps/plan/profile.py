"""Heights of a plan: roads follow the land as far as grades, vertical curves and clearances allow.

All heights are found at once, as the solution of one quadratic programme: as close to the wanted heights and as smooth
as possible within the limits. Near a node all heights lie on one plane, so that junctions are even.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely
from scipy.sparse import coo_array, csc_array, csr_array, diags_array, vstack
from scipy.sparse.csgraph import dijkstra

from simbev_ros.maps.features import Water
from simbev_ros.maps.plan.crossings import crossings_of
from simbev_ros.maps.plan.draft import RoadClass
from simbev_ros.maps.plan.lines import densified, stations_m
from simbev_ros.maps.plan.plan import Link, Plan, half_width_m, heading_from
from simbev_ros.maps.plan.quadratic import solve
from simbev_ros.types import BoolArray, Float64Array, Int64Array

CLEARANCE_M = 6.5
"""Between the carriageways of roads that cross at different heights: 5.5 m free, and a deck of 1 m."""
_CLEARANCE_MARGIN_M = 0.15
_ABOVE_WATER_M = 3.0
_ABOVE_BANK_M = 1.0
_BANK_M = 15.0
_MARGIN = 0.96
_JUNCTION_RISE_M = 0.12  # netconvert makes junctions level whose roads rise more inside them
_SMOOTHING_M = 20.0
_APPROACH_GRADE = 0.035
_THROUGH_NODE_M = 4.0
_MOST_OF_LINK = 0.35
_PARALLEL_SINE = 0.35
_SMALLEST_SINE = 0.5
_NODE_UNKNOWNS = 3

Land = Callable[[Float64Array], Float64Array]
"""(N,) heights of the land at (N, 2) points."""


@dataclass(frozen=True, slots=True)
class _Limits:
    """A block of rows ``low <= rows @ heights <= high``, over vertices or over unknowns; 0.01 is a small violation."""

    rows: csr_array
    low: Float64Array
    high: Float64Array

    def over(self, basis: csr_array) -> "_Limits":
        """Limits of vertices as limits of unknowns."""
        return _Limits(self.rows @ basis, self.low, self.high)


@dataclass(frozen=True, slots=True)
class _Vertices:
    """All vertices of all links, one after the other.

    Attributes:
        xy_m: (M, 2).
        link: (M,) index of the link.
        station_m: (M,) distance from the link's start; to_end_m: to its end.
        first: (L + 1,) index of each link's first vertex.
    """

    xy_m: Float64Array
    link: Int64Array
    station_m: Float64Array
    to_end_m: Float64Array
    first: Int64Array


def largest_grade(kind: RoadClass) -> float:
    """Height by distance, at most."""
    return 0.08 if kind.speed_kmh <= 70.0 else 0.05


def largest_bend_per_m(kind: RoadClass) -> float:
    """Change of grade by distance, at most: crests and sags of 550 m radius in streets, 2 km on motorways."""
    return 0.0018 if kind.speed_kmh <= 60.0 else 0.001 if kind.speed_kmh <= 90.0 else 0.0005


def with_heights(plan: Plan, land: Land, water: Sequence[Water]) -> Plan:
    """The plan with (N, 3) lines, vertices at most 5 m apart, and (K, 3) nodes."""
    plan = replace(plan, links=tuple(replace(link, line_m=densified(link.line_m)) for link in plan.links))
    vertices = _vertices(plan.links)
    reach_m, gradient = _planes(plan)
    basis = _basis(plan, vertices, reach_m)
    weight, wanted_m = _wanted(plan, vertices, land)
    bends, bend_weight = _bends(plan, vertices)
    quadratic = diags_array(weight) + bends.T @ diags_array(bend_weight) @ bends
    gradient_weight = np.zeros(basis.shape[1])
    gradient_weight[: _NODE_UNKNOWNS * len(plan.nodes_m)].reshape(-1, _NODE_UNKNOWNS)[:, 1:] = 10.0
    limits = [block.over(basis) for block in _over_vertices(plan, vertices, bends, water)]
    limits.append(_gradient_limits(gradient, basis.shape[1]))
    solution = solve(
        csc_array(basis.T @ quadratic @ basis + diags_array(gradient_weight)),
        basis.T @ (weight * wanted_m),
        csr_array(vstack([block.rows for block in limits])),
        np.concatenate([block.low for block in limits]),
        np.concatenate([block.high for block in limits]),
    )
    return _raised(plan, vertices, basis @ solution, solution)


def _vertices(links: Sequence[Link]) -> _Vertices:
    counts = [len(link.line_m) for link in links]
    stations = [stations_m(link.line_m) for link in links]
    return _Vertices(
        np.concatenate([link.line_m for link in links]),
        np.repeat(np.arange(len(links)), counts),
        np.concatenate(stations),
        np.concatenate([along_m[-1] - along_m for along_m in stations]),
        np.concatenate([[0], np.cumsum(counts)]),
    )


def _headings(plan: Plan) -> list[Float64Array]:
    """For each node (A, 2) unit vectors along which its links leave."""
    return [
        np.array([heading_from(link, node) for link in links]).reshape(-1, 2)
        for node, links in enumerate(plan.links_at())
    ]


def _is_through(ways: Float64Array) -> bool:
    """Whether all roads run in nearly one direction, as at bends, merges and changes of width."""
    return bool(np.all(np.abs(ways[:, 0] * ways[0, 1] - ways[:, 1] * ways[0, 0]) < _PARALLEL_SINE))


def _planes(plan: Plan) -> tuple[Float64Array, Float64Array]:
    """(K,) how far the plane of each node reaches along its links, and (K,) its largest gradient along x and along y."""
    reach_m, gradient = np.empty(len(plan.nodes_m)), np.empty(len(plan.nodes_m))
    for node, (links, ways) in enumerate(zip(plan.links_at(), _headings(plan), strict=True)):
        if _is_through(ways):
            reach_m[node] = _THROUGH_NODE_M
            gradient[node] = min(largest_grade(link.road.kind) for link in links)
        else:
            # As far as netconvert's junctions reach: further where roads meet at a sharp angle.
            cosine = np.max((ways @ ways.T)[~np.eye(len(ways), dtype=bool)], initial=0.0)
            widest_m = max(half_width_m(link.road.kind) + link.road.kind.corner_radius_m for link in links)
            reach_m[node] = widest_m / max(np.sqrt(max(1.0 - cosine**2, 0.0)), _SMALLEST_SINE) + 2.0
            gradient[node] = _JUNCTION_RISE_M / reach_m[node]
    return reach_m, gradient


def _basis(plan: Plan, vertices: _Vertices, reach_m: Float64Array) -> csr_array:
    """(M, U) heights of vertices from unknowns: height and gradient of each node, then heights of free vertices."""
    ends = np.array([(link.start, link.end) for link in plan.links])[vertices.link]
    length_m = vertices.station_m + vertices.to_end_m
    near_start = vertices.station_m <= np.minimum(reach_m[ends[:, 0]], _MOST_OF_LINK * length_m)
    near_end = vertices.to_end_m <= np.minimum(reach_m[ends[:, 1]], _MOST_OF_LINK * length_m)
    bound = np.flatnonzero(near_start | near_end)
    free = np.flatnonzero(~(near_start | near_end))
    node = np.where(near_start, ends[:, 0], ends[:, 1])[bound]
    from_node_m = vertices.xy_m[bound] - plan.nodes_m[node]
    row = np.concatenate([np.repeat(bound, _NODE_UNKNOWNS), free])
    column = np.concatenate(
        [
            (_NODE_UNKNOWNS * node[:, None] + np.arange(_NODE_UNKNOWNS)).ravel(),
            _NODE_UNKNOWNS * len(plan.nodes_m) + np.arange(len(free)),
        ]
    )
    value = np.concatenate([np.column_stack([np.ones(len(bound)), from_node_m]).ravel(), np.ones(len(free))])
    shape = (len(vertices.xy_m), _NODE_UNKNOWNS * len(plan.nodes_m) + len(free))
    return csr_array(coo_array((value, (row, column)), shape=shape))


def _wanted(plan: Plan, vertices: _Vertices, land: Land) -> tuple[Float64Array, Float64Array]:
    """(M,) weights and (M,) wanted heights: the land, or above it for elevated roads."""
    roads = [link.road for link in plan.links]
    elevated_m = np.array([road.elevated_m for road in roads])[vertices.link]
    ground_m = _distance_to_ground_m(plan)
    ends = np.array([(link.start, link.end) for link in plan.links])[vertices.link]
    away_m = np.minimum(ground_m[ends[:, 0]] + vertices.station_m, ground_m[ends[:, 1]] + vertices.to_end_m)
    lift_m = np.minimum(elevated_m, _APPROACH_GRADE * away_m)
    importance = np.array([0.2 if road.elevated_m > 0.0 else 0.02 if road.layer != 0 else 1.0 for road in roads])
    share_m = np.zeros(len(vertices.xy_m))
    step_m = np.diff(vertices.station_m)
    inside = np.diff(vertices.link) == 0
    share_m[:-1] += np.where(inside, step_m, 0.0) / 2.0
    share_m[1:] += np.where(inside, step_m, 0.0) / 2.0
    return importance[vertices.link] * share_m, land(vertices.xy_m) + lift_m


def _distance_to_ground_m(plan: Plan) -> Float64Array:
    """(K,) way along elevated roads to the nearest node at which a road on the ground starts; inf where none does."""
    count = len(plan.nodes_m)
    elevated = [link for link in plan.links if link.road.elevated_m > 0.0]
    ground = sorted({node for link in plan.links if link.road.elevated_m == 0.0 for node in (link.start, link.end)})
    if not elevated or not ground:
        return np.full(count, np.inf)
    length_m = [float(stations_m(link.line_m)[-1]) for link in elevated]
    ends = np.array([(link.start, link.end) for link in elevated])
    graph = csr_array(coo_array((length_m, (ends[:, 0], ends[:, 1])), shape=(count, count)))
    distance_m: Float64Array = dijkstra(graph, directed=False, indices=ground, min_only=True)
    return distance_m


def _bends(plan: Plan, vertices: _Vertices) -> tuple[csr_array, Float64Array]:
    """(B, M) changes of grade at inner vertices, and (B,) their weights."""
    middle = np.flatnonzero((vertices.station_m > 0.0) & (vertices.to_end_m > 0.0))
    before_m = vertices.station_m[middle] - vertices.station_m[middle - 1]
    after_m = vertices.station_m[middle + 1] - vertices.station_m[middle]
    row = np.tile(np.arange(len(middle)), 3)
    column = np.concatenate([middle - 1, middle, middle + 1])
    value = np.concatenate([1.0 / before_m, -1.0 / before_m - 1.0 / after_m, 1.0 / after_m])
    rows = csr_array(coo_array((value, (row, column)), shape=(len(middle), len(vertices.xy_m))))
    return rows, _SMOOTHING_M**4 * 2.0 / (before_m + after_m)


def _over_vertices(plan: Plan, vertices: _Vertices, bends: csr_array, water: Sequence[Water]) -> list[_Limits]:
    """All limits of heights of vertices."""
    return [
        _grade_limits(plan, vertices),
        _bend_limits(plan, vertices, bends),
        _clearance_limits(plan, vertices),
        _water_limits(plan, vertices, water),
    ]


def _grade_limits(plan: Plan, vertices: _Vertices) -> _Limits:
    start = np.flatnonzero(vertices.to_end_m > 0.0)
    step_m = vertices.station_m[start + 1] - vertices.station_m[start]
    steepest = np.array([largest_grade(link.road.kind) for link in plan.links])[vertices.link[start]]
    value = 1.0 / (steepest * step_m)
    row = np.tile(np.arange(len(start)), 2)
    rows = coo_array(
        (np.concatenate([-value, value]), (row, np.concatenate([start, start + 1]))),
        shape=(len(start), len(vertices.xy_m)),
    )
    return _Limits(csr_array(rows), np.full(len(start), -_MARGIN), np.full(len(start), _MARGIN))


def _bend_limits(plan: Plan, vertices: _Vertices, bends: csr_array) -> _Limits:
    middle = np.flatnonzero((vertices.station_m > 0.0) & (vertices.to_end_m > 0.0))
    around_m = (vertices.station_m[middle + 1] - vertices.station_m[middle - 1]) / 2.0
    sharpest = np.array([largest_bend_per_m(link.road.kind) for link in plan.links])[vertices.link[middle]] * around_m
    rows = csr_array(diags_array(1.0 / sharpest) @ bends)
    return _Limits(rows, np.full(len(middle), -_MARGIN), np.full(len(middle), _MARGIN))


def _clearance_limits(plan: Plan, vertices: _Vertices) -> _Limits:
    """The upper road's stations above the lower's, each with each."""
    rows = []
    for crossing in crossings_of(plan):
        upper = _height_at(vertices, crossing.upper, crossing.upper_m)
        lower = _height_at(vertices, crossing.lower, crossing.lower_m)
        rows += [upper[[a]] - lower[[b]] for a in range(3) for b in range(3)]
    matrix = csr_array(vstack(rows)) if rows else csr_array((0, len(vertices.xy_m)))
    count = matrix.shape[0]
    return _Limits(matrix, np.full(count, CLEARANCE_M + _CLEARANCE_MARGIN_M), np.full(count, np.inf))


def _height_at(vertices: _Vertices, link: int, stations: Float64Array) -> csr_array:
    """(S, M) heights at stations of a link, between its vertices."""
    first, last = vertices.first[link], vertices.first[link + 1] - 1
    along_m = vertices.station_m[first : last + 1]
    index = np.clip(np.searchsorted(along_m, stations, side="right") - 1, 0, last - first - 1)
    share = np.clip((stations - along_m[index]) / (along_m[index + 1] - along_m[index]), 0.0, 1.0)
    row = np.tile(np.arange(len(stations)), 2)
    column = first + np.concatenate([index, index + 1])
    value = np.concatenate([1.0 - share, share])
    return csr_array(coo_array((value, (row, column)), shape=(len(stations), len(vertices.xy_m))))


def _water_limits(plan: Plan, vertices: _Vertices, water: Sequence[Water]) -> _Limits:
    """Above water with room for boats, and never lower than a bank beside it."""
    lowest_m = np.full(len(vertices.xy_m), -np.inf)
    width_m = np.array([half_width_m(link.road.kind) for link in plan.links])[vertices.link]
    sunk = np.array([link.road.layer < 0 for link in plan.links])[vertices.link]
    points = shapely.points(vertices.xy_m)
    for body in water:
        shapely.prepare(body.area)
        distance_m = shapely.distance(points, body.area)
        above_m = np.where(distance_m <= 1.0, _ABOVE_WATER_M, _ABOVE_BANK_M)
        near = (distance_m <= _BANK_M + width_m) & ~sunk
        lowest_m = np.where(near, np.maximum(lowest_m, body.surface_m + above_m), lowest_m)
    bound = np.flatnonzero(np.isfinite(lowest_m))
    rows = coo_array((np.ones(len(bound)), (np.arange(len(bound)), bound)), shape=(len(bound), len(vertices.xy_m)))
    return _Limits(csr_array(rows), lowest_m[bound], np.full(len(bound), np.inf))


def _gradient_limits(gradient: Float64Array, unknowns: int) -> _Limits:
    """Of the planes at nodes, over unknowns."""
    column = (_NODE_UNKNOWNS * np.arange(len(gradient))[:, None] + [1, 2]).ravel()
    value = np.repeat(1.0 / gradient, 2)
    rows = coo_array((value, (np.arange(len(column)), column)), shape=(len(column), unknowns))
    return _Limits(csr_array(rows), np.full(len(column), -1.0), np.ones(len(column)))


def _raised(plan: Plan, vertices: _Vertices, height_m: Float64Array, unknowns: Float64Array) -> Plan:
    """The plan with these heights."""
    height_m = np.round(height_m, 3)
    links = tuple(
        replace(link, line_m=np.column_stack([link.line_m, height_m[vertices.first[i] : vertices.first[i + 1]]]))
        for i, link in enumerate(plan.links)
    )
    node_m = np.round(unknowns[: _NODE_UNKNOWNS * len(plan.nodes_m) : _NODE_UNKNOWNS], 3)
    return Plan(np.column_stack([plan.nodes_m, node_m]), links, plan.notes)
