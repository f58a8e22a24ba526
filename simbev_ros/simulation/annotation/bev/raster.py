"""Exact rasterizer for the BEV grid: finds the cells with centers covered by triangles.

Plan-view triangles in cell coordinates enter, boolean planes leave. Every (triangle, row) pair gives one span along the
row's center line. Spans are closed intervals, and both triangles of a shared edge compute its crossing from the same
numbers, so there are neither gaps nor widened edges; a center on an edge counts as covered. Triangles without area
(walls seen from above) cover only the centers that lie on them.
"""

from dataclasses import dataclass

import numpy as np

from simbev_ros.foundation.geometry.ragged import ragged_indices
from simbev_ros.foundation.types import BoolArray, Float32Array, Float64Array, Int32Array, Int64Array, UInt8Array

_FLAT_EDGE_ROWS = 1e-12
"""Edges that rise by less than this many rows count as parallel to the rows; this keeps slopes finite."""

_COLUMN_BITS = np.int32(0xFFFF)
_CENTER_BITS = np.int32(0x10001)
"""Bit masks of packed positions: row steps in the upper 16 bits, column steps in the lower 16 bits."""


def corners_near_centers(
    points_cells: Float64Array, triangles: Int32Array, rows: int, columns: int
) -> tuple[Float64Array, Int64Array]:
    """Select the triangles whose bounding rectangle contains a cell center; few triangles of a fine mesh do.

    Args:
        points_cells: (2, V) continuous (row, column) of points, cell centers at integers.
        triangles: (T, 3) indices of points.
        rows: Number of rows of the grid, below 2**14.
        columns: Number of columns of the grid, below 2**14.

    Returns:
        (2, 3, K) (row, column) of their three corners, and (K,) their indices.
    """
    steps = _packed_steps(points_cells, rows, columns)
    near = np.flatnonzero(_differ(*(np.take(steps, corner) for corner in triangles.T)))
    return np.take(points_cells, triangles.take(near, axis=0).T, axis=1), near


def near_centers(corners_cells: Float32Array, rows: int, columns: int) -> BoolArray:
    """Whether the bounding rectangles of triangles contain a cell center, from their (2, 3, …) corners."""
    near = np.ones(corners_cells.shape[2:], bool)
    for (a, b, c), count in zip(corners_cells, (rows, columns), strict=True):
        low, high = np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)
        near &= np.ceil(np.maximum(low, 0)) <= np.minimum(high, count - 1)
    return near


def covered_cells(corners_cells: Float64Array, planes: UInt8Array, shape: tuple[int, int, int]) -> BoolArray:
    """Cells with centers in the closed union of the triangles, plane by plane.

    Args:
        corners_cells: (2, 3, T) continuous (row, column) of the three corners, cell centers at integers.
        planes: (T,) the plane that each triangle is drawn into.
        shape: Planes, rows, columns of the result.

    Returns:
        ``shape`` bool.
    """
    _, rows, columns = shape
    corner_row, corner_column = corners_cells
    first_row, last_row = _integer_range(corner_row.min(axis=0), corner_row.max(axis=0), rows)
    spans = _spans(_edges(corner_row, corner_column), first_row, last_row)
    first, last = _integer_range(spans.low, spans.high, columns)
    line = (planes.astype(np.int64) * rows)[spans.triangle] + spans.row
    return _fill_spans(line, first, last, shape)


@dataclass(frozen=True, slots=True)
class _Edges:
    """Edges of triangles: the long one (lowest to highest corner), and the two short ones that meet at row ``middle``.

    An edge is column = column0 + slope · (row - row0), anchored at its lower end. Shapes: (T,), short edges (2, T).
    """

    middle: Float64Array
    long: tuple[Float64Array, Float64Array, Float64Array]
    short: tuple[Float64Array, Float64Array, Float64Array]


@dataclass(frozen=True, slots=True)
class _Spans:
    """(N,) spans: triangle index, row, and closed interval of columns."""

    triangle: Int64Array
    row: Int64Array
    low: Float64Array
    high: Float64Array


