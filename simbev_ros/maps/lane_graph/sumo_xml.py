"""Writes the traffic of a map as SUMO's plain XML and lets netconvert build the net."""

from collections import defaultdict
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree.ElementTree import Element, ElementTree, SubElement, indent

import numpy as np

from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.lane_graph.traffic import Traffic, TrafficLane
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.sumo import netconvert

_OPTIONS = (
    "--no-turnarounds=true",
    "--walkingareas=true",
    "--offset.disable-normalization=true",
    "--junctions.internal-link-detail=20",
    "--junctions.corner-detail=8",
    "--geometry.max-grade=100",
    "--output.original-names=true",
    "--precision=3",
)
_NOT_ON_ROADS = (
    "pedestrian wheelchair tram rail_urban rail rail_electric rail_fast subway cable_car ship aircraft drone "
    "container scooter"
)
_NODE_OUTLINE_M = np.array([[0.0, 0.0, 0.0], [0.01, 0.0, 0.0], [0.01, 0.01, 0.0]])
"""Outline of a node, small enough that netconvert does not shorten lanes: they already end where junctions begin."""
_NOBODY = "rail_electric"  # a class that uses no road: netconvert refuses an empty list
_NO_BOUNDARY = "0.00,0.00,0.00,0.00"
_SIDEWALK_MPS = 2.78
_FAST_MPS = 22.0


@dataclass(frozen=True, slots=True, eq=False)
class PlannedCrossing:
    """A pedestrian crossing of the edges of one arm of a junction.

    Attributes:
        node: The junction.
        edges: Ids of the crossed edges.
        line_m: (2, 3) center line of the file's crosswalk, from curb to curb, with the junction on its left (in
            left-hand traffic on its right); None: netconvert chooses the position.
        width_m: Width of the crossing.
    """

    node: str
    edges: tuple[str, ...]
    line_m: Float64Array | None
    width_m: float


@dataclass(frozen=True, slots=True, eq=False)
class RightOfWay:
    """Right of way according to signals and signs.

    Attributes:
        signalized_nodes: Nodes with traffic lights.
        yielding: Edges that yield at their end.
        stopping: Edges that stop at their end.
        crossings: Pedestrian crossings.
    """

    signalized_nodes: Collection[str] = ()
    yielding: Collection[str] = ()
    stopping: Collection[str] = ()
    crossings: Sequence[PlannedCrossing] = field(default_factory=tuple)


def build_net(traffic: Traffic, right_of_way: RightOfWay, left_hand: bool, work: Path, projection: str = "") -> Path:
    """Build the net as ``map.net.xml``, and its OpenDRIVE file as ``sumo.xodr``, in the work folder.

    Args:
        traffic: Edges and connections.
        right_of_way: Right of way at the ends of edges.
        left_hand: Traffic keeps to the left.
        work: The folder.
        projection: PROJ string of the map frame, for the geoReference of the OpenDRIVE file; "": none.

    Returns:
        The net.

    Raises:
        SimulationError: netconvert failed, or took too much time or memory.
    """
    net = work / "map.net.xml"
    files = {"nodes": work / "map.nod.xml", "edges": work / "map.edg.xml", "connections": work / "map.con.xml"}
    for kind, root in (
        ("nodes", _nodes(traffic, right_of_way, projection)),
        ("edges", _edges(traffic, right_of_way)),
        ("connections", _connections(traffic, right_of_way)),
    ):
        indent(root)
        ElementTree(root).write(files[kind], encoding="utf-8")
    arguments = [f"--node-files={files['nodes']}", f"--edge-files={files['edges']}"]
    arguments += [f"--connection-files={files['connections']}", *_OPTIONS]
    arguments += ["--lefthand=true"] if left_hand else []
    netconvert.run_netconvert(arguments, net, work / "sumo.xodr")
    return net


