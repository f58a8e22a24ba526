"""The ground that a hazard area covers, in coordinates along and across the lanes that it closes."""

from collections.abc import Sequence
from functools import cached_property

import numpy as np
import shapely

from simbev_ros.maps.network import Lane
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.polylines import Polylines
from simbev_ros.scene.hazards.hazard import BlockedStretch
from simbev_ros.types import Float64Array

_SPACING_M = 1.0
_MARGIN_M = 0.3  # between the area and lanes that stay open beside it, if people drive on what is closed
_STRAIGHT_M = 0.02
_GUARD_M = 0.25  # half the width of a cone or barrier
_INTO_OPEN_M = 0.1  # so far guards may stand over the marking of open lanes


class HazardArea:
    """From its tip, where the taper begins, over its body, as wide as what is closed, to where the lanes open again.

    Attributes:
        closed: The lanes, the outermost first.
        side: 1 if the open lanes are on the left, -1 if on the right.
        from_s_m: Where it begins on the first of the lanes.
        body_m: Where the body begins and ends, measured from the tip.
        length_m: From the tip to its end.
        width_m: Of the body, from the outer border of the first lane.
        free_m: Of that, up to the guards.
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
        self._inset_m = max(_GUARD_M - margin_m - _INTO_OPEN_M, 0.0)
        self.free_m = self.width_m - self._inset_m - _GUARD_M
        self._line = Polylines.of([self.closed[0].centerline_m])

    def places(self, along_m: Float64Array, across_m: Float64Array) -> tuple[Float64Array, Float64Array]:
        """(N, 3) places and (N,) directions of the lanes, at distances behind the tip and from the outer border."""
        parameter = self._line.parameter(np.zeros(len(along_m), np.int64), self.from_s_m + along_m)
        position_m, heading = self._line.values(parameter), self._line.headings(parameter)
        left_m = self.side * (across_m - self.closed[0].width_m / 2.0)
        position_m[:, :2] += left_m[:, None] * np.column_stack([-heading[:, 1], heading[:, 0]])
        return position_m, np.arctan2(heading[:, 1], heading[:, 0])

    def reach_m(self, along_m: Float64Array) -> Float64Array:
        """(N,) how far it reaches from the outer border inwards."""
        begin_m, end_m = self.body_m
        reach_m: Float64Array = np.interp(
            along_m, [0.0, begin_m, end_m, self.length_m], [0.0, self.width_m, self.width_m, 0.0]
        )
        return reach_m

    def guards(self, along_m: Float64Array) -> tuple[Float64Array, Float64Array]:
        """``places`` for cones or barriers: on the border to the open lanes, or the outer one."""
        return self.places(along_m, (self.reach_m(along_m) - self._inset_m).clip(_GUARD_M))

    @cached_property
    def outline_m(self) -> Float64Array:
        """(N, 2) its corners, counterclockwise."""
        along_m = np.unique(np.append(np.arange(0.0, self.length_m, _SPACING_M), [*self.body_m, self.length_m]))
        outer_m, _ = self.places(along_m, np.zeros(len(along_m)))
        inner_m, _ = self.places(along_m, self.reach_m(along_m))
        ring = shapely.Polygon(np.concatenate([outer_m, inner_m[-2:0:-1]])[:, :2]).simplify(_STRAIGHT_M)
        if not ring.is_valid:  # in tight bends the inner side crosses itself
            parts = shapely.get_parts(shapely.get_parts(shapely.make_valid(ring)))
            ring = shapely.Polygon(shapely.get_exterior_ring(parts[np.argmax(shapely.area(parts))]))
        return shapely.get_coordinates(shapely.orient_polygons(ring))[:-1]

    def blocked(self) -> tuple[BlockedStretch, ...]:
        """The stretches of driving lanes that it covers."""
        ends_m, _ = self.places(np.array([0.0, self.length_m]), np.zeros(2))
        stretches = []
        for lane in self.closed:
            if lane.kind is not LaneKind.DRIVING:
                continue
            line = shapely.LineString(lane.centerline_m[:, :2])
            from_s_m, to_s_m = (float(line.project(shapely.Point(end_m[:2]))) for end_m in ends_m)
            stretches.append(BlockedStretch(lane=lane.id, from_s_m=from_s_m, to_s_m=to_s_m))
        return tuple(stretches)
