"""Divides a draft into a plan: roads become links between nodes, split where they meet.

Meeting points that are too close to each other for two junctions are merged; dead ends get a turning circle.
"""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
import shapely

from simbev_ros.foundation.errors import InputError
from simbev_ros.maps.plan.dead_ends import add_turning_circles
from simbev_ros.maps.plan.draft import Draft, DraftRoad
from simbev_ros.maps.plan.lines import length_m, part, shift_ends
from simbev_ros.maps.plan.meetings import Marks, extend_to_meet, is_closed, marks_of, nodes_of
from simbev_ros.maps.plan.plan import Link, Plan
from simbev_ros.maps.plan.sharp_angles import widen_sharp_angles

_SAME_POSITION_M = 8.0
_MIN_LINK_M = 16.0
_CROWDED_M = 24.0


def divide_draft(draft: Draft) -> Plan:
    """Divide a draft into nodes and links, in an order that depends on the draft alone.

    Raises:
        InputError: Two roads have the same name, a line crosses itself, or a one-way road leads nowhere.
    """
    _check(draft.roads)
    roads = extend_to_meet(draft.roads)
    plan = _contract_short_links(_remove_stubs(_cut_at_marks(roads, marks_of(roads))))
    plan = replace(plan, notes=plan.notes + tuple(_crowding_notes(plan)))
    return add_turning_circles(widen_sharp_angles(plan))


def _check(roads: Sequence[DraftRoad]) -> None:
    seen: set[str] = set()
    for road in roads:
        if road.name in seen:
            raise InputError(f"road {road.name}: two roads have this name")
        seen.add(road.name)
        if len(road.line_m) < 2 or length_m(road.line_m) < _MIN_LINK_M / 2.0:
            raise InputError(f"road {road.name}: shorter than {_MIN_LINK_M / 2.0:g} m")
        if not shapely.LineString(road.line_m).is_simple:
            raise InputError(f"road {road.name}: its line crosses itself; split it into roads on two layers")


def _cut_at_marks(roads: Sequence[DraftRoad], marks: Marks) -> Plan:
    """Cut roads at their marks."""
    node_of = nodes_of(marks)
    by_road: dict[int, list[int]] = defaultdict(list)
    for index, mark in enumerate(marks.marks):
        by_road[mark.road].append(index)
    positions_m = np.array([mark.position_m for mark in marks.marks])
    counts = np.bincount(node_of)
    nodes_m = np.column_stack([np.bincount(node_of, column) / counts for column in positions_m.T])
    plan = Plan(nodes_m, ())
    for index, road in enumerate(roads):
        own_ends = (2 * index, 2 * index + 1)
        road_marks = [mark for mark in by_road[index] if mark not in own_ends]
        if not is_closed(road) or len({int(node_of[mark]) for mark in road_marks}) < 2:
            road_marks = by_road[index]
        cuts = sorted((marks.marks[mark].station_m, int(node_of[mark])) for mark in road_marks)
        plan = _cut(plan, road, cuts)
    return _drop_unused_nodes(plan)


def _cut(plan: Plan, road: DraftRoad, cuts: list[tuple[float, int]]) -> Plan:
    """Append the links of one more road to a plan, cut at (station, node) pairs."""
    nodes_m = plan.nodes_m
    if is_closed(road):
        cuts = [*cuts, (cuts[0][0] + length_m(road.line_m), cuts[0][1])]
    pieces = [(a, b) for a, b in pairwise(cuts) if a[1] != b[1] or b[0] - a[0] > _SAME_POSITION_M]
    links = []
    for a, b in pieces:
        sections = [(a, b)]
        if a[1] == b[1]:
            middle_m = (a[0] + b[0]) / 2.0
            nodes_m = np.concatenate([nodes_m, part(road.line_m, middle_m, middle_m + 1.0)[:1]])
            sections = [(a, (middle_m, len(nodes_m) - 1)), ((middle_m, len(nodes_m) - 1), b)]
        links += [(start, end, part(road.line_m, start[0], end[0])) for start, end in sections]
    named = tuple(
        Link(road.name if len(links) == 1 else f"{road.name}.{number}", road, start[1], end[1], line_m)
        for number, (start, end, line_m) in enumerate(links)
    )
    return Plan(nodes_m, plan.links + named, plan.notes)


def _drop_unused_nodes(plan: Plan) -> Plan:
    """Remove nodes that no link touches."""
    used, inverse = np.unique([(link.start, link.end) for link in plan.links], return_inverse=True)
    ends = inverse.reshape(-1, 2).tolist()
    links = tuple(replace(link, start=a, end=b) for link, (a, b) in zip(plan.links, ends, strict=True))
    return Plan(plan.nodes_m[used], links, plan.notes)


def _remove_stubs(plan: Plan) -> Plan:
    """Remove the ends of roads that extend past the last road they cross but lead nowhere."""
    degree = np.bincount(np.array([(link.start, link.end) for link in plan.links]).ravel())
    links = tuple(
        link
        for link in plan.links
        if length_m(link.line_m) >= _MIN_LINK_M or min(degree[link.start], degree[link.end]) > 1
    )
    return _drop_unused_nodes(replace(plan, links=links))


def _contract_short_links(plan: Plan) -> Plan:
    """Remove links that are too short for a junction at both ends, and merge their junctions."""
    while True:
        short = [
            link
            for link in plan.links
            if not link.road.kind.one_way and link.start != link.end and length_m(link.line_m) < _MIN_LINK_M
        ]
        if not short:
            return _drop_unused_nodes(plan)
        plan = _contract(plan, min(short, key=lambda link: length_m(link.line_m)))


def _contract(plan: Plan, short: Link) -> Plan:
    """Merge both nodes of a link at its middle."""
    kept, removed = sorted((short.start, short.end))
    middle_m = (plan.nodes_m[kept] + plan.nodes_m[removed]) / 2.0
    shifts_m = {node: middle_m - plan.nodes_m[node] for node in (kept, removed)}
    links = []
    for link in plan.links:
        if {link.start, link.end} == {kept, removed} and length_m(link.line_m) < _MIN_LINK_M:
            continue
        if shifts_m.keys() & {link.start, link.end}:
            zero = np.zeros(2)
            line_m = shift_ends(link.line_m, shifts_m.get(link.start, zero), shifts_m.get(link.end, zero))
            start, end = (kept if node == removed else node for node in (link.start, link.end))
            link = replace(link, start=start, end=end, line_m=line_m)
        links.append(link)
    nodes_m = plan.nodes_m.copy()
    nodes_m[kept] = middle_m
    return Plan(nodes_m, tuple(links), plan.notes)


def _crowding_notes(plan: Plan) -> Iterator[str]:
    """One sentence for each link that is too short for cars to queue between its junctions."""
    touching = plan.links_at()
    for link in plan.links:
        whole_m = length_m(link.line_m)
        at_junctions = min(len(touching[link.start]), len(touching[link.end])) > 2
        if whole_m < _CROWDED_M and at_junctions and not link.road.kind.one_way:
            x_m, y_m = link.line_m[0]
            yield f"road {link.id}: its junctions near ({x_m:.0f}, {y_m:.0f}) are only {whole_m:.0f} m apart"
