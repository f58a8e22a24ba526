"""The driving strips of a layout with a spatial index, for queries of the lane at a position."""

from functools import cached_property

from simbev_ros.maps.roads.lane_index import LineIndex
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.layout import Layout, Strip
from simbev_ros.maps.roads.polylines import Polylines


class LaneStrips:
    """Driving strips in the layout's order, and all strips by lane."""

    def __init__(self, layout: Layout) -> None:
        self.strips = layout.strips_of(LaneKind.DRIVING)
        self.by_lane: dict[str, Strip] = {strip.lane: strip for strip in layout.strips}
        """One strip of each lane; strips of a lane differ only in position and level."""

    @cached_property
    def index(self) -> LineIndex:
        """Index of the center lines of ``strips``."""
        return LineIndex(Polylines.from_lines([strip.center_m for strip in self.strips]))
