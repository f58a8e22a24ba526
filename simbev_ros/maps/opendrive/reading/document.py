"""What an OpenDRIVE file says, as dataclasses. Distances ``s_m`` run along the road's reference line from its start.

Lane ids: 0 is the centre line, those on its left are positive, those on its right negative, growing outward.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, NamedTuple, TypeVar
from xml.etree.ElementTree import Element

from simbev_ros.maps.opendrive.reading.cubics import Cubics
from simbev_ros.maps.opendrive.reading.plan_view import PlanView
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.layout import Line

_T = TypeVar("_T")
Contact = Literal["start", "end"]
"""An end of a road, a section or a lane, as s runs."""


class LaneKey(NamedTuple):
    """A lane of one section of a road."""

    road: str
    section: int
    lane: int

    def __str__(self) -> str:
        return f"{self.road}/{self.section}/{self.lane}"


@dataclass(frozen=True, slots=True, eq=False)
class LaneRecord:
    """A lane within one section; all records of it run along the section, from its start.

    Attributes:
        id: Its number, never 0.
        type: As the file calls it.
        kind: What it is for; None: left out of the layout.
        on_level: Kept level across where the road is banked.
        width: Width by distance from the section's start, unless there is only a ``border``.
        border: Distance of its outer border from the centre line, likewise.
        speeds: (distance, m/s) its own speed limits.
        predecessors: Lane ids at its start.
        successors: Lane ids at its end.
        reversed: Traffic runs against the direction that its side implies.
    """

    id: int
    type: str
    kind: LaneKind | None
    on_level: bool
    width: Cubics
    border: Cubics
    speeds: tuple[tuple[float, float], ...]
    predecessors: tuple[int, ...]
    successors: tuple[int, ...]
    reversed: bool


@dataclass(frozen=True, slots=True, eq=False)
class Section:
    """One side of a stretch of a road that has the same lanes.

    Attributes:
        index: Number of the lane section in the file.
        start_m: Where it starts.
        end_m: Where it ends.
        lanes: From the centre line outward: 1, 2, ... or -1, -2, ...
        marks: Lane id (0 for the centre line) → (distance from the section's start, paint of its outer border), of the
            centre line from left to right.
    """

    index: int
    start_m: float
    end_m: float
    lanes: tuple[LaneRecord, ...]
    marks: Mapping[int, tuple[tuple[float, Line], ...]]


def value_at(changes: Sequence[tuple[float, _T]], s_m: float) -> _T | None:
    """What holds at a distance, of (start, value) in ascending order; None before the first."""
    return next((value for start_m, value in reversed(changes) if start_m <= s_m), None)


class RoadEnd(NamedTuple):
    """One end of a road."""

    road: str
    contact: Contact


@dataclass(frozen=True, slots=True, eq=False)
class Link:
    """What a road leads to: ``end`` of another road, or a ``junction``."""

    end: RoadEnd | None = None
    junction: str = ""


class Shape(NamedTuple):
    """Heights above the banked plane, from ``s_m`` on: a cubic of t; between two stations they are interpolated."""

    s_m: float
    heights: Cubics


@dataclass(frozen=True, slots=True, eq=False)
class Road:
    """A road.

    Attributes:
        id: Its number.
        junction: Of which it is a connecting road, or "".
        length_m: Of its reference line.
        left_hand: Traffic keeps to the left.
        plan: Reference line in plan.
        elevation: Height of the reference line.
        superelevation: Roll of the whole road about it, radians; positive lifts the left side.
        crossfall: Fall of the left and of the right side, radians; positive falls outward.
        shape: Heights above the banked plane.
        offset: Distance of the centre line from the reference line, to the left.
        left: Sections of its left side, in order.
        right: Sections of its right side.
        speeds: (s, m/s).
        predecessor: What its start touches.
        successor: What its end touches.
        bridges: (from, to).
        element: The XML that it was read from.
    """

    id: str
    junction: str
    length_m: float
    left_hand: bool
    plan: PlanView
    elevation: Cubics
    superelevation: Cubics
    crossfall: tuple[Cubics, Cubics]
    shape: tuple[Shape, ...]
    offset: Cubics
    left: tuple[Section, ...]
    right: tuple[Section, ...]
    speeds: tuple[tuple[float, float], ...]
    predecessor: Link
    successor: Link
    bridges: tuple[tuple[float, float], ...]
    element: Element

    def link(self, contact: Contact) -> Link:
        """What one of its ends touches."""
        return self.predecessor if contact == "start" else self.successor

    @property
    def sections(self) -> tuple[Section, ...]:
        """All of them, left ones first."""
        return (*self.left, *self.right)

    def drives_forward(self, lane: LaneRecord) -> bool:
        """Whether traffic on a lane runs as s does."""
        return ((lane.id < 0) != self.left_hand) != lane.reversed


@dataclass(frozen=True, slots=True, eq=False)
class Connection:
    """A way through a junction: lanes of an incoming road → lanes of the road that connects or follows.

    Attributes:
        incoming: Id of the road that leads to the junction.
        end: Where the connecting road is entered.
        lanes: Pairs of lane ids; None: lanes with the same id.
    """

    incoming: str
    end: RoadEnd
    lanes: tuple[tuple[int, int], ...] | None


@dataclass(frozen=True, slots=True, eq=False)
class Document:
    """A file.

    Attributes:
        path: Where it was read from.
        root: Its XML.
        roads: By id, those that could be read.
        connections: Of all junctions.
    """

    path: Path
    root: Element
    roads: Mapping[str, Road]
    connections: tuple[Connection, ...]

    def lanes(self) -> Iterator[tuple[Road, Section, LaneRecord]]:
        """All lanes, in order."""
        return ((road, sec, lane) for road in self.roads.values() for sec in road.sections for lane in sec.lanes)
