"""Many polylines concatenated in one array, so that operations on all lanes of a map need no Python loop."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from simbev_ros.foundation.geometry.plan_view import left_of
from simbev_ros.foundation.geometry.ragged import ragged_indices
from simbev_ros.foundation.types import AnyArray, BoolArray, Float64Array, Int64Array

_SAME_POINT_M = 1e-3


@dataclass(frozen=True)
class Polylines:
    """L polylines of at least two points each; distances along them are measured in plan view.

    Attributes:
        points_m: (P, D) float64, D at least 2, map frame.
        first: (L + 1,) int64 index of each line's first point, and P.
    """

    points_m: Float64Array
    first: Int64Array

    @staticmethod
    def from_lines(lines_m: Sequence[Float64Array], dimensions: int = 3) -> "Polylines":
        """Concatenate (N, D) lines; ``dimensions`` is D for the case that there are none."""
        counts = np.array([len(line_m) for line_m in lines_m], np.int64)
        points_m = np.concatenate([np.empty((0, dimensions)), *lines_m])
        return Polylines(points_m, np.concatenate([[0], np.cumsum(counts)]))

    def __len__(self) -> int:
        return len(self.first) - 1

    @cached_property
    def row(self) -> Int64Array:
        """(P,) index of the line of each point."""
        return np.repeat(np.arange(len(self)), np.diff(self.first))

    @cached_property
    def station_m(self) -> Float64Array:
        """(P,) distance of each point from its line's start."""
        steps_m = np.linalg.norm(np.diff(self.points_m[:, :2], axis=0, prepend=self.points_m[:1, :2]), axis=1)
        steps_m[self.first[:-1]] = 0.0
        cumulative_m = np.cumsum(steps_m)
        return cumulative_m - cumulative_m[self.first[:-1]][self.row]

    @cached_property
    def length_m(self) -> Float64Array:
        """(L,) lengths."""
        return self.station_m[self.first[1:] - 1]

    def sample_stations(self, spacing_m: float | Float64Array) -> tuple[Int64Array, Float64Array]:
        """Stations of both ends of every line and evenly between them, at most ``spacing_m`` apart: one number or (L,).

        Returns:
            (N,) lines and (N,) distances from their starts, line after line.
        """
        counts = np.maximum(np.ceil(self.length_m / spacing_m).astype(np.int64), 1) + 1
        row, number = ragged_indices(counts)
        return row, self.length_m[row] * number / (counts[row] - 1)

    def parameter(self, row: Int64Array, s_m: Float64Array) -> Float64Array:
        """(N,) positions as real-valued point indices: 2.25 lies a quarter of the segment from point 2 to point 3."""
        end_m = self.length_m[row]
        # Lines are laid end to end with gaps, so that one sorted search finds the segments of all positions.
        offset_m = np.concatenate([[0.0], np.cumsum(self.length_m + 1.0)])
        global_station_m = np.clip(s_m, 0.0, end_m) + offset_m[row]
        after = np.searchsorted(self.station_m + offset_m[self.row], global_station_m, side="right")
        after = np.clip(after, self.first[row] + 1, self.first[row + 1] - 1)
        start_m, stop_m = self.station_m[after - 1], self.station_m[after]
        fraction = (np.clip(s_m, 0.0, end_m) - start_m) / np.maximum(stop_m - start_m, 1e-9)
        return after - 1 + np.clip(fraction, 0.0, 1.0)

    def values(self, parameter: Float64Array, per_point: Float64Array | None = None) -> Float64Array:
        """(N, D) positions given by ``parameter``, or other (P, ...) per-point values interpolated there."""
        values = self.points_m if per_point is None else per_point
        before = np.minimum(np.floor(parameter).astype(np.int64), len(values) - 2)
        fraction = (parameter - before).reshape(-1, *[1] * (values.ndim - 1))
        return values[before] * (1.0 - fraction) + values[before + 1] * fraction

    def headings(self, parameter: Float64Array) -> Float64Array:
        """(N, 2) unit vectors of the segments at positions given by ``parameter``."""
        row = self.row[np.minimum(np.floor(parameter + 1e-9).astype(np.int64), len(self.row) - 1)]
        before = np.clip(np.floor(parameter).astype(np.int64), self.first[row], self.first[row + 1] - 2)
        step_m = self.points_m[before + 1, :2] - self.points_m[before, :2]
        return step_m / np.maximum(np.linalg.norm(step_m, axis=1, keepdims=True), 1e-9)

    def offset_to_left(self, left_m: Float64Array) -> Float64Array:
        """(P, D) the points offset to the left by (P,) distances, with mitered corners, so that lines stay parallel.

        Points that repeat each other are offset alike.
        """
        if not self._is_distinct.all():
            distinct = np.flatnonzero(self._is_distinct)
            first = np.searchsorted(distinct, self.first)
            moved_m = Polylines(self.points_m[distinct], first).offset_to_left(left_m[distinct])
            run = np.cumsum(self._is_distinct) - 1
            return np.concatenate([moved_m[run, :2], self.points_m[:, 2:]], axis=1)
        step_m = np.diff(self.points_m[:, :2], axis=0)
        heading = step_m / np.maximum(np.linalg.norm(step_m, axis=1, keepdims=True), 1e-9)
        normal = left_of(heading)
        before, after = np.concatenate([normal[:1], normal]), np.concatenate([normal, normal[-1:]])
        starts, ends = self.first[:-1], self.first[1:] - 1
        before[starts], after[ends] = after[starts], before[ends]
        miter = before + after
        miter /= np.maximum(np.sum(miter * before, axis=1, keepdims=True), 0.2)
        offset_points_m = self.points_m.copy()
        offset_points_m[:, :2] += left_m[:, None] * miter
        return offset_points_m

    @cached_property
    def _is_distinct(self) -> BoolArray:
        """(P,) whether a point does not repeat the one before it; all points of lines without a length are distinct."""
        is_distinct = np.diff(self.station_m, prepend=-1.0) > _SAME_POINT_M
        is_distinct[self.first[:-1]] = True
        return np.asarray(is_distinct | (self.length_m <= _SAME_POINT_M)[self.row], bool)

    def split(self, per_point: AnyArray) -> list[AnyArray]:
        """Views of (P, ...) per-point values, one for each line."""
        bounds = self.first.tolist()
        return [per_point[start:end] for start, end in pairwise(bounds)]
