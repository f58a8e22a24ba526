"""Builds the layout of roads from a SUMO net: strips along its lanes, with paint by rule."""

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby, pairwise

import numpy as np
import shapely

from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.network import Lane
from simbev_ros.maps.paint_rules import left_line, line_between, right_edge_line
from simbev_ros.maps.roads.lane_kind import WALKABLE_KINDS, LaneKind
from simbev_ros.maps.roads.layout import Crosswalk, Layout, Line, SignKind, StopLine, Strip
from simbev_ros.maps.roads.polylines import Polylines
from simbev_ros.maps.sumo.crossfall import Crossfall
from simbev_ros.maps.sumo.net import SumoNet
from simbev_ros.maps.sumo.right_of_way import minor_approaches

_CORNER_RADIUS_M = 3.0
_BORDER_TOLERANCE_M = 0.5
_STOP_LINE_M = 0.5  # distance of its middle from the lane's end; SUMO's vehicles halt 1 m before the end
_STOP_LINE_MARGIN_M = 0.25  # clearance from the curb and from the center lines


@dataclass(frozen=True, slots=True)
class _Edge:
    """Parallel lanes, from the curb inward, and the adjacent lanes of the other direction, likewise."""

    lanes: list[Lane]
    opposite: list[Lane]
    on_structure: bool
    in_tunnel: bool
    continues: bool


@dataclass(frozen=True, slots=True)
class _Borders:
    """(N, 3) borders of lanes by lane id."""

    left_m: Mapping[str, Float64Array]
    right_m: Mapping[str, Float64Array]
    left_hand: bool

    @property
    def inner_m(self) -> Mapping[str, Float64Array]:
        """Borders on the side of oncoming traffic."""
        return self.right_m if self.left_hand else self.left_m


def layout_of(net: SumoNet) -> Layout:
    """Layout of a SUMO net: strips of all lanes in the net's order, crosswalks of all crossings, paint by rule.

    Verges have no strips, nor do walking areas that only join verges. Signs are not placed yet.
    """
    lanes = _lanes_by_edge(net)
    crossfall = Crossfall.of_net(net, lanes)
    borders = _borders(net, crossfall)
    edges = _edges(net, lanes, borders, crossfall.continued)
    strips = {strip.id: strip for edge in edges.values() for strip in _strips(edge, borders)}
    crossings = [lane for lane in net.lanes.values() if lane.kind is LaneKind.CROSSING]
    return Layout(
        strips=tuple(strips[lane] for lane in net.lanes if lane in strips),
        crosswalks=tuple(_crosswalk(lane, borders) for lane in crossings),
        stop_lines=tuple(_stop_lines(net, edges, borders)),
        signs=(),
        corner_radius_m=_CORNER_RADIUS_M,
    )


def _lanes_by_edge(net: SumoNet) -> dict[str, list[Lane]]:
    """The lanes of each edge from the curb inward, without crossings and what is unpaved."""
    lanes: dict[str, list[Lane]] = defaultdict(list)
    unpaved = _unpaved_lanes(net)
    for lane in net.lanes.values():
        if lane.kind is not LaneKind.CROSSING and lane.id not in unpaved:
            lanes[lane.edge].append(lane)
    return {edge: sorted(edge_lanes, key=lambda lane: lane.index) for edge, edge_lanes in lanes.items()}


def _unpaved_lanes(net: SumoNet) -> set[str]:
    """Ids of the verges, and of the walking areas that join nothing else."""
    verges = {lane.id for lane in net.lanes.values() if lane.kind is LaneKind.SIDEWALK and lane.edge in net.verges}
    joined: dict[str, set[str]] = defaultdict(set)
    for lane in net.lanes.values():
        for successor in lane.successors if lane.kind in WALKABLE_KINDS else ():
            joined[lane.id].add(successor)
            joined[successor].add(lane.id)
    areas = {lane.id for lane in net.lanes.values() if lane.kind is LaneKind.WALKING_AREA}
    return verges | {area for area in areas if joined[area] and joined[area] <= verges}


def _borders(net: SumoNet, crossfall: Crossfall) -> _Borders:
    """Both borders of every lane, offset by half its width from its center line and lowered by the crossfall."""
    lanes = list(net.lanes.values())
    lines = crossfall.add_fade_points(Polylines.from_lines([lane.centerline_m for lane in lanes]))
    half_m = np.array([lane.width_m for lane in lanes])[lines.row] / 2.0
    fraction = crossfall.fraction(lines)
    sides: list[list[Float64Array]] = []
    for side, below_m in ((1.0, crossfall.inner_m), (-1.0, crossfall.outer_m)):
        border_m = lines.offset_to_left((-side if net.left_hand else side) * half_m)
        border_m[:, 2] -= below_m[lines.row] * fraction
        sides.append(lines.split(border_m))
    inner, outer = (dict(zip(net.lanes, side, strict=True)) for side in sides)
    left, right = (outer, inner) if net.left_hand else (inner, outer)
    return _Borders(left, right, net.left_hand)


def _edges(
    net: SumoNet, lanes: Mapping[str, list[Lane]], borders: _Borders, continued: frozenset[str]
) -> dict[str, _Edge]:
    """All edges by id."""
    opposite = _opposites(net, lanes, borders)
    on_structure, in_tunnel = (_with_junctions(net, declared) for declared in (net.structures, net.tunnels))
    return {
        edge: _Edge(
            lanes=edge_lanes,
            opposite=lanes[opposite[edge]] if edge in opposite else [],
            on_structure=edge in on_structure,
            in_tunnel=edge in in_tunnel,
            continues=edge_lanes[0].junction in continued,
        )
        for edge, edge_lanes in lanes.items()
    }


