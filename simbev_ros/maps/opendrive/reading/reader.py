"""Reads the roads and junctions of an OpenDRIVE file into a Document; unusable roads are left out, with a note."""

import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import cast
from xml.etree.ElementTree import Element

import numpy as np

from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.findings import Findings
from simbev_ros.maps.opendrive.reading.attributes import Malformed, identifier, number, start_of
from simbev_ros.maps.opendrive.reading.cubics import Cubics
from simbev_ros.maps.opendrive.reading.document import Connection, Contact, Document, Link, Road, RoadEnd, Shape
from simbev_ros.maps.opendrive.reading.lane_reader import read_sections, read_speed
from simbev_ros.maps.opendrive.reading.plan_view import PlanView
from simbev_ros.maps.opendrive.reading.tables import DEFAULT_SPEEDS_MPS, LANE_KINDS
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.safe_xml import place_of

_LENGTH_TOLERANCE_M = 0.01
_MAX_ROAD_M = 200e3
_MAX_MAP_M = 20e6
_MAX_ROADS = 50_000
_MIN_ROAD_M = 1e-3
_MAX_HEIGHT_M = 10e3
_MAX_OFFSET_M = 200.0
_MAX_T_M = 20.0  # half the width of a wide road, as far as its lateral profile is checked
_MAX_LANES = 20  # of a road, as far as its loss is concerned


def read_document(path: Path, root: Element, notes: Findings) -> Document:
    """Read the roads and junctions from the XML of a file.

    Args:
        path: The file, named in errors.
        root: Its XML root.
        notes: Receives repairs and omissions.

    Raises:
        InputError: The file has another major version, or its roads are too many or too long.
    """
    _check_version(path, root)
    count = sum(1 for _ in root.iterfind("road"))
    if count > _MAX_ROADS:
        raise InputError(f"{path}: has {count} roads; at most {_MAX_ROADS} are read. Extract the part that you need")
    roads: dict[str, Road] = {}
    for element in root.findall("road"):
        if not element.get("id"):
            element.set("id", f"unnamed{len(roads)}")
            notes.repaired("a road without an id is given one", element, element.attrib["id"])
        try:
            road = _read_road(element, notes)
        except Malformed as problem:
            detail = f"road {element.get('id')}: {problem}"
            notes.left_out("a road that cannot be used is left out", problem.element, detail, *_place_of(element))
            continue
        if road.id in roads:
            rule = "a road with the id of an earlier one is left out"
            notes.left_out(rule, element, f"road {road.id}", *_place_of(element))
            continue
        roads[road.id] = road
    if sum(road.length_m for road in roads.values()) > _MAX_MAP_M:
        raise InputError(f"{path}: its roads are longer than {_MAX_MAP_M / 1e3:g} km in all")
    return Document(path, root, roads, tuple(_iter_connections(root, roads, notes)))


def _place_of(road: Element) -> tuple[Float64Array | None, float]:
    """(2,) start of a road that is lost, None if it is unknown, and the length of its driving lanes."""
    numbers = []
    for element, name in (
        (road.find("planView/geometry"), "x"),
        (road.find("planView/geometry"), "y"),
        (road, "length"),
    ):
        try:
            numbers.append(math.nan if element is None else number(element, name))
        except Malformed:
            numbers.append(math.nan)
    x_m, y_m, length_m = numbers
    count = sum(LANE_KINDS.get(lane.get("type", "")) is LaneKind.DRIVING for lane in road.iter("lane"))
    is_known = math.isfinite(x_m) and math.isfinite(y_m)
    return (np.array([x_m, y_m]) if is_known else None), max(np.nan_to_num(length_m), 0.0) * min(count, _MAX_LANES)


def _check_version(path: Path, root: Element) -> None:
    header = root.find("header")
    major = "1" if header is None else header.get("revMajor", "1")
    if _whole(major) not in (1, None):
        raise InputError(f"{place_of(path, root)}: OpenDRIVE revMajor={major[:20]!r}; only 1 can be read")


def _read_road(element: Element, notes: Findings) -> Road:
    """Read one <road>."""
    road_id = identifier(element)
    plan = PlanView.read(element.findall("planView/geometry"), element, notes)
    length_m = _road_length_m(element, plan, notes)
    junction = element.get("junction", "-1")
    types = element.findall("type")
    left, right = read_sections(element, length_m, notes)
    return Road(
        id=road_id,
        junction="" if junction == "-1" else junction,
        length_m=length_m,
        left_hand=element.get("rule", "RHT").upper() == "LHT",
        plan=plan,
        elevation=Cubics.read(element.findall("elevationProfile/elevation"), notes, length_m, _MAX_HEIGHT_M),
        superelevation=Cubics.read(element.findall("lateralProfile/superelevation"), notes, length_m, math.pi / 2.0),
        crossfall=_read_crossfall(element, length_m, notes),
        shape=_read_shape(element, notes),
        offset=Cubics.read(element.findall("lanes/laneOffset"), notes, length_m, _MAX_OFFSET_M),
        left=left,
        right=right,
        speeds=tuple(
            sorted((start_of(kind, "s", notes, is_optional=True), _read_type_speed(kind, notes)) for kind in types)
        ),
        predecessor=_read_link(element.find("link/predecessor")),
        successor=_read_link(element.find("link/successor")),
        bridges=_read_stretches(element, "bridge", notes),
        tunnels=_read_stretches(element, "tunnel", notes),
        element=element,
    )


