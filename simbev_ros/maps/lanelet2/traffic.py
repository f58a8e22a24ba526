"""Builds SUMO's view of lanelets: edges of parallel lanelets between nodes, and connections from lane to lane.

Lanelets inside junctions become connections, all others edges. Both lie exactly where the lanelets lie.
"""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.findings import Findings
from simbev_ros.maps.lane_graph.joined_names import JoinedNames
from simbev_ros.maps.lane_graph.traffic import (
    LaneOfEdge,
    Traffic,
    TrafficConnection,
    TrafficEdge,
    TrafficLane,
    keep_driven_parts,
    split_loops,
)
from simbev_ros.maps.lanelet2.junctions import Junctions
from simbev_ros.maps.lanelet2.shapes import LaneletShape, joined_m, resampled_m, stations_m
from simbev_ros.maps.lanelet2.stubs import Stubs
from simbev_ros.maps.lanelet2.tags import allowed_classes, may_cross, parse_speed_mps, speed_limit_mps
from simbev_ros.maps.lanelet2.topology import Topology
from simbev_ros.maps.roads.lane_kind import LaneKind

Row = tuple[str, ...]
"""Ids of the lanelets with traffic that lie side by side in one direction, outermost first."""


def traffic_of(junctions: Junctions, waiting: Collection[str], notes: Findings) -> Traffic:
    """The edges and connections of all connected parts of the road network.

    Args:
        junctions: The junctions, with the relations of the lanelets.
        waiting: Lanelets with traffic that may have to wait at their ends, so that an edge ends there.
        notes: Receives omissions.
    """
    topology = junctions.topology
    _note_omissions(junctions, notes)
    chains = list(_chains(junctions, waiting))
    edges = [_edge(topology, chain) for chain in chains]
    stubs = Stubs(junctions)
    connections = list(_connections(junctions, chains, edges, stubs))
    nodes = JoinedNames(lambda name: (name[0] != "J", name))
    _join_nodes(junctions, chains, edges, nodes)
    roads = _roads(topology, chains, edges)
    edges = [*edges, *stubs.edges()]
    _join_connected(edges, connections, nodes)
    joined = [
        replace(edge, road=roads.get(edge.id, edge.id), start=nodes.resolve(edge.start), end=nodes.resolve(edge.end))
        for edge in edges
    ]
    return split_loops(keep_driven_parts(joined, connections, notes)) if joined else Traffic((), ())


def _note_omissions(junctions: Junctions, notes: Findings) -> None:
    """Note the lanelets that carry no traffic, or only a part of theirs."""
    for name, shape in junctions.topology.shapes.items():
        if shape.kind is not LaneKind.DRIVING:
            continue
        limit = shape.lanelet.tags.get("speed_limit", "")
        if limit and not parse_speed_mps(limit):
            detail = f"lanelet {name}: speed_limit={limit[:30]!r}"
            notes.left_out("a speed limit that cannot be read is ignored", shape.lanelet.element, detail)
        if shape.lanelet.tags.get("one_way") == "no":
            notes.repaired(
                "a lanelet for both directions carries traffic in one", shape.lanelet.element, f"lanelet {name}"
            )
        topology = junctions.topology
        if name in junctions.by_lanelet and not (topology.preceding[name] and topology.following[name]):
            rule = "a lanelet that overlaps others at the edge of the map begins or ends there"
            notes.assumed(rule, shape.lanelet.element, f"lanelet {name}")


def _chains(junctions: Junctions, waiting: Collection[str]) -> Iterator[tuple[Row, ...]]:
    """Yield the rows of each edge: consecutive rows of the same lanes."""
    topology = junctions.topology
    outside = (names for names in topology.carriageways if names[0] not in junctions.by_lanelet)
    rows = [row for names in outside for row in [_row(topology, names)] if row]
    by_lane = {name: row for row in rows for name in row}
    after: dict[Row, Row] = {}
    for row in rows:
        target = by_lane.get(next(iter(topology.following[row[-1]]), ""))
        if target is not None and set(row).isdisjoint(waiting) and _continues(topology, row, target):
            after[row] = target
    continued = set(after.values())
    used: set[Row] = set()
    for start in (*(row for row in rows if row not in continued), *rows):  # the latter for rings
        chain: list[Row] = []
        row_ahead: Row | None = start
        while row_ahead is not None and row_ahead not in used:
            used.add(row_ahead)
            chain.append(row_ahead)
            row_ahead = after.get(row_ahead)
        if chain:
            yield tuple(chain)


def _row(topology: Topology, names: Sequence[str]) -> Row:
    """The lanelets of a carriageway that carry traffic, outermost first; of walkways the nearest one only."""
    outward = list(names) if topology.left_hand else list(reversed(names))
    kinds = {name: topology.shapes[name].kind for name in outward}
    lanes = [name for name in outward if kinds[name] in (LaneKind.DRIVING, LaneKind.BICYCLE)]
    if not lanes:
        return ()
    walkways = [name for name in outward[: outward.index(lanes[0])] if kinds[name] is LaneKind.SIDEWALK]
    return (*walkways[-1:], *lanes)


def _continues(topology: Topology, row: Row, target: Row) -> bool:
    """Whether each lane of a row continues only as the lane in the same position of another, with the same rules."""
    return len(row) == len(target) and all(
        topology.following[name] == (other,)
        and topology.preceding[other] == (name,)
        and _rules(topology.shapes[name]) == _rules(topology.shapes[other])
        for name, other in zip(row, target, strict=True)
    )


