"""From a draft to a plan: roads are divided where they meet, into links between nodes.

Roads meet where lines of one layer cross, where one ends on another, and where lines of any layers share a vertex.
Meeting places that are too close to each other for two junctions become one; dead ends get a turning circle.
"""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import shapely
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from simbev_ros.errors import InputError
from simbev_ros.maps.plan.dead_ends import with_turning_circles
from simbev_ros.maps.plan.draft import Draft, DraftRoad
from simbev_ros.maps.plan.lines import length_m, part, warped
from simbev_ros.maps.plan.plan import Link, Plan
from simbev_ros.maps.plan.sharp_angles import with_wide_angles
from simbev_ros.types import Float64Array

_SNAP_M = 10.0
_TOUCH_M = 0.01
_SHARED_M = 0.5
_ONE_PLACE_M = 4.0
_SHORTEST_LINK_M = 16.0


@dataclass(frozen=True, slots=True)
class _Mark:
    """A place where a road meets another, or ends."""

    road: int
    station_m: float
    place_m: Float64Array


@dataclass
class _Marks:
    """All of them, and which lie in one place."""

    marks: list[_Mark] = field(default_factory=list)
    same: list[tuple[int, int]] = field(default_factory=list)

    def add(self, road: int, station_m: float, place_m: Float64Array) -> int:
        """Index of a new mark."""
        self.marks.append(_Mark(road, station_m, place_m))
        return len(self.marks) - 1

    def join(self, first: int, second: int) -> None:
        """Two marks are one place."""
        self.same.append((first, second))


def divide(draft: Draft) -> Plan:
    """Nodes and links of a draft, in an order that depends on the draft alone.

    Raises:
        InputError: Two roads have one name, a line crosses itself, or a one-way road leads nowhere.
    """
    _check(draft.roads)
    roads = _lengthened(draft.roads)
    lines = [shapely.LineString(road.line_m) for road in roads]
    marks = _Marks()
    for index, (road, line) in enumerate(zip(roads, lines, strict=True)):
        for station_m, place_m in _ends(road, line):
            marks.add(index, station_m, place_m)
    _mark_crossings(roads, lines, marks)
    _mark_ends_on_lines(roads, lines, marks)
    _mark_shared_vertices(roads, lines, marks)
    plan = _without_short_links(_without_stubs(_links(roads, lines, marks)))
    return with_turning_circles(with_wide_angles(plan))


def _lengthened(roads: Sequence[DraftRoad]) -> list[DraftRoad]:
    """The roads; those that end just short of another of their layer are led on to it."""
    lines = [shapely.LineString(road.line_m) for road in roads]
    tree = shapely.STRtree(lines)
    longer = []
    for index, road in enumerate(roads):
        line_m = road.line_m
        for end, join_m in zip((0, -1), road.joins_m, strict=True):
            point = shapely.Point(road.line_m[end])
            near = tree.query(point, predicate="dwithin", distance=_SNAP_M).tolist()
            met = [lines[other] for other in near if other != index and roads[other].layer == road.layer]
            goes_on = any(
                np.linalg.norm(roads[other].line_m[[0, -1]] - line_m[end], axis=1).min() <= _SHARED_M
                for other in near
                if other != index
            )
            if join_m is None and not goes_on and met and min(point.distance(line) for line in met) > _TOUCH_M:
                nearest = min(met, key=point.distance)
                place_m = np.array(nearest.interpolate(nearest.project(point)).coords)
                line_m = np.concatenate([place_m, line_m] if end == 0 else [line_m, place_m])
        longer.append(replace(road, line_m=line_m))
    return longer


def _check(roads: Sequence[DraftRoad]) -> None:
    seen: set[str] = set()
    for road in roads:
        if road.name in seen:
            raise InputError(f"road {road.name}: two roads have this name")
        seen.add(road.name)
        if len(road.line_m) < 2 or length_m(road.line_m) < _SHORTEST_LINK_M / 2.0:
            raise InputError(f"road {road.name}: shorter than {_SHORTEST_LINK_M / 2.0:g} m")
        if not shapely.LineString(road.line_m).is_simple:
            raise InputError(f"road {road.name}: its line crosses itself; divide it, on two layers")


def _ends(road: DraftRoad, line: shapely.LineString) -> Iterator[tuple[float, Float64Array]]:
    """Station of both ends, and where they meet others."""
    for station_m, end, join_m in ((0.0, 0, road.joins_m[0]), (line.length, -1, road.joins_m[1])):
        yield station_m, road.line_m[end] if join_m is None else join_m


