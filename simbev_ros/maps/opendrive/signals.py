"""Reads the signals of an OpenDRIVE file: traffic lights and signs with their positions and lanes."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import NamedTuple
from xml.etree.ElementTree import Element

import numpy as np

from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.findings import Findings
from simbev_ros.maps.opendrive.borders import point_m
from simbev_ros.maps.opendrive.reading.attributes import Malformed, number
from simbev_ros.maps.opendrive.reading.document import Document, LaneKey, Road
from simbev_ros.maps.opendrive.reading.tables import NAMED_SPEED_LIMIT, SIGNAL_MEANINGS, SPEED_UNITS_MPS
from simbev_ros.maps.opendrive.sides import drives_forward_at, driving_lanes_at

_MIN_SPEED_MPS, _MAX_SPEED_MPS = 0.1, 60.0
_PAINTED = ("stencil", "roadmark")


class _Reference(NamedTuple):
    """A position at which a signal applies: that of the signal itself, or of a reference to it."""

    road: Road
    s_m: float
    t_m: float
    orientation: str
    validity: tuple[tuple[int, int], ...]


@dataclass(frozen=True, slots=True, eq=False)
class Signal:
    """A traffic light, sign or stop line.

    Attributes:
        id: Its id in the file.
        meaning: One of the values of ``SIGNAL_MEANINGS``.
        road: The road that it stands next to.
        s_m: Its distance along the road.
        position_m: (3,) its position on the road's surface, map frame.
        bottom_m: Height of its lower edge above the surface.
        height_m: Its own height, 0 if the file has none.
        axis_rad: Direction normal to its face, up to sign: editors disagree about the sign.
        traffic_rad: Direction of the traffic that passes it.
        forward: Whether it applies to traffic in the direction of s.
        lanes: The lanes that it applies to.
        speed_mps: Value of speed limits, else 0.
        painted: Whether it is paint on the road instead of an object on a post.
    """

    id: str
    meaning: str
    road: Road
    s_m: float
    position_m: Float64Array
    bottom_m: float
    height_m: float
    axis_rad: float
    traffic_rad: float
    forward: bool
    lanes: tuple[LaneKey, ...]
    speed_mps: float
    painted: bool


def read_signals(document: Document, notes: Findings) -> tuple[Signal, ...]:
    """Read all signals of known meaning, in the file's order; unreadable ones are left out with a note."""
    elements = list(_elements(document, notes))
    uses: dict[str, list[_Reference]] = {}
    for road in document.roads.values():
        for element in road.element.findall("signals/signalReference"):
            try:
                uses.setdefault(element.get("id", ""), []).append(_read_reference(road, element, notes))
            except Malformed as problem:
                notes.left_out("a reference to a signal that cannot be read is left out", element, str(problem))
    inverted = _is_inverted([*(own for _, _, own in elements), *chain.from_iterable(uses.values())])
    if inverted:
        notes.repaired("orientations of signals contradict the lanes that they are valid for; they are inverted")
    signals = []
    for meaning, element, own in elements:
        try:
            signals.append(_signal(document, meaning, element, own, uses.get(element.get("id", ""), ()), inverted))
        except Malformed as problem:
            notes.left_out("a signal that cannot be read is left out", element, str(problem))
    return tuple(signals)


def _elements(document: Document, notes: Findings) -> Iterator[tuple[str, Element, _Reference]]:
    """Yield the elements that are signals, each with its meaning and its own position."""
    for road in document.roads.values():
        candidates = [(e, _meaning(e)) for e in road.element.findall("signals/signal")]
        objects = road.element.findall("objects/object")
        candidates += [(e, "speed_limit") for e in objects if NAMED_SPEED_LIMIT.match(e.get("name", ""))]
        for element, meaning in candidates:
            if not meaning:
                continue
            try:
                yield meaning, element, _read_reference(road, element, notes)
            except Malformed as problem:
                notes.left_out("a signal that cannot be read is left out", element, str(problem))


def _meaning(element: Element) -> str:
    """Meaning of a <signal>; "" if it is unknown."""
    known = SIGNAL_MEANINGS.get(element.get("type", "").upper(), "")
    return known or ("speed_limit" if NAMED_SPEED_LIMIT.match(element.get("name", "")) else "")


def _read_reference(road: Road, element: Element, notes: Findings) -> _Reference:
    """Read the position at which a <signal> or <signalReference> applies; an unreadable <validity> is left out."""
    validity = []
    for record in element.findall("validity"):
        try:
            validity.append((int(number(record, "fromLane")), int(number(record, "toLane"))))
        except Malformed as problem:
            notes.left_out("a validity of a signal that cannot be read is left out", record, str(problem))
    s_m, t_m = number(element, "s"), number(element, "t", 0.0)
    return _Reference(road, s_m, t_m, element.get("orientation", "none"), tuple(validity))


def _valid_lanes(reference: _Reference) -> list[tuple[LaneKey, bool]]:
    """Driving lanes that are explicitly listed as valid, each with whether it runs in the direction of s."""
    return [
        (key, reference.road.drives_forward(lane))
        for key, lane in driving_lanes_at(reference.road, reference.s_m)
        if any(min(pair) <= lane.id <= max(pair) for pair in reference.validity)
    ]


