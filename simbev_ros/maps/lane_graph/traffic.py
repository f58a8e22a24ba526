"""Edges of parallel lanes between nodes, and connections from lane to lane: SUMO's view of a map's lanes."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.findings import Findings
from simbev_ros.maps.lane_graph.lane_key import LaneKey
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.sumo.islands import driven_parts


@dataclass(frozen=True, slots=True, eq=False)
class TrafficLane:
    """A lane of an edge.

    Attributes:
        keys: The lanes of the file that it is made of.
        kind: Its use.
        line_m: (N, 3) center line in driving direction.
        width_m: Mean width.
        speed_mps: Speed limit.
        allowed: The only SUMO vehicle classes that may use it; "": all that drive on roads.
        may_change_left: Whether vehicles may change to the lane on its left, if there is one.
        may_change_right: Whether they may change to the lane on its right.
    """

    keys: tuple[LaneKey, ...]
    kind: LaneKind
    line_m: Float64Array
    width_m: float
    speed_mps: float
    allowed: str = ""
    may_change_left: bool = True
    may_change_right: bool = True


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


LaneOfEdge = tuple[str, int]
"""Edge id and lane index."""


@dataclass(frozen=True, slots=True, eq=False)
class TrafficConnection:
    """A connection between two lanes of the SUMO net.

    Attributes:
        start: Edge id and lane index of the first lane.
        goal: Edge id and lane index of the following lane.
        line_m: (N, 3) path through a junction, if any.
    """

    start: LaneOfEdge
    goal: LaneOfEdge
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


def keep_driven_parts(
    edges: Sequence[TrafficEdge], connections: Sequence[TrafficConnection], findings: Findings
) -> Traffic:
    """Keep the connected parts of the roads that have lanes for vehicles; a road connects its directions."""
    by_road: dict[str, str] = {}
    pairs = [(edge.id, by_road.setdefault(edge.road, edge.id)) for edge in edges]
    pairs += [(connection.start[0], connection.goal[0]) for connection in connections]
    starts, ends = zip(*pairs, strict=True)
    driven_m = np.zeros(len(pairs))
    driven_m[: len(edges)] = [_drivable_m(edge) for edge in edges]
    kept, parts = driven_parts(starts, ends, driven_m)
    findings.add(*parts)
    names = {edge.id for edge, keep in zip(edges, kept, strict=False) if keep}
    return Traffic(
        tuple(edge for edge in edges if edge.id in names), tuple(c for c in connections if c.start[0] in names)
    )


def _drivable_m(edge: TrafficEdge) -> float:
    """Total length of an edge's driving lanes."""
    lines_m = [lane.line_m for lane in edge.lanes if lane.kind is LaneKind.DRIVING]
    return float(sum(np.linalg.norm(np.diff(line_m, axis=0), axis=1).sum() for line_m in lines_m))


def split_loops(traffic: Traffic) -> Traffic:
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