def _mark_crossings(roads: Sequence[DraftRoad], lines: Sequence[shapely.LineString], marks: _Marks) -> None:
    """Where lines of one layer cross."""
    first, second = shapely.STRtree(lines).query(lines, predicate="intersects")
    for a, b in zip(first.tolist(), second.tolist(), strict=True):
        if a < b and roads[a].layer == roads[b].layer:
            for place in _points_of(shapely.intersection(lines[a], lines[b])):
                place_m = np.array([place.x, place.y])
                marks.join(
                    marks.add(a, lines[a].project(place), place_m), marks.add(b, lines[b].project(place), place_m)
                )


def _points_of(shared: shapely.Geometry) -> Iterator[shapely.Point]:
    """Single places of an intersection; where lines run along each other, both ends of that stretch."""
    for piece in shapely.get_parts(shared):
        if piece.geom_type == "Point":
            yield piece
        elif piece.length > 0.0:
            yield from (shapely.Point(piece.coords[0]), shapely.Point(piece.coords[-1]))


def _mark_ends_on_lines(roads: Sequence[DraftRoad], lines: Sequence[shapely.LineString], marks: _Marks) -> None:
    """Where a road ends on another of its layer; the marks of its ends are the first ones, two for each road."""
    tree = shapely.STRtree(lines)
    for a, road in enumerate(roads):
        for end, join_m in enumerate(road.joins_m):
            point = shapely.Point(marks.marks[2 * a + end].place_m)
            if join_m is not None:
                continue
            for b in tree.query(point, predicate="dwithin", distance=_TOUCH_M).tolist():
                if b != a and roads[b].layer == road.layer:
                    marks.join(2 * a + end, marks.add(b, lines[b].project(point), marks.marks[2 * a + end].place_m))


def _mark_shared_vertices(roads: Sequence[DraftRoad], lines: Sequence[shapely.LineString], marks: _Marks) -> None:
    """Where lines of any layers have a vertex in common, or a road joins a vertex of another."""
    owner = np.repeat(np.arange(len(roads)), [len(road.line_m) for road in roads])
    vertices_m = np.concatenate([road.line_m for road in roads])
    tree = cKDTree(vertices_m)
    for first, second in sorted(tree.query_pairs(_SHARED_M)):
        a, b = int(owner[first]), int(owner[second])
        if a != b and roads[a].layer != roads[b].layer:
            marks.join(*(_vertex_mark(lines, marks, int(owner[v]), vertices_m[v]) for v in (first, second)))
    for a, road in enumerate(roads):
        for end, join_m in enumerate(road.joins_m):
            if join_m is None:
                continue
            met = [v for v in tree.query_ball_point(join_m, _SHARED_M) if owner[v] != a]
            if not met:
                raise InputError(f"road {road.name}: joins_m {join_m.tolist()} is no vertex of another road")
            for vertex in met:
                marks.join(2 * a + end, _vertex_mark(lines, marks, int(owner[vertex]), vertices_m[vertex]))


def _vertex_mark(lines: Sequence[shapely.LineString], marks: _Marks, road: int, vertex_m: Float64Array) -> int:
    return marks.add(road, lines[road].project(shapely.Point(vertex_m)), vertex_m)


def _links(roads: Sequence[DraftRoad], lines: Sequence[shapely.LineString], marks: _Marks) -> Plan:
    """Roads cut at their marks."""
    node_of = _clusters(roads, marks)
    by_road: dict[int, list[int]] = defaultdict(list)
    for index, mark in enumerate(marks.marks):
        by_road[mark.road].append(index)
    nodes_m = np.array(
        [
            np.mean([marks.marks[index].place_m for index in np.flatnonzero(node_of == node)], axis=0)
            for node in range(node_of.max() + 1)
        ]
    )
    plan = Plan(nodes_m, ())
    for index, road in enumerate(roads):
        cuts = sorted((marks.marks[mark].station_m, int(node_of[mark])) for mark in by_road[index])
        seamless = all(marks.marks[mark].road == index for mark in np.flatnonzero(node_of == node_of[2 * index]))
        plan = _cut(plan, road, cuts, seamless)
    return _used_nodes(plan)


