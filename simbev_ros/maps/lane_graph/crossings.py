"""Plans pedestrian crossings of the SUMO net at the file's crosswalks, and adds crosswalks at SUMO's crossings."""

from collections import defaultdict
from collections.abc import Collection, Iterator, Sequence
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import shapely

from simbev_ros.foundation.geometry.plan_view import left_of
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.lane_graph.sumo_xml import PlannedCrossing
from simbev_ros.maps.lane_graph.traffic import Traffic, TrafficEdge
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.layout import Crosswalk

_WIDTH_M = 3.0
_FAST_MPS = 14.0
_MAX_DISTANCE_M = 30.0
_SAME_LEVEL_M = 3.0
_REFUGE_M = 1.0  # narrowest median on which people wait halfway
_End = tuple[str, str, str]


def planned_crossings(
    crosswalks: Sequence[Crosswalk], traffic: Traffic, signalized_nodes: Collection[str], left_hand: bool
) -> tuple[PlannedCrossing, ...]:
    """Crossings at the crosswalks that lie across one arm of a junction, and by rule at junctions without crosswalks.

    Args:
        crosswalks: Crosswalks of the file.
        traffic: The roads of the SUMO net.
        signalized_nodes: Nodes with traffic lights; at other nodes, fast roads are crossed only on the file's
            crosswalks.
        left_hand: Traffic keeps to the left.
    """
    node_positions_m = traffic.node_positions_m()
    found: dict[tuple[str, frozenset[str]], PlannedCrossing] = {}
    for crosswalk, ends in zip(crosswalks, _crossed_edges(crosswalks, traffic), strict=True):
        arms: dict[tuple[str, str], set[str]] = defaultdict(set)
        for node, road, edge in ends:
            arms[node, road].add(edge)
        if arms:
            (node, _), edges = max(arms.items(), key=lambda arm: (len(arm[1]), arm[0]))
            line_m, width_m = middle_line(crosswalk)
            line_m = _orient(line_m, node_positions_m[node], left_hand)
            found.setdefault((node, frozenset(edges)), PlannedCrossing(node, tuple(sorted(edges)), line_m, width_m))
    marked = {node for node, _ in found}
    return (
        *found.values(),
        *(crossing for crossing in _by_rule(traffic, signalized_nodes) if crossing.node not in marked),
    )


def _by_rule(traffic: Traffic, signalized_nodes: Collection[str]) -> Iterator[PlannedCrossing]:
    """A crossing of each arm with a sidewalk, at nodes where at least three arms meet."""
    ends: dict[str, list[TrafficEdge]] = defaultdict(list)
    for edge in traffic.edges:
        for node in (edge.start, edge.end):
            ends[node].append(edge)
    for node, edges in ends.items():
        arms = _arms(node, edges)
        for arm in arms if len(arms) > 2 else ():
            walkable = any(lane.kind is LaneKind.SIDEWALK for edge in arm for lane in edge.lanes)
            fastest_mps = max(lane.speed_mps for edge in arm for lane in edge.lanes)
            if walkable and (node in signalized_nodes or fastest_mps < _FAST_MPS):
                yield PlannedCrossing(node, tuple(edge.id for edge in arm), None, _WIDTH_M)


def _arms(node: str, edges: Sequence[TrafficEdge]) -> list[list[TrafficEdge]]:
    """The edges at a node by arm: those of one road, and the two directions of a street that are roads of their own."""
    by_road: dict[str, list[TrafficEdge]] = defaultdict(list)
    for edge in edges:
        by_road[edge.road].append(edge)
    arms: list[list[TrafficEdge]] = []
    for road in by_road.values():
        arm = next((each for each in arms if _are_directions(node, each, road)), None)
        if arm is None:
            arms.append(road)
        else:
            arm += road
    return arms


def _are_directions(node: str, arm: Sequence[TrafficEdge], road: Sequence[TrafficEdge]) -> bool:
    """Whether one edge leads to a node, and another from it without a median that people could wait on."""
    if len(arm) != 1 or len(road) != 1 or (arm[0].end == node) == (road[0].end == node):
        return False
    first_m, second_m = (each.inner_m[-1 if each.end == node else 0, :2] for each in (arm[0], road[0]))
    return bool(np.linalg.norm(first_m - second_m) < _REFUGE_M)


