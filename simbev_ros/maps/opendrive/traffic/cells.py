"""Divides OpenDRIVE roads into cells: stretches on which the same lanes are wide enough for traffic."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from simbev_ros.foundation.types import BoolArray, Float64Array
from simbev_ros.maps.opendrive.lane_shapes import LaneShape
from simbev_ros.maps.opendrive.links import LaneLinks
from simbev_ros.maps.opendrive.reading.document import Contact, LaneKey, Road, Section
from simbev_ros.maps.opendrive.reading.tables import NO_TRAFFIC
from simbev_ros.maps.roads.lane_kind import LaneKind

_MIN_WIDTH_M = {LaneKind.DRIVING: 2.0, LaneKind.BICYCLE: 0.8, LaneKind.SIDEWALK: 0.8}
_MIN_LENGTH_M = 0.2
_MIN_WIDTH_FRACTION = (
    0.75  # of the lane's maximum width, so that lanes that are narrow throughout are used nevertheless
)


@dataclass(frozen=True, slots=True, eq=False)
class Cell:
    """A stretch of a section with the same usable lanes of one direction.

    Attributes:
        shapes: The lanes, outermost first; a sidewalk precedes all others.
        first: Index of its first sample, in the direction of s.
        last: Index of its last sample.
        forward: Traffic runs in the direction of s.
    """

    shapes: tuple[LaneShape, ...]
    first: int
    last: int
    forward: bool

    @property
    def entry(self) -> int:
        """Index of the sample at which traffic enters it."""
        return self.first if self.forward else self.last

    @property
    def exit(self) -> int:
        """Index of the sample at which traffic leaves it."""
        return self.last if self.forward else self.first

    @property
    def leaves_section(self) -> bool:
        """Whether it extends to the end of the section in driving direction."""
        return self.exit == (len(self.shapes[0].s_m) - 1 if self.forward else 0)

    @property
    def exit_contact(self) -> Contact:
        """The end of its lanes at which traffic leaves them."""
        return "end" if self.forward else "start"

    @property
    def middle_m(self) -> float:
        """Distance of its midpoint along the road."""
        s_m = self.shapes[0].s_m
        return float(s_m[self.first] + s_m[self.last]) / 2.0

    def along(self, line_m: Float64Array) -> Float64Array:
        """The part of (N, ...) values along its section that belongs to it, in driving direction."""
        part = line_m[self.first : self.last + 1]
        return part if self.forward else part[::-1]


def carries_traffic(shape: LaneShape) -> bool:
    """Whether simulated vehicles or pedestrians use a lane at all."""
    lane = shape.lane
    return lane.kind in _MIN_WIDTH_M and lane.type not in NO_TRAFFIC and not lane.reversed


def chains_of(road: Road, shapes: Mapping[LaneKey, LaneShape], links: LaneLinks) -> Iterator[tuple[Cell, ...]]:
    """Yield the chains of a road in driving order: consecutive cells of one direction with the same lanes."""
    for forward in (True, False):
        sections = road.right if forward != road.left_hand else road.left
        chain: list[Cell] = []
        for section in sections if forward else reversed(sections):
            for cell in _cells(road, section, shapes, forward):
                if chain and not _continues(chain[-1], cell, links):
                    yield tuple(chain)
                    chain = []
                chain.append(cell)
        if chain:
            yield tuple(chain)


def _cells(road: Road, section: Section, shapes: Mapping[LaneKey, LaneShape], forward: bool) -> Iterator[Cell]:
    """Yield the cells of one side of a section in driving order."""
    keys = [LaneKey(road.id, section.index, lane.id) for lane in reversed(section.lanes)]
    lanes = [shapes[key] for key in keys if key in shapes and carries_traffic(shapes[key])]
    lanes.sort(key=lambda shape: shape.lane.kind is not LaneKind.SIDEWALK)
    if not lanes:
        return
    usable = np.array([_usable(shape) for shape in lanes])
    changes = np.flatnonzero(np.any(usable[:, 1:] != usable[:, :-1], axis=0)) + 1
    bounds = list(pairwise([0, *changes.tolist(), usable.shape[1]]))
    for first, last in bounds if forward else reversed(bounds):
        usable_shapes = tuple(shape for shape, use in zip(lanes, usable[:, first], strict=True) if use)
        if usable_shapes and usable_shapes[0].s_m[last] - usable_shapes[0].s_m[first] >= _MIN_LENGTH_M:
            yield Cell(usable_shapes, first, last, forward)


def _usable(shape: LaneShape) -> BoolArray:
    """(N - 1,) whether a lane is wide enough between consecutive samples."""
    assert shape.lane.kind is not None
    enough_m = min(_MIN_WIDTH_M[shape.lane.kind], _MIN_WIDTH_FRACTION * float(shape.width_m.max()))
    wide = shape.width_m >= max(enough_m, 0.1)
    return wide[:-1] & wide[1:]


def _continues(before: Cell, after: Cell, links: LaneLinks) -> bool:
    """Whether two consecutive cells can be one edge: the same lanes with the same use and speed limit."""
    return len(before.shapes) == len(after.shapes) and all(
        a.lane.type == b.lane.type
        and a.speed_mps(before.middle_m) == b.speed_mps(after.middle_m)
        and _leads_to(before, a, b, links)
        for a, b in zip(before.shapes, after.shapes, strict=True)
    )


def _leads_to(cell: Cell, shape: LaneShape, following: LaneShape, links: LaneLinks) -> bool:
    """Whether a lane of a cell continues as another lane of the same road."""
    if not cell.leaves_section:
        return shape.key == following.key
    return any(key == following.key for key, _ in links.touching(shape.key, cell.exit_contact))