def _clusters(roads: Sequence[DraftRoad], marks: _Marks) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    """Node of each mark."""
    places_m = np.array([mark.place_m for mark in marks.marks])
    layers = np.array([roads[mark.road].layer for mark in marks.marks])
    close = cKDTree(np.column_stack([places_m, 1000.0 * layers])).query_pairs(_ONE_PLACE_M, output_type="ndarray")
    pairs = np.concatenate([np.array(marks.same, np.int64).reshape(-1, 2), close])
    graph = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(places_m), len(places_m)))
    return connected_components(graph, directed=False)[1].astype(np.int64)


def _cut(plan: Plan, road: DraftRoad, cuts: list[tuple[float, int]], seamless: bool) -> Plan:
    """A plan with the links of one more road, which is cut at stations on the way to nodes.

    Nothing else meets a ``seamless`` road where it starts; if it is closed, it is not cut there.
    """
    nodes_m, whole_m = plan.nodes_m, cuts[-1][0]
    if seamless and len(cuts) > 2 and np.allclose(road.line_m[0], road.line_m[-1]):
        crossings = [cut for cut in cuts if cut[1] != cuts[0][1]]
        cuts = [*crossings, (crossings[0][0] + whole_m, crossings[0][1])]
    pieces = [(a, b) for a, b in zip(cuts, cuts[1:], strict=False) if a[1] != b[1] or b[0] - a[0] > 2.0 * _ONE_PLACE_M]
    links = []
    for a, b in pieces:
        ways = [(a, b)]
        if a[1] == b[1]:
            middle_m = (a[0] + b[0]) / 2.0
            nodes_m = np.concatenate([nodes_m, part(road.line_m, middle_m, middle_m + 1.0)[:1]])
            ways = [(a, (middle_m, len(nodes_m) - 1)), ((middle_m, len(nodes_m) - 1), b)]
        links += [(start, end, part(road.line_m, start[0], end[0])) for start, end in ways]
    named = tuple(
        Link(road.name if len(links) == 1 else f"{road.name}.{number}", road, start[1], end[1], line_m)
        for number, (start, end, line_m) in enumerate(links)
    )
    return Plan(nodes_m, plan.links + named, plan.notes)


def _used_nodes(plan: Plan) -> Plan:
    """The plan without nodes that no link touches."""
    used, inverse = np.unique([(link.start, link.end) for link in plan.links], return_inverse=True)
    ends = inverse.reshape(-1, 2).tolist()
    links = tuple(replace(link, start=a, end=b) for link, (a, b) in zip(plan.links, ends, strict=True))
    return Plan(plan.nodes_m[used], links, plan.notes)


def _without_stubs(plan: Plan) -> Plan:
    """The plan without the ends of roads that reach past the last road they cross, but lead nowhere."""
    degree = np.bincount(np.array([(link.start, link.end) for link in plan.links]).ravel())
    links = tuple(
        link
        for link in plan.links
        if length_m(link.line_m) >= _SHORTEST_LINK_M or min(degree[link.start], degree[link.end]) > 1
    )
    return _used_nodes(replace(plan, links=links))


def _without_short_links(plan: Plan) -> Plan:
    """Links too short for a junction at both ends are left out, and their junctions become one."""
    while True:
        short = [
            link
            for link in plan.links
            if not link.road.kind.one_way and link.start != link.end and length_m(link.line_m) < _SHORTEST_LINK_M
        ]
        if not short:
            return _used_nodes(plan)
        plan = _contracted(plan, min(short, key=lambda link: length_m(link.line_m)))


def _contracted(plan: Plan, short: Link) -> Plan:
    """The plan with both nodes of a link in one place, halfway."""
    kept, gone = sorted((short.start, short.end))
    middle_m = (plan.nodes_m[kept] + plan.nodes_m[gone]) / 2.0
    shifts_m = {node: middle_m - plan.nodes_m[node] for node in (kept, gone)}
    links = []
    for link in plan.links:
        if {link.start, link.end} == {kept, gone} and length_m(link.line_m) < _SHORTEST_LINK_M:
            continue
        if shifts_m.keys() & {link.start, link.end}:
            zero = np.zeros(2)
            line_m = warped(link.line_m, shifts_m.get(link.start, zero), shifts_m.get(link.end, zero))
            start, end = (kept if node == gone else node for node in (link.start, link.end))
            link = replace(link, start=start, end=end, line_m=line_m)
        links.append(link)
    nodes_m = plan.nodes_m.copy()
    nodes_m[kept] = middle_m
    return Plan(nodes_m, tuple(links), plan.notes)
