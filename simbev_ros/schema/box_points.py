"""Counts lidar and radar points inside 3D boxes, and derives from them which boxes are valid and how difficult.

Point clouds in the map frame and ``BOX_DTYPE`` rows enter; the rows leave with their point columns filled.
"""

from collections.abc import Sequence

import numpy as np

from simbev_ros.foundation.geometry.ragged import ragged_indices, ragged_starts
from simbev_ros.foundation.geometry.transforms import rotations_from_rpy
from simbev_ros.foundation.types import AnyArray, BoolArray, Float64Array, Int32Array, Int64Array, Table
from simbev_ros.schema.boxes import difficulty

_CELL_M, _MAX_CELLS = 0.75, 256  # cell size of the lookup grid, and the maximum number of cells along its longer side
_BATCH = 16384  # points per batch: intermediate results stay in the cache, which is three times as fast
_SLACK_M = 1e-6  # cells are this much larger than the boxes: more than rounding errors, less than matters


def add_point_counts(
    boxes: Table, lidar_m: Sequence[Float64Array] | None, radar_m: Sequence[Float64Array] | None
) -> Table:
    """The boxes with the number of lidar and radar points inside filled in, and the columns that depend on it.

    Args:
        boxes: (B,) ``BOX_DTYPE``.
        lidar_m: The clouds of all lidars, each (N, 3), map frame; None if none was received at this tick.
        radar_m: The clouds of all radars, likewise.

    Returns:
        (B,) ``BOX_DTYPE``, with ``lidar_points``, ``radar_points``, ``valid`` and ``difficulty`` filled. The count of a
        kind of sensor that was not received is -1, and treated as 0.
    """
    result, lookup = boxes.copy(), BoxLookup(boxes)
    for name, clouds_m in ("lidar_points", lidar_m), ("radar_points", radar_m):
        result[name] = -1 if clouds_m is None else sum((lookup.count(points_m) for points_m in clouds_m), np.int32(0))
    points = np.maximum(result["lidar_points"], 0) + np.maximum(result["radar_points"], 0)
    result["valid"] = points > 0
    result["difficulty"] = difficulty(boxes["class"], boxes["distance"], points)
    return result


