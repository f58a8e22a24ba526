"""Signals of an OpenDRIVE file: traffic lights and signs, where they stand and which lanes they are for."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import NamedTuple
from xml.etree.ElementTree import Element

import numpy as np

from simbev_ros.maps.opendrive.borders import point_m
from simbev_ros.maps.opendrive.reading.attributes import Malformed, Notes, number
from simbev_ros.maps.opendrive.reading.document import Document, LaneKey, Road
from simbev_ros.maps.opendrive.reading.tables import NAMED_SPEED_LIMIT, SIGNAL_MEANINGS, SPEED_UNITS_MPS
from simbev_ros.maps.opendrive.sides import drives_forward_at, driving_lanes_at
from simbev_ros.types import Float64Array

_FASTEST_MPS = 60.0
_PAINTED = ("stencil", "roadmark")


class _Use(NamedTuple):
    """A place where a signal is in force."""

    road: Road
    s_m: float
    t_m: float
    orientation: str
    validity: tuple[tuple[int, int], ...]


@dataclass(frozen=True, slots=True, eq=False)
class Signal:
    """A traffic light, sign or stop line.

    Attributes:
        id: The file's.
        meaning: As in ``SIGNAL_MEANINGS``.
        road: The road that it stands at.
        s_m: Where along it.
        position_m: (3,) on the road's surface where it stands, map frame.
        bottom_m: Height of its lower edge above the surface.
        height_m: Its own height, 0 if the file does not say.
        axis_rad: Direction across its face, forth or back: editors do not agree which.
        traffic_rad: Direction of the traffic that it stands beside.
        forward: Whether it is for traffic that runs as s does.
        lanes: The lanes that it is for.
        speed_mps: Of speed limits, else 0.
        painted: Paint on the road, not a thing on a post.
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


def read_signals(document: Document, notes: Notes) -> tuple[Signal, ...]:
    """All signals whose meaning is known, in the file's order."""
    found = list(_elements(document, notes))
    uses: dict[str, list[_Use]] = {}
    for road in document.roads.values():
        for element in road.element.findall("signals/signalReference"):
            try:
                uses.setdefault(element.get("id", ""), []).append(_use(road, element))
            except Malformed as problem:
                notes.add("a reference to a signal that cannot be read is left out", element, str(problem))
    inverted = _inverted([*(own for _, _, own in found), *chain.from_iterable(uses.values())])
    if inverted:
        notes.add(
            "orientations of signals contradict the lanes that they are valid for; they are read the other way round"
        )
    signals = []
    for meaning, element, own in found:
        try:
            signals.append(_signal(document, meaning, element, own, uses.get(element.get("id", ""), ()), inverted))
        except Malformed as problem:
            notes.add("a signal that cannot be read is left out", element, str(problem))
    return tuple(signals)


def _elements(document: Document, notes: Notes) -> Iterator[tuple[str, Element, _Use]]:
    """Elements that are signals, with their meaning and the place of their own."""
    for road in document.roads.values():
        candidates = [(e, _meaning(e)) for e in road.element.findall("signals/signal")]
        objects = road.element.findall("objects/object")
        candidates += [(e, "speed_limit") for e in objects if NAMED_SPEED_LIMIT.match(e.get("name", ""))]
        for element, meaning in candidates:
            if not meaning:
                continue
            try:
                yield meaning, element, _use(road, element)
            except Malformed as problem:
                notes.add("a signal that cannot be read is left out", element, str(problem))


def _meaning(element: Element) -> str:
    """What a <signal> means; "" if that is not known."""
    known = SIGNAL_MEANINGS.get(element.get("type", "").upper(), "")
    return known or ("speed_limit" if NAMED_SPEED_LIMIT.match(element.get("name", "")) else "")


def _use(road: Road, element: Element) -> _Use:
    """Where a <signal> or <signalReference> is in force."""
    validity = tuple((int(number(v, "fromLane")), int(number(v, "toLane"))) for v in element.findall("validity"))
    s_m, t_m = number(element, "s"), number(element, "t", 0.0)
    return _Use(road, s_m, t_m, element.get("orientation", "none"), validity)


