"""Which of many lines is nearest, level and direction considered, for many points at once."""

from dataclasses import dataclass

import numpy as np
import shapely

from simbev_ros.maps.roads.polylines import Polylines
from simbev_ros.types import Float64Array, Int64Array

_REACH_M = 12.0  # lines so much further than the nearest one in plan are looked at too
_HEIGHT_WEIGHT = 2.0  # meters in plan that a meter of height counts for
_TURN_WEIGHT_M = 4.0  # meters in plan that a right angle between line and heading counts for
_AT_ONCE = 1 << 16


@dataclass(frozen=True, slots=True)
class NearestPlaces:
    """For each of N points the nearest place on a line.

    Attributes:
        row: (N,) line.
        s_m: (N,) distance from the line's start.
        parameter: (N,) the same place, as ``Polylines.values`` takes it.
    """

    row: Int64Array
    s_m: Float64Array
    parameter: Float64Array


class LineIndex:
    """A search tree over at least one line, e.g. the center lines of lanes."""

    def __init__(self, lines: Polylines) -> None:
        self.lines = lines
        self._shapes = np.asarray(shapely.linestrings(lines.points_m[:, :2], indices=lines.row), object)
        self._tree = shapely.STRtree(self._shapes)

    def nearest(self, points_m: Float64Array, yaw_rad: Float64Array | None = None) -> NearestPlaces:
        """The nearest places on lines; of lines equally near, the first.

        Args:
            points_m: (N, 2) or (N, 3) float64, map frame. With a height, a line above or beneath is as far as twice
                the difference in height, besides the distance in plan.
            yaw_rad: (N,) directions of travel: a line across is 4 m further, one against it 8 m.
        """
        points_m = np.asarray(points_m, np.float64)
        parts = [
            self._nearest(points_m[at : at + _AT_ONCE], None if yaw_rad is None else yaw_rad[at : at + _AT_ONCE])
            for at in range(0, max(len(points_m), 1), _AT_ONCE)
        ]
        row, s_m = (np.concatenate(column) for column in zip(*parts, strict=True))
        return NearestPlaces(row, s_m, self.lines.parameter(row, s_m))

    def _nearest(self, points_m: Float64Array, yaw_rad: Float64Array | None) -> tuple[Int64Array, Float64Array]:
        points = np.asarray(shapely.points(points_m[:, :2]), object)
        point, row = self._tree.query_nearest(points, all_matches=True)
        if points_m.shape[1] == 3 or yaw_rad is not None:
            nearest_m = np.zeros(len(points))
            nearest_m[point] = shapely.distance(points[point], self._shapes[row])
            point, row = self._tree.query(points, predicate="dwithin", distance=nearest_m + _REACH_M)
        s_m = shapely.line_locate_point(self._shapes[row], points[point])
        cost_m = shapely.distance(points[point], self._shapes[row])
        place = self.lines.parameter(row, s_m)
        if points_m.shape[1] == 3:
            cost_m += _HEIGHT_WEIGHT * np.abs(self.lines.values(place)[:, 2] - points_m[point, 2])
        if yaw_rad is not None:
            travel = np.column_stack([np.cos(yaw_rad), np.sin(yaw_rad)])[point]
            cost_m += _TURN_WEIGHT_M * (1.0 - np.sum(self.lines.headings(place) * travel, axis=1))
        order = np.lexsort([row, np.round(cost_m, 9), point])
        best = order[np.searchsorted(point[order], np.arange(len(points)))]
        return np.asarray(row[best], np.int64), s_m[best]