def _is_inverted(uses: Sequence[_Reference]) -> bool:
    """Whether "+" means traffic against s, as some editors write it, by majority of the explicit validities.

    If there are none, the side of the road decides: signs stand on the side of the traffic that they apply to.
    """
    votes = [0, 0]
    for reference in uses:
        if reference.orientation not in ("+", "-"):
            continue
        directions = {forward for _, forward in _valid_lanes(reference)}
        if len(directions) == 1:
            votes[0] += 1 if directions.pop() == (reference.orientation == "+") else -1
        elif not directions and reference.t_m != 0.0:
            votes[1] += (
                1
                if drives_forward_at(reference.road, reference.s_m, reference.t_m) == (reference.orientation == "+")
                else -1
            )
    return (votes[0] or votes[1]) < 0


def _lanes(reference: _Reference, inverted: bool) -> list[LaneKey]:
    """The driving lanes that a reference applies to: those that it lists, else those of its direction."""
    valid = _valid_lanes(reference)
    if valid:
        return [key for key, _ in valid]
    lanes = driving_lanes_at(reference.road, reference.s_m)
    if reference.orientation not in ("+", "-"):
        return [key for key, _ in lanes]
    forward = (reference.orientation == "+") != inverted
    return [key for key, lane in lanes if reference.road.drives_forward(lane) == forward]


def _signal(
    document: Document,
    meaning: str,
    element: Element,
    own: _Reference,
    references: Sequence[_Reference],
    inverted: bool,
) -> Signal:
    """Build one signal; if other roads refer to it, it applies to their lanes, and to its own only if it lists them."""
    uses = [*references, *([own] if not references or _valid_lanes(own) else [])]
    directions = {forward for _, forward in _valid_lanes(own)}
    if own.orientation in ("+", "-"):
        forward = (own.orientation == "+") != inverted
    else:
        forward = directions.pop() if len(directions) == 1 else drives_forward_at(own.road, own.s_m, own.t_m)
    position_m, heading_rad, bottom_m = _mounting(document, element, own)
    turn_rad = number(element, "hOffset", 0.0) if element.tag == "signal" else number(element, "hdg", 0.0)
    name = element.get("name", "").lower()
    return Signal(
        id=element.get("id", ""),
        meaning=meaning,
        road=own.road,
        s_m=own.s_m,
        position_m=position_m,
        bottom_m=bottom_m,
        height_m=number(element, "height", 0.0),
        axis_rad=heading_rad + turn_rad,
        traffic_rad=heading_rad + (0.0 if forward else np.pi),
        forward=forward,
        lanes=tuple(dict.fromkeys(key for reference in uses for key in _lanes(reference, inverted))),
        speed_mps=_speed_mps(element) if meaning == "speed_limit" else 0.0,
        painted=name.startswith(_PAINTED),
    )


def _mounting(document: Document, element: Element, own: _Reference) -> tuple[Float64Array, float, float]:
    """(3,) position of a signal on the road's surface, heading of the road there, and its height above the surface."""
    road, s_m, t_m, position_element = own.road, own.s_m, own.t_m, element
    physical = element.find("positionRoad")
    if physical is not None and physical.get("roadId") in document.roads:
        position_element, road = physical, document.roads[physical.get("roadId", "")]
        s_m, t_m = number(position_element, "s"), number(position_element, "t")
    position_m = point_m(road, s_m, t_m)
    bottom_m = number(position_element, "zOffset", 0.0)
    inertial = element.find("positionInertial")
    if inertial is not None:
        bottom_m = number(inertial, "z") - float(position_m[2])
        position_m = np.array([number(inertial, "x"), number(inertial, "y"), position_m[2]])
    heading_rad = float(own.road.plan(np.array([own.s_m]))[2][0])
    return position_m, heading_rad, bottom_m


def _speed_mps(element: Element) -> float:
    """Value of a speed limit: its value and unit, else its German subtype, else its name.

    Raises:
        Malformed: None of them is a speed.
    """
    named = NAMED_SPEED_LIMIT.match(element.get("name", ""))
    subtype = element.get("subtype", "")
    value = number(element, "value", -1.0)
    kmh = 1.0 / 3.6
    if value > 0.0:
        speed_mps = value * SPEED_UNITS_MPS.get(element.get("unit", "km/h"), kmh)
    elif named is not None:
        speed_mps = float(named[1]) * kmh
    elif subtype.isdigit() and 51 <= int(subtype) <= 63 and int(subtype) % 10:  # old German signs 274-51 to 274-63
        speed_mps = (int(subtype) - 50) * 10.0 * kmh
    else:
        speed_mps = float(subtype) * kmh if subtype.isdigit() else 0.0
    if not _MIN_SPEED_MPS <= speed_mps <= _MAX_SPEED_MPS:
        raise Malformed(element, "its speed is neither in value, nor in subtype, nor in its name")
    return speed_mps