def _valid_lanes(use: _Use) -> list[tuple[LaneKey, bool]]:
    """Driving lanes that a use is explicitly valid for, each with whether it runs as s does."""
    return [
        (key, use.road.drives_forward(lane))
        for key, lane in driving_lanes_at(use.road, use.s_m)
        if any(min(pair) <= lane.id <= max(pair) for pair in use.validity)
    ]


def _inverted(uses: Sequence[_Use]) -> bool:
    """Whether "+" stands for traffic against s, as some editors write it: the majority of explicit validities tells.

    Where there are none, the side of the road tells: signs stand on the side of the traffic that they are for.
    """
    votes = [0, 0]
    for use in uses:
        if use.orientation not in ("+", "-"):
            continue
        directions = {forward for _, forward in _valid_lanes(use)}
        if len(directions) == 1:
            votes[0] += 1 if directions.pop() == (use.orientation == "+") else -1
        elif not directions and use.t_m != 0.0:
            votes[1] += 1 if drives_forward_at(use.road, use.s_m, use.t_m) == (use.orientation == "+") else -1
    return (votes[0] or votes[1]) < 0


def _lanes(use: _Use, inverted: bool) -> list[LaneKey]:
    """The driving lanes that a use is for: those that it names, else those of its direction."""
    valid = _valid_lanes(use)
    if valid:
        return [key for key, _ in valid]
    lanes = driving_lanes_at(use.road, use.s_m)
    if use.orientation not in ("+", "-"):
        return [key for key, _ in lanes]
    forward = (use.orientation == "+") != inverted
    return [key for key, lane in lanes if use.road.drives_forward(lane) == forward]


def _signal(
    document: Document, meaning: str, element: Element, own: _Use, references: Sequence[_Use], inverted: bool
) -> Signal:
    """One signal; where others refer to it, it is for their lanes, and for its own only if it names them."""
    uses = [*references, *([own] if not references or _valid_lanes(own) else [])]
    directions = {forward for _, forward in _valid_lanes(own)}
    if own.orientation in ("+", "-"):
        forward = (own.orientation == "+") != inverted
    else:
        forward = directions.pop() if len(directions) == 1 else drives_forward_at(own.road, own.s_m, own.t_m)
    position_m, heading_rad, bottom_m = _placed(document, element, own)
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
        lanes=tuple(dict.fromkeys(key for use in uses for key in _lanes(use, inverted))),
        speed_mps=_speed_mps(element) if meaning == "speed_limit" else 0.0,
        painted=name.startswith(_PAINTED),
    )


def _placed(document: Document, element: Element, own: _Use) -> tuple[Float64Array, float, float]:
    """(3,) place on the road's surface, heading of the road there, and height above it, where a signal stands."""
    road, s_m, t_m, place = own.road, own.s_m, own.t_m, element
    physical = element.find("positionRoad")
    if physical is not None and physical.get("roadId") in document.roads:
        place, road = physical, document.roads[physical.get("roadId", "")]
        s_m, t_m = number(place, "s"), number(place, "t")
    position_m = point_m(road, s_m, t_m)
    bottom_m = number(place, "zOffset", 0.0)
    inertial = element.find("positionInertial")
    if inertial is not None:
        bottom_m = number(inertial, "z") - float(position_m[2])
        position_m = np.array([number(inertial, "x"), number(inertial, "y"), position_m[2]])
    heading_rad = float(own.road.plan(np.array([own.s_m]))[2][0])
    return position_m, heading_rad, bottom_m


def _speed_mps(element: Element) -> float:
    """What a speed limit says: its value and unit, else its German subtype, else its name.

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
    if not 1.0 < speed_mps <= _FASTEST_MPS:
        raise Malformed(element, "its speed is neither in value, nor in subtype, nor in its name")
    return speed_mps
