"""Reads a SUMO net (.net.xml) into lanes, junctions and movements, element by element to save memory."""

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from simbev_ros.foundation.errors import SimulationError
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.network import Junction, Lane
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.polylines import Polylines
from simbev_ros.maps.vehicle_class import open_to

_DEFAULT_WIDTH_M = 3.2  # SUMO's default lane width
_MIN_STEP_M = 0.01
_TURN_AROUND = ("t", "T")
_MOTOR_CLASSES = frozenset({"passenger", "delivery", "bus", "truck", "taxi", "private", "emergency", "motorcycle"})
_KINDS = frozenset(LaneKind) - {LaneKind.CROSSING, LaneKind.WALKING_AREA}  # kinds that the attribute `type` may name


_TUNNELS = ("yes", "true", "1")


@dataclass(frozen=True, slots=True)
class ControlledLink:
    """A movement from one lane that a traffic light controls.

    Attributes:
        lane: Id of the lane that it starts from.
        programme: Id of SUMO's traffic-light program.
        link: Index into the program's state string.
        direction: SUMO's code: s straight, l left, r right, L and R partially, t turn-around, T likewise in left-hand
            traffic.
    """

    lane: str
    programme: str
    link: int
    direction: str


@dataclass(frozen=True, slots=True)
class SumoNet:
    """The content of a SUMO net.

    Attributes:
        lanes: Lanes by id.
        junctions: Junctions by id, without dead ends.
        links: The controlled links of driving lanes, in file order.
        edge_ends: Edge id → ids of the junctions that it leads from and to; only edges outside junctions.
        structures: Ids of the edges that the file declares to be bridges.
        tunnels: Ids of the edges that it declares to be tunnels.
        verges: Ids of the edges whose sidewalks it declares to be unpaved.
        right_of_way: Lane id → SUMO's codes of its movements outside traffic lights: M has right of way, m yields, s
            stops first, w stops at an all-way stop, = yields to the right.
        left_hand: Traffic keeps to the left: the lanes of an edge are numbered from left to right.
    """

    lanes: dict[str, Lane]
    junctions: dict[str, Junction]
    links: tuple[ControlledLink, ...]
    edge_ends: dict[str, tuple[str, str]] = field(default_factory=dict)
    structures: frozenset[str] = frozenset()
    tunnels: frozenset[str] = frozenset()
    right_of_way: dict[str, frozenset[str]] = field(default_factory=dict)
    left_hand: bool = False
    verges: frozenset[str] = frozenset()


def read_sumo_net(path: Path) -> SumoNet:
    """Read a SUMO net.

    Raises:
        SimulationError: The file is missing or is not a SUMO net.
    """
    try:
        return _net(_read(path))
    except (OSError, ElementTree.ParseError, KeyError, ValueError) as error:
        raise SimulationError(f"{path}: not a SUMO net: {error}") from error


@dataclass(frozen=True, slots=True)
class _Content:
    """Attributes of the file's elements: edges with their lanes, declared structures, junctions, connections."""

    left_hand: bool
    edges: list[tuple[dict[str, str], list[dict[str, str]]]] = field(default_factory=list)
    structures: set[str] = field(default_factory=set)
    tunnels: set[str] = field(default_factory=set)
    verges: set[str] = field(default_factory=set)
    junctions: list[dict[str, str]] = field(default_factory=list)
    connections: list[dict[str, str]] = field(default_factory=list)


def _read(path: Path) -> _Content:
    """Parse the file once, without keeping its elements."""
    events = ElementTree.iterparse(path, events=("start", "end"))
    _, root = next(events)
    content = _Content(left_hand=root.get("lefthand") in ("true", "1"))
    for event, element in events:
        if event == "start" or element.tag not in ("edge", "junction", "connection"):
            continue
        if element.tag == "edge":
            content.edges.append((element.attrib, [lane.attrib for lane in element.findall("lane")]))
            parameters = {item.get("key"): item.get("value") for item in element.findall("param")}
            if parameters.get("structure"):
                content.structures.add(element.attrib["id"])
            if parameters.get("tunnel", "no") in _TUNNELS:
                content.tunnels.add(element.attrib["id"])
            if parameters.get("verge"):
                content.verges.add(element.attrib["id"])
        elif element.tag == "junction":
            content.junctions.append(element.attrib)
        else:
            content.connections.append(element.attrib)
        root.clear()
    return content


