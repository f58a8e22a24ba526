"""Samples the exact 3D shape of every lane of an OpenDRIVE document, section by section."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.findings import Findings
from simbev_ros.maps.opendrive.borders import borders_m
from simbev_ros.maps.opendrive.reading.document import Document, LaneKey, LaneRecord, Road, Section, value_at
from simbev_ros.maps.opendrive.reading.tables import DEFAULT_SPEEDS_MPS
from simbev_ros.maps.opendrive.stations import stations_m
from simbev_ros.maps.roads.lane_kind import LaneKind, raised_of

_MAX_COORDINATES_M = (100e3, 100e3, 10e3)
_MAX_WIDTH_M = 200.0
_SAME_HEIGHT_M = 5e-4
_FOOTWAYS = (LaneKind.SIDEWALK, LaneKind.MEDIAN)


@dataclass(frozen=True, slots=True, eq=False)
class LaneShape:
    """Sampled shape of a lane within one section, from the section's start to its end, including parts of zero width.

    Attributes:
        key: Identifies the lane.
        road: Its road.
        section: Its section.
        lane: Its record.
        s_m: (N,) stations, the same for all lanes of a section, at least two.
        inner_m: (N, 3) border towards the center line, map frame, in direction of s.
        outer_m: (N, 3) the other border.
        width_m: (N,) width, measured in the road's surface.
        raised_m: (N, 2) heights of both borders above the road's surface, inner one first; None: that of its kind.
    """

    key: LaneKey
    road: Road
    section: Section
    lane: LaneRecord
    s_m: Float64Array
    inner_m: Float64Array
    outer_m: Float64Array
    width_m: Float64Array
    raised_m: Float64Array | None = None

    @property
    def runs_forward(self) -> bool:
        """Whether its strips run in the direction of s: the driving direction; true for lanes without vehicles."""
        return self.lane.kind in _FOOTWAYS or self.road.drives_forward(self.lane)

    def speed_mps(self, s_m: float) -> float:
        """Speed limit at a distance along the road: the lane's own, else the road's."""
        own_mps = value_at(self.lane.speeds, s_m - self.section.start_m)
        return own_mps or value_at(self.road.speeds, s_m) or DEFAULT_SPEEDS_MPS["default"]


def lane_shapes(document: Document, notes: Findings) -> Iterator[LaneShape]:
    """Yield the shapes of all used lanes: by road, left side first, by section, from the center line outward.

    Roads beyond the coordinate bounds are left out, with a note.
    """
    for road in document.roads.values():
        shapes = list(_road_shapes(road))
        if all(_is_plausible(shape) for shape in shapes):
            yield from shapes
        else:
            notes.left_out("a road that is out of bounds or far too wide is left out", road.element, f"road {road.id}")


def _is_plausible(shape: LaneShape) -> bool:
    """Whether a lane has plausible coordinates and widths."""
    points_m = np.concatenate([shape.inner_m, shape.outer_m])
    return bool(np.all(np.abs(points_m) < _MAX_COORDINATES_M) and np.all(shape.width_m < _MAX_WIDTH_M))


def _road_shapes(road: Road) -> Iterator[LaneShape]:
    road_s_m = stations_m(road)
    for left, sections in ((True, road.left), (False, road.right)):
        for section in sections:
            s_m = road_s_m[(road_s_m >= section.start_m) & (road_s_m <= section.end_m)]
            if section.lanes and len(s_m) > 1:
                yield from _section_shapes(road, section, left, s_m)


def _section_shapes(road: Road, section: Section, left: bool, s_m: Float64Array) -> Iterator[LaneShape]:
    lines_m, edges_m = borders_m(road, section, left, s_m)
    for position, lane in enumerate(section.lanes):
        if lane.kind is not None:
            key = LaneKey(road.id, section.index, lane.id)
            width_m = edges_m[position + 1] - edges_m[position]
            shape = LaneShape(key, road, section, lane, s_m, lines_m[position], lines_m[position + 1], width_m)
            yield replace(shape, raised_m=_raised_m(shape))


def _raised_m(shape: LaneShape) -> Float64Array | None:
    """Heights of a lane's borders as the file states them, unless they are those of its kind anyway."""
    lane = shape.lane
    if lane.kind is None or lane.height is None:
        return None
    raised_m = lane.height(shape.s_m - shape.section.start_m)
    return None if np.abs(raised_m - raised_of(lane.kind)).max() < _SAME_HEIGHT_M else raised_m
