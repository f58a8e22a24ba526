"""The exact shape of every lane, section by section."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from simbev_ros.maps.opendrive.borders import borders_m
from simbev_ros.maps.opendrive.reading.attributes import Notes
from simbev_ros.maps.opendrive.reading.document import Document, LaneKey, LaneRecord, Road, Section, value_at
from simbev_ros.maps.opendrive.reading.tables import DEFAULT_SPEEDS_MPS
from simbev_ros.maps.opendrive.stations import stations_m
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.types import Float64Array

_BOUNDS_M = (100e3, 100e3, 10e3)
_WIDEST_M = 200.0
_FOOTWAYS = (LaneKind.SIDEWALK, LaneKind.MEDIAN)


@dataclass(frozen=True, slots=True, eq=False)
class LaneShape:
    """A lane within one section, from the section's start to its end, also where it has no width.

    Attributes:
        key: Which lane.
        road: Its road.
        section: Its section.
        lane: Its record.
        s_m: (N,) stations, the same for all lanes of a section, at least two.
        inner_m: (N, 3) border towards the centre line, map frame, as s runs.
        outer_m: (N, 3) the other border.
        width_m: (N,) width, measured in the road's surface.
    """

    key: LaneKey
    road: Road
    section: Section
    lane: LaneRecord
    s_m: Float64Array
    inner_m: Float64Array
    outer_m: Float64Array
    width_m: Float64Array

    @property
    def runs_forward(self) -> bool:
        """Whether its strips run as s does: driving direction, or as the road runs where nobody drives."""
        return self.lane.kind in _FOOTWAYS or self.road.drives_forward(self.lane)

    def speed_mps(self, s_m: float) -> float:
        """Speed limit at a distance along the road: the lane's own, else the road's."""
        own_mps = value_at(self.lane.speeds, s_m - self.section.start_m)
        return own_mps or value_at(self.road.speeds, s_m) or DEFAULT_SPEEDS_MPS["default"]


def lane_shapes(document: Document, notes: Notes) -> Iterator[LaneShape]:
    """Shapes of the lanes that are in use: by road, left side first, by section, from the centre line outward.

    Roads that lie out of all bounds are left out, with a note.
    """
    for road in document.roads.values():
        shapes = list(_of_road(road))
        if all(_is_sane(shape) for shape in shapes):
            yield from shapes
        else:
            notes.add("a road that is out of bounds or far too wide is left out", road.element, f"road {road.id}")


def _is_sane(shape: LaneShape) -> bool:
    """Whether a lane is where roads can be."""
    points_m = np.concatenate([shape.inner_m, shape.outer_m])
    return bool(np.all(np.abs(points_m) < _BOUNDS_M) and np.all(shape.width_m < _WIDEST_M))


def _of_road(road: Road) -> Iterator[LaneShape]:
    road_s_m = stations_m(road)
    for left, sections in ((True, road.left), (False, road.right)):
        for section in sections:
            s_m = road_s_m[(road_s_m >= section.start_m) & (road_s_m <= section.end_m)]
            if section.lanes and len(s_m) > 1:
                yield from _of_section(road, section, left, s_m)


def _of_section(road: Road, section: Section, left: bool, s_m: Float64Array) -> Iterator[LaneShape]:
    lines_m, edges_m = borders_m(road, section, left, s_m)
    for place, lane in enumerate(section.lanes):
        if lane.kind is not None:
            key = LaneKey(road.id, section.index, lane.id)
            width_m = edges_m[place + 1] - edges_m[place]
            yield LaneShape(key, road, section, lane, s_m, lines_m[place], lines_m[place + 1], width_m)