class BoxLookup:
    """Point lookup in boxes: a plan-view grid that knows which boxes reach into each cell, and their height range.

    Attributes:
        center_m: (B, 3) float64, map frame.
        rotation: (B, 3, 3) map from box.
        half_m: (B, 3) half of length, width, height.
    """

    def __init__(self, boxes: Table) -> None:
        self.center_m, rpy_rad, size_m = (
            np.stack([boxes[name] for name in names.split()], axis=1).astype(np.float64)
            for names in ("x y z", "roll pitch yaw", "length width height")
        )
        self.rotation, self.half_m = rotations_from_rpy(rpy_rad), size_m / 2.0
        if len(boxes):
            self._build_grid()

    def count(self, points_m: AnyArray) -> Int32Array:
        """(B,) number of points in each box, faces included.

        Args:
            points_m: (N, 3) map frame; points that are not finite are in no box.
        """
        count = np.zeros(len(self.half_m), np.int32)
        for start in range(0, len(points_m) if len(count) else 0, _BATCH):
            batch_m = np.asarray(points_m[start : start + _BATCH], np.float64)
            point, box = self._candidates(batch_m)
            to_point = batch_m[point] - self.center_m[box]
            inside = (np.abs(np.einsum("pi,pij->pj", to_point, self.rotation[box])) <= self.half_m[box]).all(axis=1)
            count += np.bincount(box[inside], minlength=len(count)).astype(np.int32)
        return count

    def _candidates(self, points_m: Float64Array) -> tuple[Int64Array, Int64Array]:
        """(K,) points and (K,) boxes that may contain them."""
        index = np.zeros(len(points_m), np.int32)
        for axis, stride in (1, int(self._shape[0])), (0, 1):
            position = (points_m[:, axis] - self._origin_m[axis]) * self._per_m + 1.0
            position = np.fmin(np.fmax(position, 0.0), self._shape[axis] - 1.0)  # NaN goes to the border
            index += position.astype(np.int32) * np.int32(stride)
        height_m = points_m[:, 2]
        near = np.flatnonzero((height_m >= self._low_m[index]) & (height_m <= self._high_m[index]))
        index = index[near]
        point, pair = _ragged_ranges(near, self._first[index], self._count[index])
        return point, self._box[pair]

    def _build_grid(self) -> None:
        reach_m = np.einsum("bij,bj->bi", np.abs(self.rotation), self.half_m) + _SLACK_M
        low_m, high_m = self.center_m - reach_m, self.center_m + reach_m
        self._origin_m = low_m[:, :2].min(axis=0)
        span_m = high_m[:, :2].max(axis=0) - self._origin_m
        self._per_m = 1.0 / max(_CELL_M, float(span_m.max()) / _MAX_CELLS)
        first, last = self._cells(low_m), self._cells(high_m)
        self._shape = last.max(axis=0) + 2
        box, cell = _covered_cells(first, last)
        touched = self._touches(box, cell)
        self._fill(box[touched], cell[touched], low_m[:, 2], high_m[:, 2])

    def _cells(self, points_m: Float64Array) -> Int64Array:
        """(N, 2) column and row of points on the grid; the outermost cells stay empty."""
        return ((points_m[:, :2] - self._origin_m) * self._per_m).astype(np.int64) + 1

    def _touches(self, box: Int64Array, cell: Int64Array) -> BoolArray:
        """(K,) whether a box in plan view comes near a cell: they do not separate along or across its heading."""
        heading = self.rotation[:, :2, 0]
        level = np.hypot(heading[:, 0], heading[:, 1])
        heading = np.where(level[:, None] > 0.0, heading / np.maximum(level, 1e-12)[:, None], [1.0, 0.0])
        axes = np.stack([heading, heading[:, ::-1] * [-1.0, 1.0]], axis=1)  # along and to the left
        reach_m = np.einsum("bik,bk->bi", np.abs(axes @ self.rotation[:, :2]), self.half_m)
        reach_m += np.abs(axes).sum(axis=2) * 0.5 / self._per_m + _SLACK_M
        offset_m = (cell - 0.5) / self._per_m + self._origin_m - self.center_m[box, :2]
        return (np.abs(np.einsum("kij,kj->ki", axes[box], offset_m)) <= reach_m[box]).all(axis=1)

    def _fill(self, box: Int64Array, cell: Int64Array, low_m: Float64Array, high_m: Float64Array) -> None:
        """Sort (box, cell) pairs by cell."""
        index = cell[:, 1] * self._shape[0] + cell[:, 0]
        order = np.argsort(index, kind="stable")
        self._box, cells = box[order], int(self._shape.prod())
        self._count = np.bincount(index, minlength=cells)
        self._first = ragged_starts(self._count)
        filled = np.flatnonzero(self._count)
        self._low_m, self._high_m = np.full(cells, np.inf), np.full(cells, -np.inf)
        self._low_m[filled] = np.minimum.reduceat(low_m[self._box], self._first[filled])
        self._high_m[filled] = np.maximum.reduceat(high_m[self._box], self._first[filled])


def _ragged_ranges(keys: Int64Array, first: Int64Array, count: Int64Array) -> tuple[Int64Array, Int64Array]:
    """Keys repeated (K,) ``count`` times each, and for each repetition an index counting up from ``first``."""
    segment, offset = ragged_indices(count)
    return keys[segment], first[segment] + offset


def _covered_cells(first: Int64Array, last: Int64Array) -> tuple[Int64Array, Int64Array]:
    """(K,) boxes and (K, 2) the cells between the (B, 2) first and last cell of each box."""
    size = last - first + 1
    boxes = np.arange(len(size))
    box, index = _ragged_ranges(boxes, np.zeros_like(boxes), size.prod(axis=1))
    row, column = np.divmod(index, size[box, 0])
    return box, first[box] + np.stack([column, row], axis=1)