def _road_length_m(element: Element, plan: PlanView, notes: Findings) -> float:
    """The road's length: as declared, unless its geometry contradicts it."""
    try:
        declared_m = number(element, "length")
    except Malformed:
        declared_m = math.nan
    length_m = declared_m
    if plan.end_m > _MAX_ROAD_M and _MIN_ROAD_M <= declared_m <= _MAX_ROAD_M:
        notes.repaired("a road's geometry is too long: the road ends as declared", element, f"road {element.get('id')}")
    elif not abs(declared_m - plan.end_m) <= _LENGTH_TOLERANCE_M:
        length_m = plan.end_m
        notes.repaired(
            "a road's length is not that of its geometry, which is used", element, f"road {element.get('id')}"
        )
    if not _MIN_ROAD_M <= length_m <= _MAX_ROAD_M:
        raise Malformed(element, f"its length of {length_m:g} m is not between 1 mm and {_MAX_ROAD_M / 1e3:g} km")
    return length_m


def _read_type_speed(kind: Element, notes: Findings) -> float:
    """Speed limit of a <type>, m/s."""
    speed = kind.find("speed")
    stated_mps = None if speed is None else read_speed(speed, notes)
    return stated_mps or DEFAULT_SPEEDS_MPS.get(kind.get("type", ""), DEFAULT_SPEEDS_MPS["default"])


def _read_crossfall(element: Element, length_m: float, notes: Findings) -> tuple[Cubics, Cubics]:
    """Crossfall of the left and of the right side."""
    records = element.findall("lateralProfile/crossfall")
    left, right = (
        Cubics.read(
            [record for record in records if record.get("side", "both") in (side, "both")],
            notes,
            length_m,
            math.pi / 2.0,
        )
        for side in ("left", "right")
    )
    return left, right


def _read_shape(element: Element, notes: Findings) -> tuple[Shape, ...]:
    """Lateral profiles, in order of s."""
    stations: dict[float, list[Element]] = {}
    for record in element.findall("lateralProfile/shape"):
        stations.setdefault(start_of(record, "s", notes), []).append(record)
    shapes = ((s_m, Cubics.read(stations[s_m], notes, _MAX_T_M, _MAX_HEIGHT_M, "t")) for s_m in sorted(stations))
    return tuple(Shape(s_m, heights) for s_m, heights in shapes if heights)


def _read_stretches(element: Element, kind: str, notes: Findings) -> tuple[tuple[float, float], ...]:
    """Stretches of a road on bridges, or in tunnels, disjoint and ascending; those that cannot be read are left out."""
    stretches = []
    for item in element.findall(f"objects/{kind}"):
        try:
            start_m = number(item, "s")
            stretches.append((start_m, start_m + number(item, "length")))
        except Malformed as problem:
            notes.left_out(f"a {kind} that cannot be read is left out", item, str(problem))
    joined: list[tuple[float, float]] = []
    for start_m, end_m in sorted(stretches):
        if joined and start_m <= joined[-1][1]:
            joined[-1] = joined[-1][0], max(joined[-1][1], end_m)
        elif start_m < end_m:
            joined.append((start_m, end_m))
    return tuple(joined)


def _read_link(element: Element | None) -> Link:
    """Link of one end of a road."""
    if element is None:
        return Link()
    target = element.get("elementId", "")
    if element.get("elementType", "road") == "junction":
        return Link(junction=target)
    contact = element.get("contactPoint", "")
    return Link(end=RoadEnd(target, cast(Contact, contact))) if contact in ("start", "end") else Link()


def _iter_connections(root: Element, roads: dict[str, Road], notes: Findings) -> Iterator[Connection]:
    """Yield the connections of all junctions; those of missing roads are left out."""
    for element in root.findall("junction/connection"):
        incoming = element.get("incomingRoad", "")
        entered = element.get("connectingRoad") or element.get("linkedRoad", "")
        contact = element.get("contactPoint", "")
        if incoming not in roads or entered not in roads or contact not in ("start", "end"):
            notes.left_out("a junction's connection of missing roads is left out", element)
            continue
        links = [(_whole(link.get("from", "")), _whole(link.get("to", ""))) for link in element.findall("laneLink")]
        lanes = tuple((start, end) for start, end in links if start is not None and end is not None)
        if len(lanes) < len(links):
            notes.left_out("a lane link of a junction with invalid lane numbers is left out", element)
            if not lanes:
                continue
        yield Connection(incoming, RoadEnd(entered, cast(Contact, contact)), lanes or None)


def _whole(text: str) -> int | None:
    """The whole number that a text begins with."""
    match = re.match(r"\s*([+-]?\d{1,9})", text)
    return None if match is None else int(match[1])
