"""Dataclasses for the content of an OpenDRIVE file. Distances ``s_m`` run along a road's reference line from its start.

Lane ids: 0 is the center line, ids on its left are positive, those on its right negative; absolute values grow outward.
"""

from bisect import bisect_right
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, NamedTuple, TypeVar
from xml.etree.ElementTree import Element

import numpy as np

from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.lane_graph.lane_key import LaneKey as LaneKey
from simbev_ros.maps.opendrive.reading.cubics import Cubics
from simbev_ros.maps.opendrive.reading.plan_view import PlanView
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.layout import Line

_T = TypeVar("_T")
Contact = Literal["start", "end"]
"""An end of a road, a section or a lane, in the direction of s."""


@dataclass(frozen=True, slots=True, eq=False)
class LaneHeight:
    """Heights of a lane's borders above the road's surface, linear between (K,) ascending distances."""

    starts_m: Float64Array
    inner_m: Float64Array
    outer_m: Float64Array

    def __call__(self, ds_m: Float64Array) -> Float64Array:
        """(N, 2) heights of the inner and the outer border at (N,) distances from the section's start."""
        return np.column_stack([np.interp(ds_m, self.starts_m, side_m) for side_m in (self.inner_m, self.outer_m)])


@dataclass(frozen=True, slots=True, eq=False)
class LaneRecord:
    """A lane within one section; distances in its records are measured from the section's start.

    Attributes:
        id: Its lane id, never 0.
        type: Its type, as the file names it.
        kind: Its use; None: not part of the layout.
        on_level: Kept horizontal across where the road is banked.
        width: Width by distance from the section's start, unless there is only a ``border``.
        border: Distance of its outer border from the center line, likewise.
        height: Heights of its inner and outer border above the road's surface, or None if the file states none.
        speeds: Its own speed limits as (distance, m/s).
        predecessors: Lane ids linked at its start.
        successors: Lane ids linked at its end.
        reversed: Traffic runs against the direction that its side implies.
    """

    id: int
    type: str
    kind: LaneKind | None
    on_level: bool
    width: Cubics
    border: Cubics
    height: "LaneHeight | None"
    speeds: tuple[tuple[float, float], ...]
    predecessors: tuple[int, ...]
    successors: tuple[int, ...]
    reversed: bool

    @property
    def records(self) -> tuple["Cubics | LaneHeight", ...]:
        """The records that shape it, by distance from the section's start."""
        return (self.width, self.border, *(() if self.height is None else (self.height,)))


@dataclass(frozen=True, slots=True, eq=False)
class Section:
    """One side of a stretch of road with constant lanes.

    Attributes:
        index: Index of the lane section in the file.
        start_m: Distance along the road at which it starts.
        end_m: Distance along the road at which it ends.
        lanes: From the center line outward: 1, 2, ... or -1, -2, ...
        marks: Lane id (0 for the center line) → (distance from the section's start, paint of its outer border); paint
            of the center line from left to right.
    """

    index: int
    start_m: float
    end_m: float
    lanes: tuple[LaneRecord, ...]
    marks: Mapping[int, tuple[tuple[float, Line], ...]]


def on_stretch(stretches: Sequence[tuple[float, float]], s_m: float) -> bool:
    """Whether a distance along a road lies on one of its disjoint, ascending stretches (start, end)."""
    index = bisect_right(stretches, s_m, key=lambda stretch: stretch[0])
    return index > 0 and s_m < stretches[index - 1][1]


def stretches_near(
    stretches: Sequence[tuple[float, float]], start_m: float, end_m: float
) -> Sequence[tuple[float, float]]:
    """The disjoint, ascending stretches (start, end) of a road that reach into a part of it, and at most one before."""
    first = bisect_right(stretches, start_m, key=lambda stretch: stretch[0])
    last = bisect_right(stretches, end_m, key=lambda stretch: stretch[0])
    return stretches[max(first - 1, 0) : last]


def value_at(changes: Sequence[tuple[float, _T]], s_m: float) -> _T | None:
    """The value that applies at a distance, from (start, value) in ascending order; None before the first start."""
    return next((value for start_m, value in reversed(changes) if start_m <= s_m), None)


class RoadEnd(NamedTuple):
    """One end of a road."""

    road: str
    contact: Contact


@dataclass(frozen=True, slots=True, eq=False)
class Link:
    """The target that a road's end is linked to: an ``end`` of another road, or a ``junction``."""

    end: RoadEnd | None = None
    junction: str = ""


class Shape(NamedTuple):
    """Heights above the banked plane at ``s_m``: a cubic in t; interpolated linearly between two stations."""

    s_m: float
    heights: Cubics


@dataclass(frozen=True, slots=True, eq=False)
class Road:
    """A road of an OpenDRIVE file.

    Attributes:
        id: Its id.
        junction: Id of the junction for connecting roads, else "".
        length_m: Length of its reference line.
        left_hand: Traffic keeps to the left.
        plan: Reference line in plan view.
        elevation: Height of the reference line.
        superelevation: Roll of the whole road about it, radians; positive lifts the left side.
        crossfall: Fall of the left and of the right side, radians; positive falls outward.
        shape: Heights above the banked plane.
        offset: Distance of the center line from the reference line, to the left.
        left: Sections of its left side, in order.
        right: Sections of its right side, in order.
        speeds: Speed limits as (s, m/s).
        predecessor: Link of its start.
        successor: Link of its end.
        bridges: Stretches on bridges as (start s, end s), disjoint and ascending.
        tunnels: Stretches in tunnels, likewise.
        element: The XML element that it was read from.
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
    tunnels: tuple[tuple[float, float], ...]
    element: Element

    def link(self, contact: Contact) -> Link:
        """The link of one of its ends."""
        return self.predecessor if contact == "start" else self.successor

    @property
    def sections(self) -> tuple[Section, ...]:
        """The sections of both sides, left ones first."""
        return (*self.left, *self.right)

    def drives_forward(self, lane: LaneRecord) -> bool:
        """Whether traffic on a lane runs in the direction of s."""
        return ((lane.id < 0) != self.left_hand) != lane.reversed


@dataclass(frozen=True, slots=True, eq=False)
class Connection:
    """A connection through a junction: lanes of an incoming road → lanes of the connecting or following road.

    Attributes:
        incoming: Id of the road that leads to the junction.
        end: End at which the connecting road is entered.
        lanes: Pairs of lane ids; None: lanes with the same id.
    """

    incoming: str
    end: RoadEnd
    lanes: tuple[tuple[int, int], ...] | None


@dataclass(frozen=True, slots=True, eq=False)
class Document:
    """The content of an OpenDRIVE file.

    Attributes:
        path: The file.
        root: Its XML root.
        roads: Readable roads by id.
        connections: Connections of all junctions.
    """

    path: Path
    root: Element
    roads: Mapping[str, Road]
    connections: tuple[Connection, ...]

    def lanes(self) -> Iterator[tuple[Road, Section, LaneRecord]]:
        """All lanes with their road and section, in order."""
        return ((road, sec, lane) for road in self.roads.values() for sec in road.sections for lane in sec.lanes)