def _rules(shape: LaneletShape) -> tuple[float, str]:
    """Properties that are constant along a lane of an edge."""
    return speed_limit_mps(shape.lanelet.tags), allowed_classes(shape.lanelet.tags, shape.kind)


def _edge(topology: Topology, chain: Sequence[Row]) -> TrafficEdge:
    """The edge for a chain of rows; its nodes are the points at which its innermost border starts and ends."""
    shapes = topology.shapes
    side = 1 if topology.left_hand else 0
    first, last = shapes[chain[0][-1]], shapes[chain[-1][-1]]
    fractions = [_common_fractions([shapes[name] for name in row]) for row in chain]
    inner = [shapes[row[-1]].right_m if topology.left_hand else shapes[row[-1]].left_m for row in chain]
    return TrafficEdge(
        id=first.id,
        road=first.id,
        start=f"P{first.start[side]}",
        end=f"P{last.end[side]}",
        lanes=tuple(_lane(topology, names, fractions) for names in zip(*chain, strict=True)),
        inner_m=joined_m([resampled_m(line_m, at) for line_m, at in zip(inner, fractions, strict=True)]),
    )


def _lane(topology: Topology, names: Sequence[str], fractions: Sequence[Float64Array]) -> TrafficLane:
    """One lane of an edge, made of consecutive lanelets."""
    shapes = [topology.shapes[name] for name in names]
    speed_mps, allowed = _rules(shapes[0])
    lengths_m = [shape.length_m for shape in shapes]
    return TrafficLane(
        keys=tuple(shape.key for shape in shapes),
        kind=shapes[0].kind,
        line_m=joined_m([resampled_m(shape.center_m, at) for shape, at in zip(shapes, fractions, strict=True)]),
        width_m=float(np.average([shape.width_m for shape in shapes], weights=lengths_m)),
        speed_mps=speed_mps,
        allowed=allowed,
        may_change_left=all(may_cross(shape.lanelet.left, shape.flipped[0], to_left=True) for shape in shapes),
        may_change_right=all(may_cross(shape.lanelet.right, shape.flipped[1], to_left=False) for shape in shapes),
    )


def _common_fractions(shapes: Sequence[LaneletShape]) -> Float64Array:
    """(N,) fractions of length at which a center line or inner border of parallel lanelets has a point, ascending."""
    lines_m = [line_m for shape in shapes for line_m in (shape.center_m, shape.left_m, shape.right_m)]
    fractions = np.unique(
        np.concatenate([np.round(stations_m(line_m) / stations_m(line_m)[-1], 9) for line_m in lines_m])
    )
    return np.asarray(fractions)


def _connections(
    junctions: Junctions, chains: Sequence[Sequence[Row]], edges: Sequence[TrafficEdge], stubs: Stubs
) -> Iterator[TrafficConnection]:
    """Yield the connections from the lanes of each edge to those that follow, directly or through a junction."""
    shapes = junctions.topology.shapes
    goals: dict[str, LaneOfEdge] = {
        name: (edge.id, index) for chain, edge in zip(chains, edges, strict=True) for index, name in enumerate(chain[0])
    }
    goals |= {name: (edge, 0) for name, edge in stubs.exits.items()}
    starts = [
        (name, (edge.id, index))
        for chain, edge in zip(chains, edges, strict=True)
        for index, name in enumerate(chain[-1])
        if shapes[name].kind is not LaneKind.SIDEWALK
    ]
    starts += [(name, (edge, 0)) for name, edge in stubs.entries.items()]
    for name, start in starts:
        for goal, through in junctions.paths(name).items():
            if goal in goals:
                line_m = joined_m([stubs.inside_m(each) for each in through]) if through else None
                yield TrafficConnection(start, goals[goal], line_m)


def _join_nodes(
    junctions: Junctions,
    chains: Sequence[Sequence[Row]],
    edges: Sequence[TrafficEdge],
    nodes: JoinedNames,
) -> None:
    """Join the nodes of edges that touch one junction."""
    topology, inside = junctions.topology, junctions.by_lanelet
    for chain, edge in zip(chains, edges, strict=True):
        for node, names, beyond in (
            (edge.start, chain[0], topology.preceding),
            (edge.end, chain[-1], topology.following),
        ):
            for junction in (inside[other] for name in names for other in beyond[name] if other in inside):
                nodes.join(junction, node)


def _join_connected(edges: Sequence[TrafficEdge], connections: Sequence[TrafficConnection], nodes: JoinedNames) -> None:
    """Join the nodes of edges that are connected."""
    by_id = {edge.id: edge for edge in edges}
    for connection in connections:
        nodes.join(by_id[connection.start[0]].end, by_id[connection.goal[0]].start)


def _roads(topology: Topology, chains: Sequence[Sequence[Row]], edges: Sequence[TrafficEdge]) -> Mapping[str, str]:
    """Edge → id of its road: the same for the two directions of one road."""
    edge_of = {name: edge.id for chain, edge in zip(chains, edges, strict=True) for row in chain for name in row}
    roads = JoinedNames()
    for name, edge in edge_of.items():
        other = topology.opposite.get(name, "")
        if other in edge_of:
            roads.join(edge, edge_of[other])
    return {edge.id: roads.resolve(edge.id) for edge in edges}
