"""Geometry of a hazard area, in coordinates along and across the lanes that it closes."""

from collections.abc import Sequence
from functools import cached_property

import numpy as np
import shapely

from simbev_ros.foundation.geometry.plan_view import left_of
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.network import Lane
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.polylines import Polylines
from simbev_ros.schema.scene.hazard import BlockedStretch

_SPACING_M = 1.0
_MARGIN_M = 0.3  # gap between the area and adjacent open lanes, if the closed lanes are driving lanes
_SIMPLIFY_M = 0.02
_GUARD_HALF_WIDTH_M = 0.25  # half the width of a cone or barrier
_OVERHANG_M = 0.1  # by which guards may overhang the marking of the open lanes


class HazardArea:
    """Ground of a hazard area: a taper from its tip, the body at full width, and a taper that opens the lanes again.

    Attributes:
        closed: The closed lanes, outermost first.
        side: 1 if the open lanes are on the left, -1 if on the right.
        from_s_m: Start of the area on the first of the lanes.
        body_m: Start and end of the body, measured from the tip.
        length_m: Length from the tip to the end.
        width_m: Width of the body, from the outer border of the first lane.
        usable_width_m: Width of the body up to the guards.
    """

    def __init__(
        self, closed: Sequence[Lane], side: int, from_s_m: float, taper_m: float, body_m: float, end_taper_m: float
    ) -> None:
        self.closed = tuple(closed)
        self.side = side
        self.from_s_m = from_s_m
        self.body_m = taper_m, taper_m + body_m
        self.length_m = taper_m + body_m + end_taper_m
        margin_m = _MARGIN_M if closed[0].kind is LaneKind.DRIVING else 0.0
        self.width_m = sum(lane.width_m for lane in closed) - margin_m
        self._inset_m = max(_GUARD_HALF_WIDTH_M - margin_m - _OVERHANG_M, 0.0)
        self.usable_width_m = self.width_m - self._inset_m - _GUARD_HALF_WIDTH_M
        self._line = Polylines.from_lines([self.closed[0].centerline_m])

    def positions(self, along_m: Float64Array, across_m: Float64Array) -> tuple[Float64Array, Float64Array]:
        """(N, 3) positions and (N,) lane headings at distances from the tip and from the outer border."""
        parameter = self._line.parameter(np.zeros(len(along_m), np.int64), self.from_s_m + along_m)
        position_m, heading = self._line.values(parameter), self._line.headings(parameter)
        left_m = self.side * (across_m - self.closed[0].width_m / 2.0)
        position_m[:, :2] += left_m[:, None] * left_of(heading)
        return position_m, np.arctan2(heading[:, 1], heading[:, 0])

    def width_at_m(self, along_m: Float64Array) -> Float64Array:
        """(N,) width of the area, measured from the outer border inwards."""
        start_m, end_m = self.body_m
        return np.interp(along_m, [0.0, start_m, end_m, self.length_m], [0.0, self.width_m, self.width_m, 0.0])

    def guard_positions(self, along_m: Float64Array) -> tuple[Float64Array, Float64Array]:
        """``positions`` of cones or barriers: on the border to the open lanes, or near the outer one in the tapers."""
        return self.positions(along_m, (self.width_at_m(along_m) - self._inset_m).clip(_GUARD_HALF_WIDTH_M))

    @cached_property
    def outline_m(self) -> Float64Array:
        """(N, 2) corners, counterclockwise."""
        along_m = np.unique(np.append(np.arange(0.0, self.length_m, _SPACING_M), [*self.body_m, self.length_m]))
        outer_m, _ = self.positions(along_m, np.zeros(len(along_m)))
        inner_m, _ = self.positions(along_m, self.width_at_m(along_m))
        ring = shapely.Polygon(np.concatenate([outer_m, inner_m[-2:0:-1]])[:, :2]).simplify(_SIMPLIFY_M)
        if not ring.is_valid:  # in tight bends the inner side intersects itself
            parts = shapely.get_parts(shapely.get_parts(shapely.make_valid(ring)))
            ring = shapely.Polygon(shapely.get_exterior_ring(parts[np.argmax(shapely.area(parts))]))
        return shapely.get_coordinates(shapely.orient_polygons(ring))[:-1]

    def blocked_stretches(self) -> tuple[BlockedStretch, ...]:
        """The stretches of driving lanes that the area covers."""
        ends_m, _ = self.positions(np.array([0.0, self.length_m]), np.zeros(2))
        stretches = []
        for lane in self.closed:
            if lane.kind is not LaneKind.DRIVING:
                continue
            line = shapely.LineString(lane.centerline_m[:, :2])
            from_s_m, to_s_m = (float(line.project(shapely.Point(end_m[:2]))) for end_m in ends_m)
            stretches.append(BlockedStretch(lane=lane.id, from_s_m=from_s_m, to_s_m=to_s_m))
        return tuple(stretches)