def _nodes(traffic: Traffic, right_of_way: RightOfWay, projection: str) -> Element:
    """All nodes as XML."""
    stops: dict[str, list[bool]] = defaultdict(list)
    for edge in traffic.edges:
        stops[edge.end].append(edge.id in right_of_way.stopping)
    root = Element("nodes")
    if projection:
        boundary = {"convBoundary": _NO_BOUNDARY, "origBoundary": _NO_BOUNDARY}
        SubElement(root, "location", boundary, netOffset="0.00,0.00", projParameter=projection)
    for name, (x, y, z) in traffic.node_positions_m().items():
        corners_m = np.array([x, y, z]) + _NODE_OUTLINE_M
        attributes_xyz = {"x": f"{x:.3f}", "y": f"{y:.3f}", "z": f"{z:.3f}"}
        node = SubElement(root, "node", attributes_xyz, id=name, shape=_shape(corners_m))
        if name in right_of_way.signalized_nodes:
            node.set("type", "traffic_light")
        elif len(stops[name]) > 1 and all(stops[name]):
            node.set("type", "allway_stop")
        elif any(stops[name]):
            node.set("type", "priority_stop")
    return root


def _edges(traffic: Traffic, right_of_way: RightOfWay) -> Element:
    """All edges as XML, with the exact shapes of their lanes."""
    root = Element("edges")
    minor = {*right_of_way.yielding, *right_of_way.stopping}
    for edge in traffic.edges:
        fast = max(lane.speed_mps for lane in edge.lanes) > _FAST_MPS
        attributes = {"id": edge.id, "from": edge.start, "to": edge.end, "shape": _shape(edge.inner_m)}
        attributes["priority"] = "1" if edge.id in minor else "3" if fast else "2"
        element = SubElement(root, "edge", attributes, numLanes=str(len(edge.lanes)))
        for index, lane in enumerate(edge.lanes):
            element.append(_lane(index, lane))
    return root


def _lane(index: int, lane: TrafficLane) -> Element:
    """One lane as XML, with the lanes of the file that it represents."""
    walkable = lane.kind is LaneKind.SIDEWALK
    element = Element(
        "lane",
        index=str(index),
        speed=f"{_SIDEWALK_MPS if walkable else lane.speed_mps:.3f}",
        width=f"{lane.width_m:.3f}",
        shape=_shape(lane.line_m),
        type=lane.kind.value,
    )
    if lane.allowed:
        element.set("allow", lane.allowed)
    else:
        element.set("disallow", _NOT_ON_ROADS)
    for side, is_allowed in (("Left", lane.may_change_left), ("Right", lane.may_change_right)):
        if not is_allowed:
            element.set(f"change{side}", _NOBODY)
    SubElement(element, "param", key="origId", value=" ".join(f"{key.road}_{key.lane}" for key in lane.keys))
    return element


def _connections(traffic: Traffic, right_of_way: RightOfWay) -> Element:
    """All connections, edges without successors, and crossings as XML."""
    root = Element("connections")
    connected = set()
    for connection in traffic.connections:
        (start, start_index), (goal, goal_index) = connection.start, connection.goal
        connected.add(start)
        attributes = {"from": start, "to": goal, "fromLane": str(start_index), "toLane": str(goal_index)}
        element = SubElement(root, "connection", attributes)
        if connection.line_m is not None:
            element.set("shape", _shape(connection.line_m))
    for edge in traffic.edges:
        if edge.id not in connected:
            SubElement(root, "connection", {"from": edge.id})
    for crossing in right_of_way.crossings:
        attributes = {"node": crossing.node, "edges": " ".join(crossing.edges), "width": f"{crossing.width_m:.2f}"}
        element = SubElement(root, "crossing", attributes)
        if crossing.line_m is not None:
            element.set("shape", _shape(crossing.line_m))
    return root


def _shape(line_m: Float64Array) -> str:
    """SUMO's notation of an (N, 3) line."""
    return " ".join(f"{x:.3f},{y:.3f},{z:.3f}" for x, y, z in line_m.tolist())
