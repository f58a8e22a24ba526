"""Builds SUMO's view of OpenDRIVE roads: edges of parallel lanes between nodes, and connections from lane to lane.

Edges and the paths through junctions lie exactly where the lanes of the file lie. An edge ends where lanes begin, end,
or become too narrow to drive on.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from simbev_ros.maps.opendrive.lane_shapes import LaneShape
from simbev_ros.maps.opendrive.links import OTHER_END, LaneLinks
from simbev_ros.maps.opendrive.reading.attributes import Notes
from simbev_ros.maps.opendrive.reading.document import Contact, Document, LaneKey, Road
from simbev_ros.maps.opendrive.traffic.cells import Cell, carries_traffic, chains_of
from simbev_ros.maps.opendrive.traffic.nodes import Nodes
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.sumo.islands import on_mainland
from simbev_ros.types import Float64Array

_MAX_JUNCTION_ROADS = 8


@dataclass(frozen=True, slots=True, eq=False)
class TrafficLane:
    """A lane of an edge.

    Attributes:
        keys: The lanes of the file that it is made of.
        kind: Its use.
        type: Its type in the file.
        line_m: (N, 3) center line in driving direction.
        width_m: Mean width.
        speed_mps: Speed limit.
    """

    keys: tuple[LaneKey, ...]
    kind: LaneKind
    type: str
    line_m: Float64Array
    width_m: float
    speed_mps: float


@dataclass(frozen=True, slots=True, eq=False)
class TrafficEdge:
    """Parallel lanes, outermost first, all with the same number of points.

    Attributes:
        id: SUMO's edge id.
        road: Id of the road that it is a part of.
        start: Node at which it begins.
        end: Node at which it ends.
        lanes: The lanes; a sidewalk is the first.
        inner_m: (N, 3) border of the innermost lane towards the middle of the road.
    """

    id: str
    road: str
    start: str
    end: str
    lanes: tuple[TrafficLane, ...]
    inner_m: Float64Array


_LaneOfEdge = tuple[str, int]


@dataclass(frozen=True, slots=True, eq=False)
class TrafficConnection:
    """A connection between two lanes of the SUMO net.

    Attributes:
        start: Edge id and lane index of the first lane.
        goal: Edge id and lane index of the following lane.
        line_m: (N, 3) path through a junction, if any.
    """

    start: _LaneOfEdge
    goal: _LaneOfEdge
    line_m: Float64Array | None


@dataclass(frozen=True, slots=True, eq=False)
class Traffic:
    """The edges and connections of a SUMO net."""

    edges: tuple[TrafficEdge, ...]
    connections: tuple[TrafficConnection, ...]

    def lane_ids(self) -> dict[LaneKey, tuple[str, ...]]:
        """Lane of the file → ids of the SUMO lanes made from it, in driving direction."""
        ids: dict[LaneKey, list[str]] = {}
        for edge in self.edges:
            for index, lane in enumerate(edge.lanes):
                for key in lane.keys:
                    ids.setdefault(key, []).append(f"{edge.id}_{index}")
        return {key: tuple(names) for key, names in ids.items()}

    def node_positions_m(self) -> dict[str, Float64Array]:
        """Node → (3,) mean position of the ends of its edges, in the order of the edges."""
        ends: dict[str, list[Float64Array]] = {}
        for edge in self.edges:
            ends.setdefault(edge.start, []).append(edge.inner_m[0])
            ends.setdefault(edge.end, []).append(edge.inner_m[-1])
        return {node: np.mean(ends_m, axis=0) for node, ends_m in ends.items()}

    @property
    def is_drivable(self) -> bool:
        """Whether there is a lane for vehicles."""
        return any(lane.kind is LaneKind.DRIVING for edge in self.edges for lane in edge.lanes)


def traffic_of(document: Document, shapes: Mapping[LaneKey, LaneShape], links: LaneLinks, notes: Notes) -> Traffic:
    """The edges and connections of the largest connected part of the road network."""
    if any(shape.lane.reversed for shape in shapes.values()):
        notes.add("lanes with reversed direction carry no traffic")
    nodes = Nodes(document)
    chains = [
        (road, chain)
        for road in document.roads.values()
        if not road.junction
        for chain in chains_of(road, shapes, links)
    ]
    edges = [_edge(road, chain, nodes) for road, chain in chains]
    entries = {
        (shape.key, chain[0].entry): (edge.id, index)
        for (_, chain), edge in zip(chains, edges, strict=True)
        for index, shape in enumerate(chain[0].shapes)
    }
    connections = [
        TrafficConnection((edge.id, index), goal, line_m)
        for (_, chain), edge in zip(chains, edges, strict=True)
        for index, shape in enumerate(chain[-1].shapes)
        if shape.lane.kind is not LaneKind.SIDEWALK
        for goal, line_m in _reachable_lanes(chain[-1], shape, shapes, links, entries).items()
    ]
    by_id = {edge.id: edge for edge in edges}
    for connection in connections:
        nodes.join(by_id[connection.start[0]].end, by_id[connection.goal[0]].start)
    joined = [replace(edge, start=nodes.resolve(edge.start), end=nodes.resolve(edge.end)) for edge in edges]
    return _split_loops(_keep_mainland(joined, connections, notes)) if joined else Traffic((), ())


def _edge(road: Road, chain: Sequence[Cell], nodes: Nodes) -> TrafficEdge:
    """The edge for a chain of cells."""
    first, last = chain[0], chain[-1]
    name = f"{'' if first.forward else '-'}{nodes.safe_ids[road.id]}.{first.shapes[0].section.index}.{first.entry}"
    innermost = [min(cell.shapes, key=lambda shape: abs(shape.lane.id)) for cell in chain]
    return TrafficEdge(
        id=name,
        road=road.id,
        start=nodes.node_at(road, float(first.shapes[0].s_m[first.entry])),
        end=nodes.node_at(road, float(last.shapes[0].s_m[last.exit])),
        lanes=tuple(_lane(chain, position) for position in range(len(first.shapes))),
        inner_m=_concatenate([cell.along(shape.inner_m) for cell, shape in zip(chain, innermost, strict=True)]),
    )


def _lane(chain: Sequence[Cell], position: int) -> TrafficLane:
    """The lane at one position in all cells of a chain."""
    shapes = [cell.shapes[position] for cell in chain]
    widths_m = np.concatenate([cell.along(shape.width_m) for cell, shape in zip(chain, shapes, strict=True)])
    lane = shapes[0].lane
    assert lane.kind is not None
    return TrafficLane(
        keys=tuple(dict.fromkeys(shape.key for shape in shapes)),
        kind=lane.kind,
        type=lane.type,
        line_m=_concatenate([cell.along(_center_m(shape)) for cell, shape in zip(chain, shapes, strict=True)]),
        width_m=float(np.mean(widths_m)),
        speed_mps=shapes[0].speed_mps(chain[0].middle_m),
    )


def _reachable_lanes(
    cell: Cell,
    shape: LaneShape,
    shapes: Mapping[LaneKey, LaneShape],
    links: LaneLinks,
    entries: Mapping[tuple[LaneKey, int], _LaneOfEdge],
) -> dict[_LaneOfEdge, Float64Array | None]:
    """Lanes that follow a lane at the end of an edge, each with the first path found through the junction."""
    if not cell.leaves_section:
        goal = entries.get((shape.key, cell.exit))
        return {} if goal is None else {goal: None}
    found: dict[_LaneOfEdge, Float64Array | None] = {}
    pending: list[tuple[LaneKey, Contact, tuple[LaneShape, ...]]] = [(shape.key, cell.exit_contact, ())]
    while pending:
        key, contact, through = pending.pop(0)
        for entered, at in links.touching(key, contact):
            lane = shapes.get(entered)
            if lane is None or not carries_traffic(lane) or lane.runs_forward != (at == "start"):
                continue
            if not lane.road.junction:
                goal = entries.get((entered, 0 if at == "start" else len(lane.s_m) - 1))
                if goal is not None:
                    found.setdefault(
                        goal, _concatenate([_driven_line_m(part) for part in through]) if through else None
                    )
            elif lane not in through and len(through) < _MAX_JUNCTION_ROADS:
                pending.append((entered, OTHER_END[at], (*through, lane)))
    return found


def _center_m(shape: LaneShape) -> Float64Array:
    """(N, 3) center line of a lane."""
    return (shape.inner_m + shape.outer_m) / 2.0


def _driven_line_m(shape: LaneShape) -> Float64Array:
    """(N, 3) center line of a lane in driving direction."""
    return _center_m(shape)[:: 1 if shape.runs_forward else -1]


def _concatenate(parts_m: Sequence[Float64Array]) -> Float64Array:
    """Concatenate lines that meet end to end to one (N, 3) line."""
    return np.concatenate([parts_m[0], *(part_m[1:] for part_m in parts_m[1:])])


def _keep_mainland(edges: Sequence[TrafficEdge], connections: Sequence[TrafficConnection], notes: Notes) -> Traffic:
    """Remove roads that cannot be reached from most others; the two directions of a road count as connected."""
    by_road: dict[str, str] = {}
    pairs = [(edge.id, by_road.setdefault(edge.road, edge.id), 0.0) for edge in edges]
    pairs += [(connection.start[0], connection.goal[0], 0.0) for connection in connections]
    lengths_m = [_drivable_m(edge) for edge in edges]
    pairs += [(edge.id, edge.id, length_m) for edge, length_m in zip(edges, lengths_m, strict=True)]
    starts, ends, weights = zip(*pairs, strict=True)
    kept = on_mainland(starts, ends, np.array(weights))[-len(edges) :]
    names = {edge.id for edge, keep in zip(edges, kept, strict=True) if keep}
    lost_m = sum(length_m for length_m, keep in zip(lengths_m, kept, strict=True) if not keep)
    if lost_m > 0.0:
        notes.add(f"{lost_m / 1e3:.2f} km of lanes cannot be reached from the others and carry no traffic")
    return Traffic(
        tuple(edge for edge in edges if edge.id in names), tuple(c for c in connections if c.start[0] in names)
    )


def _drivable_m(edge: TrafficEdge) -> float:
    """Total length of an edge's driving lanes."""
    lines_m = [lane.line_m for lane in edge.lanes if lane.kind is LaneKind.DRIVING]
    return float(sum(np.linalg.norm(np.diff(line_m, axis=0), axis=1).sum() for line_m in lines_m))


