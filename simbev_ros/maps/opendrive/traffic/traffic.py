"""Builds SUMO's view of OpenDRIVE roads: edges of parallel lanes between nodes, and connections from lane to lane.

Edges and the paths through junctions lie exactly where the lanes of the file lie. An edge ends where lanes begin, end,
or become too narrow to drive on.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.findings import Findings
from simbev_ros.maps.lane_graph.traffic import (
    LaneOfEdge,
    Traffic,
    TrafficConnection,
    TrafficEdge,
    TrafficLane,
    keep_driven_parts,
    split_loops,
)
from simbev_ros.maps.opendrive.lane_shapes import LaneShape
from simbev_ros.maps.opendrive.links import OTHER_END, LaneLinks
from simbev_ros.maps.opendrive.reading.document import Contact, Document, LaneKey, Road
from simbev_ros.maps.opendrive.reading.tables import RESERVED
from simbev_ros.maps.opendrive.traffic.cells import Cell, carries_traffic, chains_of
from simbev_ros.maps.opendrive.traffic.nodes import Nodes
from simbev_ros.maps.roads.lane_kind import LaneKind

_MAX_JUNCTION_ROADS = 8


def traffic_of(document: Document, shapes: Mapping[LaneKey, LaneShape], links: LaneLinks, notes: Findings) -> Traffic:
    """The edges and connections of all connected parts of the road network."""
    if any(shape.lane.reversed for shape in shapes.values()):
        notes.left_out("lanes with reversed direction carry no traffic")
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
    return split_loops(keep_driven_parts(joined, connections, notes)) if joined else Traffic((), ())


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
        line_m=_concatenate([cell.along(_center_m(shape)) for cell, shape in zip(chain, shapes, strict=True)]),
        width_m=float(np.mean(widths_m)),
        speed_mps=shapes[0].speed_mps(chain[0].middle_m),
        allowed=RESERVED.get(lane.type, ""),
    )


def _reachable_lanes(
    cell: Cell,
    shape: LaneShape,
    shapes: Mapping[LaneKey, LaneShape],
    links: LaneLinks,
    entries: Mapping[tuple[LaneKey, int], LaneOfEdge],
) -> dict[LaneOfEdge, Float64Array | None]:
    """Lanes that follow a lane at the end of an edge, each with the first path found through the junction."""
    if not cell.leaves_section:
        goal = entries.get((shape.key, cell.exit))
        return {} if goal is None else {goal: None}
    found: dict[LaneOfEdge, Float64Array | None] = {}
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
