"""Finds the nearest of many lines for many points at once, taking height and direction into account."""

from dataclasses import dataclass

import numpy as np
import shapely

from simbev_ros.foundation.types import Float64Array, Int64Array
from simbev_ros.maps.roads.polylines import Polylines

_EXTRA_DISTANCE_M = 12.0  # candidate lines are at most this much more distant in plan view than the nearest one
_HEIGHT_WEIGHT = 2.0  # plan-view meters per meter of height
_TURN_WEIGHT_M = 4.0  # plan-view meters per right angle between line and heading
_POINTS_PER_BATCH = 1 << 16


@dataclass(frozen=True, slots=True)
class NearestPoints:
    """For each of N query points the nearest point on a line.

    Attributes:
        row: (N,) index of the line.
        s_m: (N,) distance from the line's start.
        parameter: (N,) the same position as a parameter of ``Polylines.values``.
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

    def nearest(self, points_m: Float64Array, yaw_rad: Float64Array | None = None) -> NearestPoints:
        """Find the nearest points on lines; of equally near lines, the first is chosen.

        Args:
            points_m: (N, 2) or (N, 3) float64, map frame. If a height is given, a line's distance is that in plan view
                plus twice the difference in height.
            yaw_rad: (N,) directions of travel: adds 4 m to the distance of a perpendicular line, 8 m to that of an
                opposite one.
        """
        points_m = np.asarray(points_m, np.float64)
        parts = [
            self._nearest(
                points_m[start : start + _POINTS_PER_BATCH],
                None if yaw_rad is None else yaw_rad[start : start + _POINTS_PER_BATCH],
            )
            for start in range(0, max(len(points_m), 1), _POINTS_PER_BATCH)
        ]
        row, s_m = (np.concatenate(column) for column in zip(*parts, strict=True))
        return NearestPoints(row, s_m, self.lines.parameter(row, s_m))

    def _nearest(self, points_m: Float64Array, yaw_rad: Float64Array | None) -> tuple[Int64Array, Float64Array]:
        points = np.asarray(shapely.points(points_m[:, :2]), object)
        point, row = self._tree.query_nearest(points, all_matches=True)
        if points_m.shape[1] == 3 or yaw_rad is not None:
            nearest_m = np.zeros(len(points))
            nearest_m[point] = shapely.distance(points[point], self._shapes[row])
            point, row = self._tree.query(points, predicate="dwithin", distance=nearest_m + _EXTRA_DISTANCE_M)
        s_m = shapely.line_locate_point(self._shapes[row], points[point])
        cost_m = shapely.distance(points[point], self._shapes[row])
        parameter = self.lines.parameter(row, s_m)
        if points_m.shape[1] == 3:
            cost_m += _HEIGHT_WEIGHT * np.abs(self.lines.values(parameter)[:, 2] - points_m[point, 2])
        if yaw_rad is not None:
            travel = np.column_stack([np.cos(yaw_rad), np.sin(yaw_rad)])[point]
            cost_m += _TURN_WEIGHT_M * (1.0 - np.sum(self.lines.headings(parameter) * travel, axis=1))
        order = np.lexsort([row, np.round(cost_m, 9), point])
        best = order[np.searchsorted(point[order], np.arange(len(points)))]
        return np.asarray(row[best], np.int64), s_m[best]