def _net(content: _Content) -> SumoNet:
    """Build the net from the attributes."""
    lanes = _lanes(content)
    edge_ends = {
        edge["id"]: (edge["from"], edge["to"])
        for edge, _ in content.edges
        if edge.get("function", "normal") == "normal"
    }
    links = tuple(_links(content.connections, lanes))
    signalized_junctions = {edge_ends[lanes[link.lane].edge][1] for link in links}
    junctions = _junctions(content, signalized_junctions)
    right_of_way = _right_of_way(content.connections)
    structures, tunnels, verges = map(frozenset, (content.structures, content.tunnels, content.verges))
    return SumoNet(lanes, junctions, links, edge_ends, structures, tunnels, right_of_way, content.left_hand, verges)


def _links(connections: Sequence[Mapping[str, str]], lanes: Mapping[str, Lane]) -> Iterator[ControlledLink]:
    """Controlled movements of driving lanes."""
    for connection in connections:
        if "tl" in connection and lanes[_lane_id(connection, "from")].kind is LaneKind.DRIVING:
            lane, link = _lane_id(connection, "from"), int(connection["linkIndex"])
            yield ControlledLink(lane, connection["tl"], link, connection["dir"])


def _right_of_way(connections: Sequence[Mapping[str, str]]) -> dict[str, frozenset[str]]:
    """Codes by lane, see ``SumoNet.right_of_way``; turning around is ignored."""
    codes: dict[str, set[str]] = defaultdict(set)
    for connection in connections:
        if (
            "tl" not in connection
            and connection.get("dir") not in _TURN_AROUND
            and not connection["from"].startswith(":")
        ):
            codes[_lane_id(connection, "from")].add(connection.get("state", ""))
    return {lane: frozenset(states) for lane, states in codes.items()}


def _lane_id(connection: Mapping[str, str], end: str) -> str:
    """Id of the lane at one end ("from" or "to") of a connection."""
    return f"{connection[end]}_{connection[end + 'Lane']}"


def _successors(connections: Sequence[Mapping[str, str]]) -> dict[str, tuple[str, ...]]:
    """Lane id → ids of the lanes that follow it; across a junction, the internal lane."""
    following: dict[str, dict[str, None]] = defaultdict(dict)
    for connection in connections:
        following[_lane_id(connection, "from")][connection.get("via") or _lane_id(connection, "to")] = None
    return {lane: tuple(ids) for lane, ids in following.items()}


def _lanes(content: _Content) -> dict[str, Lane]:
    """All lanes by id; their lines are cleaned in one batch."""
    pairs = [(edge, lane) for edge, edge_lanes in content.edges for lane in edge_lanes]
    shapes = _points([lane["shape"] for _, lane in pairs])
    lines = _remove_duplicate_points(shapes)
    following = _successors(content.connections)
    parts = zip(pairs, shapes.split(shapes.points_m), lines.split(lines.points_m), lines.length_m.tolist(), strict=True)
    return {
        lane["id"]: _lane(edge, lane, shape_m, line_m, length_m, following.get(lane["id"], ()))
        for (edge, lane), shape_m, line_m, length_m in parts
    }


