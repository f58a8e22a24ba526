"""Conversion of SUMO's lane positions to map positions that keep a vehicle abreast of itself when it changes lanes.

SUMO gives all lanes of an edge the same length, whatever their shapes, and takes equal positions on them for abreast.
Where lanes bend along an edge, equal positions lie meters apart, so that a vehicle that changes lanes would jump. Here
a position counts along the edge's middle lane, and the other lanes run abreast of it.
"""

from collections import defaultdict
from collections.abc import Sequence

import numpy as np
import shapely

from simbev_ros.foundation.types import Float64Array, Int64Array
from simbev_ros.maps.network import Lane
from simbev_ros.maps.roads.polylines import Polylines

_SPACING_M = 1.0
_MAX_STRETCH = 0.3  # maximum relative deviation of a vehicle's speed from SUMO's


class LaneTracks:
    """Sampled lanes: sample k of one lane lies abreast of sample k of the edge's other lanes."""

    def __init__(self, lanes: Sequence[Lane]) -> None:
        """Sample lanes; must include all lanes of an edge that vehicles may change between."""
        self._row = {lane.id: row for row, lane in enumerate(lanes)}
        lines = Polylines.from_lines([lane.centerline_m for lane in lanes])
        self._sumo_length_m = lines.length_m * np.array([lane.sumo_s_per_m for lane in lanes])
        middle = _middle_lanes(lanes)
        self._last = np.maximum(np.ceil(lines.length_m[middle] / _SPACING_M), 1.0).astype(np.int64)
        row = np.repeat(np.arange(len(lanes)), self._last + 1)
        first = np.concatenate([[0], np.cumsum(self._last + 1)])
        fraction = (np.arange(len(row)) - first[row]) / self._last[row]
        self._station_m = _limit_stretch(lines, row, fraction, _abreast_stations(lines, row, middle[row], fraction))
        self._lines = Polylines(lines.values(lines.parameter(row, self._station_m)), first)
        left = self._lines.offset_to_left(np.ones(len(row)))[:, :2] - self._lines.points_m[:, :2]
        self._point_and_left = np.concatenate([self._lines.points_m, left], axis=1)

    def sumo_position_m(self, lane: str, s_m: float) -> float:
        """SUMO's lane position of a point at a distance along a lane's center line."""
        row = self._row[lane]
        stations_m = self._station_m[self._lines.first[row] : self._lines.first[row + 1]]
        number = float(np.interp(s_m, stations_m, np.arange(len(stations_m))))
        return number / float(self._last[row]) * float(self._sumo_length_m[row])

    def __contains__(self, lane: str) -> bool:
        return lane in self._row

    def rows(self, lanes: Sequence[str]) -> Int64Array:
        """(N,) row indices of lanes.

        Raises:
            KeyError: A lane is not among those given.
        """
        return np.array([self._row[lane] for lane in lanes], np.int64)

    def sumo_length_m(self, row: Int64Array) -> Float64Array:
        """(N,) SUMO's lengths of (N,) lanes."""
        return self._sumo_length_m[row]

    def positions_m(self, lanes: Sequence[str], position_m: Float64Array, left_m: Float64Array) -> Float64Array:
        """(N, 3) map positions of SUMO's (N,) positions on N lanes, (N,) distances to the left of their center lines.

        Raises:
            KeyError: A lane is not among those given.
        """
        return self.positions_on_rows_m(self.rows(lanes), position_m, left_m)

    def positions_on_rows_m(self, row: Int64Array, position_m: Float64Array, left_m: Float64Array) -> Float64Array:
        """(N, 3) map positions as in ``positions_m``, for lanes given by (N,) row indices."""
        fraction = np.clip(position_m / np.maximum(self._sumo_length_m[row], 1e-9), 0.0, 1.0)
        parameter = self._lines.first[row] + fraction * self._last[row]
        values = self._lines.values(parameter, self._point_and_left)
        values[:, :2] += left_m[:, None] * values[:, 3:]
        return values[:, :3]


def _middle_lanes(lanes: Sequence[Lane]) -> Int64Array:
    """(L,) row of the middle lane of each lane's edge."""
    edges: dict[str, list[int]] = defaultdict(list)
    for row, lane in enumerate(lanes):
        edges[lane.edge].append(row)
    middle = {edge: sorted(rows, key=lambda row: lanes[row].index)[len(rows) // 2] for edge, rows in edges.items()}
    return np.array([middle[lane.edge] for lane in lanes], np.int64)


def _abreast_stations(lines: Polylines, row: Int64Array, middle: Int64Array, fraction: Float64Array) -> Float64Array:
    """(N,) distances along lanes abreast of (N,) fractions of the length of their edges' middle lanes."""
    uniform_m = fraction * lines.length_m[row]
    others = np.flatnonzero(row != middle)
    middle_lane_m = lines.values(lines.parameter(middle[others], fraction[others] * lines.length_m[middle[others]]))
    shapes = np.array([shapely.LineString(line_m[:, :2]) for line_m in lines.split(lines.points_m)], object)
    station_m = uniform_m.copy()
    located_m = shapely.line_locate_point(shapes[row[others]], shapely.points(middle_lane_m[:, :2]))
    station_m[others] = located_m
    ends = (fraction == 0.0) | (fraction == 1.0)
    station_m[ends] = uniform_m[ends]
    # A running maximum keeps distances monotonic; the offset between lanes keeps each one's maximum out of the next.
    lane_offset_m = row * (1.0 + lines.length_m.max(initial=0.0))
    return np.minimum(np.maximum.accumulate(station_m + lane_offset_m) - lane_offset_m, lines.length_m[row])


def _limit_stretch(lines: Polylines, row: Int64Array, fraction: Float64Array, abreast_m: Float64Array) -> Float64Array:
    """(N,) distances along lanes, as close to those abreast as a stretch by ``_MAX_STRETCH`` allows.

    Without this limit, a vehicle would stand still on one lane while the neighboring lane turns around it, and race
    where the neighboring lane comes back.
    """
    uniform_m = fraction * lines.length_m[row]
    along_m, abreast_step_m = np.diff(uniform_m), np.diff(abreast_m)
    inside = np.diff(row) == 0
    stretch = np.abs(abreast_step_m[inside] / np.maximum(along_m[inside], 1e-9) - 1.0)
    max_stretch = np.zeros(len(lines.length_m))
    np.maximum.at(max_stretch, row[:-1][inside], stretch)
    weight = np.minimum(1.0, _MAX_STRETCH / np.maximum(max_stretch, 1e-9))[row]
    return uniform_m + weight * (abreast_m - uniform_m)
