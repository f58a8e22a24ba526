"""Reads a SUMO net (.net.xml) into lanes and junctions, with the links that traffic lights control."""

from collections import defaultdict
from dataclasses import dataclass, replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from simbev_ros.errors import SimulationError
from simbev_ros.maps.lane_kind import LaneKind
from simbev_ros.maps.network import Junction, Lane
from simbev_ros.types import Float64Array

_DEFAULT_WIDTH_M = 3.2  # SUMO's width of a lane that names none
_MIN_STEP_M = 0.01
_MOTOR_CLASSES = frozenset({"passenger", "delivery", "bus", "truck", "taxi", "private", "emergency", "motorcycle"})


@dataclass(frozen=True, slots=True)
class ControlledLink:
    """A movement from one lane that a traffic light controls.

    Attributes:
        lane: Id of the lane that it comes from.
        programme: SUMO's traffic-light id.
        link: Index into the programme's state string.
        direction: SUMO's code: s straight, l left, r right, L and R partly, t turn-around.
    """

    lane: str
    programme: str
    link: int
    direction: str


@dataclass(frozen=True, slots=True)
class SumoNet:
    """What is in the file: lanes and junctions by id, and the controlled links of driving lanes in file order."""

    lanes: dict[str, Lane]
    junctions: dict[str, Junction]
    links: tuple[ControlledLink, ...]


def read_sumo_net(path: Path) -> SumoNet:
    """Read a net.

    Raises:
        SimulationError: The file is missing or is not a SUMO net.
    """
    try:
        root = ElementTree.parse(path).getroot()
    except (OSError, ElementTree.ParseError) as error:
        raise SimulationError(f"{path}: not a SUMO net: {error}") from error
    connections = root.findall("connection")
    successors = _successors(connections)
    lanes = {
        lane.id: lane
        for edge in root.findall("edge")
        for element in edge.findall("lane")
        for lane in [_lane(edge, element, successors)]
    }
    links = tuple(
        ControlledLink(lane, connection.attrib["tl"], int(connection.attrib["linkIndex"]), connection.attrib["dir"])
        for connection in connections
        if "tl" in connection.attrib
        for lane in [_lane_id(connection, "from")]
        if lanes[lane].kind is LaneKind.DRIVING
    )
    signalised = {lanes[link.lane].edge for link in links}
    ends = {edge.attrib["id"]: edge.attrib.get("to", "") for edge in root.findall("edge")}
    lit_junctions = {ends[edge] for edge in signalised}
    junctions = {
        element.attrib["id"]: _junction(element, lit_junctions)
        for element in root.findall("junction")
        if element.attrib.get("type") not in ("internal", "dead_end")
    }
    return SumoNet(lanes, junctions, links)


def _lane_id(connection: ElementTree.Element, end: str) -> str:
    """Id of the lane at one end ("from" or "to") of a connection."""
    return f"{connection.attrib[end]}_{connection.attrib[end + 'Lane']}"


def _successors(connections: list[ElementTree.Element]) -> dict[str, tuple[str, ...]]:
    """Lane id → ids of the lanes that follow, through a junction by way of the internal lane."""
    following: dict[str, dict[str, None]] = defaultdict(dict)
    for connection in connections:
        following[_lane_id(connection, "from")][connection.get("via") or _lane_id(connection, "to")] = None
    return {lane: tuple(ids) for lane, ids in following.items()}


def _lane(edge: ElementTree.Element, element: ElementTree.Element, successors: dict[str, tuple[str, ...]]) -> Lane:
    """One lane of an edge."""
    lane_id, edge_id = element.attrib["id"], edge.attrib["id"]
    kind = _kind(edge, element)
    shape_m = _points(element.attrib["shape"])
    lane = Lane(
        id=lane_id,
        edge=edge_id,
        index=int(element.attrib["index"]),
        kind=kind,
        centerline_m=_cleaned(shape_m),
        width_m=float(element.attrib.get("width", _DEFAULT_WIDTH_M)),
        speed_mps=float(element.attrib["speed"]),
        junction=edge_id[1:].rsplit("_", 1)[0] if edge_id.startswith(":") else "",
        successors=successors.get(lane_id, ()),
        outline_m=shape_m[:, :2] if kind is LaneKind.WALKING_AREA else None,
    )
    return replace(lane, sumo_s_per_m=float(element.attrib["length"]) / max(lane.length_m, _MIN_STEP_M))


def _kind(edge: ElementTree.Element, element: ElementTree.Element) -> LaneKind:
    """What a lane is for, from its edge's function and the vehicle classes that may use it."""
    function = edge.get("function", "")
    if function == "crossing":
        return LaneKind.CROSSING
    if function == "walkingarea":
        return LaneKind.WALKING_AREA
    allowed = frozenset(element.get("allow", "").split())
    disallowed = frozenset(element.get("disallow", "").split())
    open_to_motors = not disallowed.issuperset(_MOTOR_CLASSES) and "all" not in disallowed
    if allowed & _MOTOR_CLASSES or (not allowed and open_to_motors):
        return LaneKind.DRIVING
    if "pedestrian" in allowed:
        return LaneKind.SIDEWALK
    return LaneKind.BICYCLE if "bicycle" in allowed else LaneKind.SHOULDER


def _junction(element: ElementTree.Element, signalised: set[str]) -> Junction:
    """One junction."""
    identifier = element.attrib["id"]
    center_m = np.array([float(element.attrib.get(axis, 0.0)) for axis in "xyz"])
    return Junction(identifier, center_m, _points(element.get("shape", ""))[:, :2], identifier in signalised)


def _points(shape: str) -> Float64Array:
    """(N, 3) float64 points of SUMO's "x,y x,y" or "x,y,z x,y,z"."""
    points = np.array([[*map(float, point.split(","))] for point in shape.split()], np.float64)
    if points.size == 0:
        return np.zeros((0, 3))
    return points if points.shape[1] == 3 else np.column_stack([points, np.zeros(len(points))])


def _cleaned(line_m: Float64Array) -> Float64Array:
    """(N, 3) line without points that repeat their predecessor; both ends stay."""
    steps_m = np.linalg.norm(np.diff(line_m[:, :2], axis=0), axis=1)
    keep = np.concatenate([[True], steps_m >= _MIN_STEP_M])
    if len(line_m) > 2 and not keep[-1]:
        keep[np.flatnonzero(keep)[-1]], keep[-1] = np.count_nonzero(keep) == 1, True
    return line_m[keep] if np.count_nonzero(keep) > 1 else line_m[[0, -1]]