def _split_loops(traffic: Traffic) -> Traffic:
    """Split edges that lead from a node to itself, because SUMO does not support them."""
    loops = {edge.id: edge for edge in traffic.edges if edge.start == edge.end}
    edges = tuple(part for edge in traffic.edges for part in (_split_edge(edge) if edge.id in loops else (edge,)))
    connections = [
        replace(c, start=(_second_half_id(c.start[0]), c.start[1])) if c.start[0] in loops else c
        for c in traffic.connections
    ]
    connections += [
        TrafficConnection((edge.id, index), (_second_half_id(edge.id), index), None)
        for edge in loops.values()
        for index, lane in enumerate(edge.lanes)
        if lane.kind is not LaneKind.SIDEWALK
    ]
    return Traffic(edges, tuple(connections))


def _second_half_id(edge_id: str) -> str:
    """Id of the second half of a split edge."""
    return f"{edge_id}.b"


def _split_edge(edge: TrafficEdge) -> Iterator[TrafficEdge]:
    """The two halves of an edge."""
    lines_m = [lane.line_m for lane in edge.lanes]
    if len(edge.inner_m) == 2:
        lines_m = [np.insert(line_m, 1, line_m.mean(axis=0), axis=0) for line_m in lines_m]
    middle = len(lines_m[0]) // 2
    for name, start, end, part in (
        (edge.id, edge.start, f"{edge.id}.m", slice(middle + 1)),
        (_second_half_id(edge.id), f"{edge.id}.m", edge.end, slice(middle, None)),
    ):
        lanes = tuple(replace(lane, line_m=line_m[part]) for lane, line_m in zip(edge.lanes, lines_m, strict=True))
        yield replace(edge, id=name, start=start, end=end, lanes=lanes, inner_m=lanes[-1].line_m)