def _orient(line_m: Float64Array, junction_m: Float64Array, left_hand: bool) -> Float64Array:
    """Orient a (2, 3) line as netconvert expects it: the junction on its left, in left-hand traffic on its right."""
    along_m, arm_m = (line_m[1] - line_m[0])[:2], (junction_m - line_m.mean(axis=0))[:2]
    junction_is_left = along_m[0] * arm_m[1] - along_m[1] * arm_m[0] > 0.0
    return line_m if junction_is_left != left_hand else line_m[::-1]


def middle_line(crosswalk: Crosswalk) -> tuple[Float64Array, float]:
    """(2, 3) center line of a crosswalk in walking direction, from end to end, and its width."""
    center_m = crosswalk.outline_m.mean(axis=0)
    offsets_m = (crosswalk.outline_m - center_m)[:, :2]
    along_m = offsets_m @ crosswalk.axis
    across_m = offsets_m @ left_of(crosswalk.axis)
    ends_m = [center_m + np.array([*(reach_m * crosswalk.axis), 0.0]) for reach_m in (along_m.min(), along_m.max())]
    return np.stack(ends_m), float(np.ptp(across_m))


def _crossed_edges(crosswalks: Sequence[Crosswalk], traffic: Traffic) -> list[list[_End]]:
    """For each crosswalk the node, road and id of each edge that it crosses, at that node's end of the edge.

    A path through a junction counts as its incoming edge if the crosswalk is nearer to that, else as its outgoing edge.
    """
    edges = {edge.id: edge for edge in traffic.edges}
    lines: list[Float64Array] = []
    ends: list[tuple[_End, _End]] = []
    for edge in traffic.edges:
        start, end = (edge.start, edge.road, edge.id), (edge.end, edge.road, edge.id)
        driven = [lane.line_m for lane in edge.lanes if lane.kind is not LaneKind.SIDEWALK]
        lines += driven
        ends += [(start, end)] * len(driven)
    for connection in traffic.connections:
        if connection.line_m is not None and len(connection.line_m) > 1:
            before, after = edges[connection.start[0]], edges[connection.goal[0]]
            lines.append(connection.line_m)
            ends.append(((before.end, before.road, before.id), (after.start, after.road, after.id)))
    tree = shapely.STRtree([shapely.LineString(line_m) for line_m in lines])
    return [_crossed_ends(crosswalk, tree, ends) for crosswalk in crosswalks]


def _crossed_ends(
    crosswalk: Crosswalk,
    tree: shapely.STRtree,
    ends: Sequence[tuple[_End, _End]],
) -> list[_End]:
    """The nearer ends of the lines that cross a crosswalk on its level."""
    area = shapely.make_valid(shapely.Polygon(crosswalk.outline_m[:, :2]))
    center = shapely.Point(crosswalk.outline_m[:, :2].mean(axis=0))
    found = []
    for row in tree.query(area, predicate="intersects").tolist():
        line = tree.geometries[row]
        at_m = shapely.line_locate_point(line, center)
        z_m = shapely.get_coordinates(shapely.line_interpolate_point(line, at_m), include_z=True)[0, 2]
        nearer = 0 if at_m < line.length / 2.0 else 1
        if (
            min(at_m, line.length - at_m) <= _MAX_DISTANCE_M
            and abs(z_m - crosswalk.outline_m[:, 2].mean()) < _SAME_LEVEL_M
        ):
            found.append(ends[row][nearer])
    return found


def crosswalks_of_net(net: Path) -> tuple[Crosswalk, ...]:
    """Crosswalks at all crossings of a SUMO net."""
    found = []
    for edge in ElementTree.parse(net).getroot().iterfind("edge[@function='crossing']"):
        for lane in edge.findall("lane"):
            points = [[*map(float, point.split(",")), 0.0][:3] for point in lane.attrib["shape"].split()]
            ends_m = np.array([points[0], points[-1]])
            length_m = np.linalg.norm(ends_m[1, :2] - ends_m[0, :2])
            if length_m > 0.0:
                axis = (ends_m[1, :2] - ends_m[0, :2]) / length_m
                side_m = np.array([-axis[1], axis[0], 0.0]) * float(lane.attrib["width"]) / 2.0
                outline_m = np.concatenate([ends_m - side_m, (ends_m + side_m)[::-1]])
                found.append(Crosswalk(outline_m, axis))
    return tuple(found)