def _packed_steps(points_cells: Float32Array | Float64Array, rows: int, columns: int) -> Int32Array:
    """(…) steps of (2, …) points along both axes of the grid."""
    return _grid_steps(points_cells[0], rows) << 16 | _grid_steps(points_cells[1], columns)


def _grid_steps(coordinates: Float32Array | Float64Array, count: int) -> Int32Array:
    """Steps of coordinates along a grid axis: odd at the centers 0..count-1, even between them."""
    clipped = np.clip(coordinates, -0.5, count - 0.5)
    return (np.ceil(clipped) + np.floor(clipped)).astype(np.int32) + np.int32(1)


def _differ(a: Int32Array, b: Int32Array, c: Int32Array) -> BoolArray:
    """Whether the packed steps of three corners, along both axes, differ or are at a center."""
    differs = (a ^ b) | (a ^ c) | (a & _CENTER_BITS)
    return (differs > _COLUMN_BITS) & ((differs & _COLUMN_BITS) != 0)


def _integer_range(low: Float64Array, high: Float64Array, count: int) -> tuple[Int64Array, Int64Array]:
    """First and last integer of closed intervals, within 0..count-1; first > last if there is none."""
    first = np.ceil(np.clip(low, 0.0, count)).astype(np.int64)
    last = np.floor(np.clip(high, -1.0, count - 1.0)).astype(np.int64)
    return first, last


def _edges(row: Float64Array, column: Float64Array) -> _Edges:
    """Edges of triangles with (3, T) corners."""
    row, column = row.copy(), column.copy()
    for lower in (0, 1, 0):  # a stable sort by row
        pair = slice(lower, lower + 2)
        low, high = row[pair]
        column[pair] = np.where(high < low, column[pair][::-1], column[pair])
        row[pair] = np.minimum(low, high), np.maximum(low, high)
    return _Edges(
        middle=row[1],
        long=(row[0], column[0], _slope(row[2] - row[0], column[2] - column[0])),
        short=(row[:2], column[:2], _slope(row[1:] - row[:2], column[1:] - column[:2])),
    )


def _slope(rise: Float64Array, run: Float64Array) -> Float64Array:
    return np.divide(run, rise, out=np.zeros_like(run), where=rise >= _FLAT_EDGE_ROWS)


def _spans(edges: _Edges, first_row: Int64Array, last_row: Int64Array) -> _Spans:
    """Spans of each triangle and row; at the row of the middle corner, the upper short edge is used."""
    count = last_row - first_row + 1
    triangle, offset = ragged_indices(count)
    row = first_row[triangle] + offset
    row_position = row.astype(np.float64)
    row0, column0, slope = edges.long
    long_column = column0[triangle] + slope[triangle] * (row_position - row0[triangle])
    short_edge = triangle + len(count) * (row_position >= edges.middle[triangle])
    row0, column0, slope = (values.ravel() for values in edges.short)
    short_column = column0[short_edge] + slope[short_edge] * (row_position - row0[short_edge])
    return _Spans(triangle, row, np.minimum(long_column, short_column), np.maximum(long_column, short_column))


def _fill_spans(line: Int64Array, first: Int64Array, last: Int64Array, shape: tuple[int, int, int]) -> BoolArray:
    """Draw spans into planes: cell by cell, or if they overlap a lot, by a running sum of +1 and -1 at their ends."""
    planes, rows, columns = shape
    length = (last - first + 1).clip(0)
    if length.sum() < planes * rows * columns // 4:
        span, offset = ragged_indices(length)
        filled = np.zeros(shape, bool)
        filled.reshape(-1)[(line * columns + first)[span] + offset] = True
        return filled
    nonempty = length > 0
    start = line[nonempty] * (columns + 1)
    steps = np.zeros(planes * rows * (columns + 1), np.int32)
    np.add.at(steps, start + first[nonempty], np.int32(1))
    np.add.at(steps, start + last[nonempty] + 1, np.int32(-1))
    np.cumsum(steps, out=steps)  # every row ends at zero, so one running sum covers all of them
    return steps.reshape(planes, rows, columns + 1)[:, :, :columns] > 0
