"""From a draft to a plan: roads are divided where they meet, into links between nodes.

Meeting places that are too close to each other for two junctions become one; dead ends get a turning circle.
"""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
import shapely

from simbev_ros.errors import InputError
from simbev_ros.maps.plan.dead_ends import with_turning_circles
from simbev_ros.maps.plan.draft import Draft, DraftRoad
from simbev_ros.maps.plan.lines import length_m, part, warped
from simbev_ros.maps.plan.meetings import Marks, is_closed, lengthened, marks_of, nodes_of
from simbev_ros.maps.plan.plan import Link, Plan
from simbev_ros.maps.plan.sharp_angles import with_wide_angles

_SAME_PLACE_M = 8.0
_SHORTEST_LINK_M = 16.0
_CROWDED_M = 24.0


def divide(draft: Draft) -> Plan:
    """Nodes and links of a draft, in an order that depends on the draft alone.

    Raises:
        InputError: Two roads have one name, a line crosses itself, or a one-way road leads nowhere.
    """
    _check(draft.roads)
    roads = lengthened(draft.roads)
    plan = _without_short_links(_without_stubs(_links(roads, marks_of(roads))))
    plan = replace(plan, notes=plan.notes + tuple(_crowding_notes(plan)))
    return with_turning_circles(with_wide_angles(plan))


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


def _links(roads: Sequence[DraftRoad], marks: Marks) -> Plan:
    """Roads cut at their marks."""
    node_of = nodes_of(marks)
    by_road: dict[int, list[int]] = defaultdict(list)
    for index, mark in enumerate(marks.marks):
        by_road[mark.road].append(index)
    places_m = np.array([mark.place_m for mark in marks.marks])
    counts = np.bincount(node_of)
    nodes_m = np.column_stack([np.bincount(node_of, column) / counts for column in places_m.T])
    plan = Plan(nodes_m, ())
    for index, road in enumerate(roads):
        own_ends = (2 * index, 2 * index + 1)
        places = [mark for mark in by_road[index] if mark not in own_ends]
        if not is_closed(road) or len({int(node_of[mark]) for mark in places}) < 2:
            places = by_road[index]
        cuts = sorted((marks.marks[mark].station_m, int(node_of[mark])) for mark in places)
        plan = _cut(plan, road, cuts)
    return _used_nodes(plan)


def _cut(plan: Plan, road: DraftRoad, cuts: list[tuple[float, int]]) -> Plan:
    """A plan with the links of one more road, which is cut at stations on the way to nodes."""
    nodes_m = plan.nodes_m
    if is_closed(road):
        cuts = [*cuts, (cuts[0][0] + length_m(road.line_m), cuts[0][1])]
    pieces = [(a, b) for a, b in pairwise(cuts) if a[1] != b[1] or b[0] - a[0] > _SAME_PLACE_M]
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


def _crowding_notes(plan: Plan) -> Iterator[str]:
    """One sentence for each link whose junctions leave no room for cars to queue between them."""
    touching = plan.links_at()
    for link in plan.links:
        whole_m = length_m(link.line_m)
        at_junctions = min(len(touching[link.start]), len(touching[link.end])) > 2
        if whole_m < _CROWDED_M and at_junctions and not link.road.kind.one_way:
            x_m, y_m = link.line_m[0]
            yield f"road {link.id}: its junctions near ({x_m:.0f}, {y_m:.0f}) are only {whole_m:.0f} m apart"