def _lane(
    edge: Mapping[str, str],
    lane: Mapping[str, str],
    shape_m: Float64Array,
    line_m: Float64Array,
    length_m: float,
    successors: tuple[str, ...],
) -> Lane:
    """One lane of an edge."""
    allow, disallow = lane.get("allow", ""), lane.get("disallow", "")
    kind = _kind(edge.get("function", ""), lane.get("type", ""), allow, disallow)
    return Lane(
        id=lane["id"],
        edge=edge["id"],
        index=int(lane["index"]),
        kind=kind,
        centerline_m=line_m,
        width_m=float(lane.get("width", _DEFAULT_WIDTH_M)),
        speed_mps=float(lane["speed"]),
        junction=edge["id"][1:].rsplit("_", 1)[0] if edge["id"].startswith(":") else "",
        successors=successors,
        outline_m=_outline_m(shape_m) if kind is LaneKind.WALKING_AREA else None,
        sumo_s_per_m=float(lane["length"]) / max(length_m, _MIN_STEP_M),
        classes=open_to(allow, disallow),
    )


def _outline_m(shape_m: Float64Array) -> Float64Array | None:
    """(M, 2) outline of a walking area; None if it has no area, as netconvert writes where curbs touch."""
    outline_m = shape_m[:, :2]
    return outline_m if len(np.unique(outline_m, axis=0)) > 2 else None


@cache
def _kind(function: str, lane_type: str, allow: str, disallow: str) -> LaneKind:
    """Use of a lane: by its type, else by its edge's function and the vehicles that may use it."""
    if function == "crossing":
        return LaneKind.CROSSING
    if function == "walkingarea":
        return LaneKind.WALKING_AREA
    if lane_type in _KINDS:
        return LaneKind(lane_type)
    allowed, disallowed = frozenset(allow.split()), frozenset(disallow.split())
    open_to_motors = not disallowed.issuperset(_MOTOR_CLASSES) and "all" not in disallowed
    if allowed & _MOTOR_CLASSES or (not allowed and open_to_motors):
        return LaneKind.DRIVING
    if "pedestrian" in allowed:
        return LaneKind.SIDEWALK
    return LaneKind.BICYCLE if "bicycle" in allowed else LaneKind.SHOULDER


def _junctions(content: _Content, signalized_junctions: Set[str]) -> dict[str, Junction]:
    """All junctions by id, without dead ends."""
    found = [junction for junction in content.junctions if junction.get("type") not in ("internal", "dead_end")]
    outlines = _points([junction.get("shape", "") for junction in found])
    return {
        junction["id"]: Junction(
            junction["id"],
            np.array([float(junction.get(axis, 0.0)) for axis in "xyz"]),
            outline_m,
            junction["id"] in signalized_junctions,
        )
        for junction, outline_m in zip(found, outlines.split(outlines.points_m[:, :2]), strict=True)
    }


def _points(shapes: Sequence[str]) -> Polylines:
    """Points of many lines in SUMO's notation "x,y x,y,z"; a missing z is 0."""
    lines = [shape.split() for shape in shapes]
    points = [point if point.count(",") == 2 else point + ",0" for line in lines for point in line]
    values = np.array(",".join(points).split(",") if points else [], np.float64)
    return Polylines(values.reshape(-1, 3), np.cumsum([0, *map(len, lines)]))


def _remove_duplicate_points(lines: Polylines) -> Polylines:
    """Remove points that repeat their predecessor; both ends are kept, at least a centimeter apart."""
    first, last = lines.first[:-1], lines.first[1:] - 1
    if np.any(first >= last):
        raise ValueError("a lane has fewer than two points")
    step_m = np.linalg.norm(np.diff(lines.points_m[:, :2], axis=0, prepend=np.inf), axis=1)
    keep = step_m >= _MIN_STEP_M
    keep[first] = True
    before = np.maximum.reduceat(
        np.where(keep, np.arange(len(keep)), 0), first
    )  # the last kept point before each line's end
    keep[before[(before < last) & (before > first)]] = False
    keep[last] = True
    cleaned = Polylines(lines.points_m[keep], np.append(0, np.cumsum(np.add.reduceat(keep.astype(np.int64), first))))
    start, end = cleaned.first[:-1], cleaned.first[1:] - 1
    is_degenerate = (end - start == 1) & np.all(cleaned.points_m[start, :2] == cleaned.points_m[end, :2], axis=1)
    cleaned.points_m[end[is_degenerate], 0] += _MIN_STEP_M  # a lane without length has no direction: choose one
    return cleaned
