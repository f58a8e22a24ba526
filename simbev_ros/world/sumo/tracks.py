"""From SUMO's places on lanes to places on the ground, so that who changes lanes goes on from abreast of where it was.

SUMO gives all lanes of an edge one length, whatever their shapes, and takes a place on one for the same place on all.
On lanes that bend somewhere along an edge those places lie metres apart, and whoever changed lanes would jump. Here a
place counts along the edge's middle lane, and the others run abreast of it.
"""

from collections import defaultdict
from collections.abc import Sequence

import numpy as np
import shapely

from simbev_ros.maps.network import Lane
from simbev_ros.maps.roads.polylines import Polylines
from simbev_ros.types import Float64Array, Int64Array

_SPACING_M = 1.0
_STRETCH = 0.3  # by so much at most who drives on a lane is faster or slower than SUMO says


class Tracks:
    """Lanes in samples: number k of one lane of an edge lies abreast of number k of the others."""

    def __init__(self, lanes: Sequence[Lane]) -> None:
        """Give all lanes of an edge that vehicles may change between."""
        self._row = {lane.id: row for row, lane in enumerate(lanes)}
        lines = Polylines.of([lane.centerline_m for lane in lanes])
        self._sumo_length_m = lines.length_m * np.array([lane.sumo_s_per_m for lane in lanes])
        middle = _middle_lanes(lanes)
        self._last = np.maximum(np.ceil(lines.length_m[middle] / _SPACING_M), 1.0).astype(np.int64)
        row = np.repeat(np.arange(len(lanes)), self._last + 1)
        first = np.concatenate([[0], np.cumsum(self._last + 1)])
        share = (np.arange(len(row)) - first[row]) / self._last[row]
        self._station_m = _stretched(lines, row, share, _abreast(lines, row, middle[row], share))
        self._lines = Polylines(lines.values(lines.parameter(row, self._station_m)), first)
        self._left = self._lines.beside(np.ones(len(row)))[:, :2] - self._lines.points_m[:, :2]

    def sumo_position_m(self, lane: str, s_m: float) -> float:
        """SUMO's position of a place at a distance along a lane's centre line."""
        row = self._row[lane]
        stations_m = self._station_m[self._lines.first[row] : self._lines.first[row + 1]]
        number = float(np.interp(s_m, stations_m, np.arange(len(stations_m))))
        return number / float(self._last[row]) * float(self._sumo_length_m[row])

    def __contains__(self, lane: str) -> bool:
        return lane in self._row

    def rows(self, lanes: Sequence[str]) -> Int64Array:
        """(N,) numbers of lanes here.

        Raises:
            KeyError: a lane is not among those given.
        """
        return np.array([self._row[lane] for lane in lanes], np.int64)

    def sumo_length_m(self, row: Int64Array) -> Float64Array:
        """(N,) SUMO's lengths of (N,) lanes."""
        length_m: Float64Array = self._sumo_length_m[row]
        return length_m

    def places_m(self, lanes: Sequence[str], position_m: Float64Array, left_m: Float64Array) -> Float64Array:
        """(N, 3) places, map frame, of SUMO's (N,) positions on N lanes, (N,) distances to the left of their middles.

        Raises:
            KeyError: a lane is not among those given.
        """
        return self.places_on_m(self.rows(lanes), position_m, left_m)

    def places_on_m(self, row: Int64Array, position_m: Float64Array, left_m: Float64Array) -> Float64Array:
        """As ``places_m``, on lanes of (N,) numbers."""
        share = np.clip(position_m / np.maximum(self._sumo_length_m[row], 1e-9), 0.0, 1.0)
        parameter = self._lines.first[row] + share * self._last[row]
        places_m = self._lines.values(parameter)
        places_m[:, :2] += left_m[:, None] * self._lines.values(parameter, self._left)
        return places_m


def _middle_lanes(lanes: Sequence[Lane]) -> Int64Array:
    """(L,) row of the middle lane of each lane's edge."""
    edges: dict[str, list[int]] = defaultdict(list)
    for row, lane in enumerate(lanes):
        edges[lane.edge].append(row)
    middle = {edge: sorted(rows, key=lambda row: lanes[row].index)[len(rows) // 2] for edge, rows in edges.items()}
    return np.array([middle[lane.edge] for lane in lanes], np.int64)


def _abreast(lines: Polylines, row: Int64Array, middle: Int64Array, share: Float64Array) -> Float64Array:
    """(N,) distances along lanes abreast of (N,) shares of the way along their edges' middle lanes."""
    by_length_m = share * lines.length_m[row]
    others = np.flatnonzero(row != middle)
    beside_m = lines.values(lines.parameter(middle[others], share[others] * lines.length_m[middle[others]]))
    shapes = np.array([shapely.LineString(line_m[:, :2]) for line_m in lines.split(lines.points_m)], object)
    station_m = by_length_m.copy()
    located_m = shapely.line_locate_point(shapes[row[others]], shapely.points(beside_m[:, :2]))
    station_m[others] = located_m
    ends = (share == 0.0) | (share == 1.0)
    station_m[ends] = by_length_m[ends]
    # Never backwards: a running maximum, with lanes so far apart that one does not reach into the next.
    apart_m = row * (1.0 + lines.length_m.max(initial=0.0))
    forward_m: Float64Array = np.minimum(np.maximum.accumulate(station_m + apart_m) - apart_m, lines.length_m[row])
    return forward_m


def _stretched(lines: Polylines, row: Int64Array, share: Float64Array, abreast_m: Float64Array) -> Float64Array:
    """(N,) distances along lanes between those abreast and (N,) shares of the length, as far as ``_STRETCH`` allows.

    Else a lane would stand still while its neighbour turns around it, and run where the neighbour comes back.
    """
    by_length_m = share * lines.length_m[row]
    along_m, abreast_step_m = np.diff(by_length_m), np.diff(abreast_m)
    inside = np.diff(row) == 0
    stretch = np.abs(abreast_step_m[inside] / np.maximum(along_m[inside], 1e-9) - 1.0)
    most = np.zeros(len(lines.length_m))
    np.maximum.at(most, row[:-1][inside], stretch)
    weight = np.minimum(1.0, _STRETCH / np.maximum(most, 1e-9))[row]
    stretched_m: Float64Array = by_length_m + weight * (abreast_m - by_length_m)
    return stretched_m