def _opposites(net: SumoNet, lanes: Mapping[str, Sequence[Lane]], borders: _Borders) -> dict[str, str]:
    """Edge → the edge back between the same junctions whose inner border is the same line."""
    back: dict[tuple[str, str], list[str]] = defaultdict(list)
    for edge, ends in net.edge_ends.items():
        if edge in lanes:
            back[ends[::-1]].append(edge)
    pairs = [(edge, other) for edge, ends in net.edge_ends.items() for other in back[ends] if edge in lanes]
    if not pairs:
        return {}
    border = {
        edge: shapely.LineString(borders.inner_m[lanes[edge][-1].id]) for edge in {e for pair in pairs for e in pair}
    }
    midpoints = shapely.line_interpolate_point([border[edge] for edge, _ in pairs], 0.5, normalized=True)
    others = np.array([border[other] for _, other in pairs])
    rise_m = np.abs(
        shapely.get_z(midpoints)
        - shapely.get_z(shapely.line_interpolate_point(others, shapely.line_locate_point(others, midpoints)))
    )
    coincides = (shapely.distance(others, midpoints) < _BORDER_TOLERANCE_M) & (rise_m < _BORDER_TOLERANCE_M)
    return {edge: other for (edge, other), is_same in zip(pairs, coincides, strict=True) if is_same}


def _with_junctions(net: SumoNet, declared: frozenset[str]) -> frozenset[str]:
    """Declared edges, and the edges inside junctions at which only declared edges meet."""
    meeting: dict[str, set[str]] = defaultdict(set)
    for edge, ends in net.edge_ends.items():
        for junction in ends:
            meeting[junction].add(edge)
    junctions = {junction for junction, edges in meeting.items() if edges <= declared}
    return declared | {lane.edge for lane in net.lanes.values() if lane.junction in junctions}


def _strips(edge: _Edge, borders: _Borders) -> Iterator[Strip]:
    """The strips of one edge; those inside junctions have no paint."""
    lanes = edge.lanes
    painted = not lanes[0].junction
    between = [line_between(outer, inner) if painted else Line() for outer, inner in pairwise(lanes)]
    outer_lines = [right_edge_line(lanes, edge.opposite) if painted else Line(), *between]
    inner_lines = [*between, left_line(lanes, edge.opposite) if painted else Line()]
    ids = [lane.id for lane in lanes]
    inners, outers = [*ids[1:], edge.opposite[-1].id if edge.opposite else ""], ["", *ids[:-1]]
    (right_lines, rights), (left_lines, lefts) = (outer_lines, outers), (inner_lines, inners)
    if borders.left_hand:
        (right_lines, rights), (left_lines, lefts) = (left_lines, lefts), (right_lines, rights)
    for number, lane in enumerate(lanes):
        yield Strip(
            id=lane.id,
            lane=lane.id,
            kind=lane.kind,
            left_m=borders.left_m[lane.id],
            right_m=borders.right_m[lane.id],
            left_line=left_lines[number],
            right_line=right_lines[number],
            road=lane.edge,
            index=-number - 1 if borders.left_hand else number - len(lanes),
            junction=lane.junction,
            continues=edge.continues,
            speed_mps=lane.speed_mps,
            structure=edge.on_structure,
            tunnel=edge.in_tunnel,
            left=lefts[number],
            right=rights[number],
            following=lane.successors,
            outline_m=lane.outline_m,
        )


def _crosswalk(lane: Lane, borders: _Borders) -> Crosswalk:
    """The crosswalk on a crossing."""
    across_m = lane.centerline_m[-1, :2] - lane.centerline_m[0, :2]
    outline_m = np.concatenate([borders.left_m[lane.id], borders.right_m[lane.id][::-1]])
    return Crosswalk(outline_m, across_m / np.linalg.norm(across_m))


def _stop_lines(net: SumoNet, edges: Mapping[str, _Edge], borders: _Borders) -> Iterator[StopLine]:
    """A line across the driving lanes of each approach that has traffic lights, must stop or must give way."""
    controlled_lanes = {link.lane for link in net.links}
    minor = minor_approaches(net)
    for name, edge in edges.items():
        driving = [lane for lane in edge.lanes if lane.kind is LaneKind.DRIVING]
        halts = bool(driving) and not driving[0].junction and controlled_lanes.issuperset(lane.id for lane in driving)
        if not halts and name not in minor:
            continue
        for is_driving, group in groupby(edge.lanes, key=lambda lane: lane.kind is LaneKind.DRIVING):
            side_by_side = list(group)
            if is_driving:
                right, left = (-1, 0) if borders.left_hand else (0, -1)
                ends_m = _across(borders.right_m[side_by_side[right].id], borders.left_m[side_by_side[left].id])
                yield StopLine(ends_m, yields=not halts and minor[name] is SignKind.YIELD)


def _across(right_m: Float64Array, left_m: Float64Array) -> Float64Array:
    """(2, 3) ends, right to left, of a line across lanes with (N, 3) outer borders, shortly before their end."""
    lines = Polylines.from_lines([right_m, left_m])
    ends_m = lines.values(lines.parameter(np.arange(2), lines.length_m - _STOP_LINE_M))
    inward = (ends_m[1] - ends_m[0]) / np.linalg.norm(ends_m[1] - ends_m[0])
    return ends_m + _STOP_LINE_MARGIN_M * np.array([inward, -inward])
