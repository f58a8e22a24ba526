"""Exact rasteriser: which cell centres lie under which triangles.

Every (triangle, row) pair is one span along the row's centre line. Spans are closed intervals and both triangles of a
shared edge compute its crossing from the same numbers, so that neither gaps nor widened edges can occur; a centre that
lies on an edge counts as covered. Triangles without area (walls seen from above) cover nothing but centres on them.
"""

from dataclasses import dataclass

import numpy as np

from simbev_ros.types import BoolArray, Float32Array, Float64Array, Int32Array, Int64Array, UInt8Array

_FLAT_EDGE_ROWS = 1e-12
"""Edges that rise by less than this many rows count as parallel to the rows; it keeps slopes finite."""

_COLUMN = np.int32(0xFFFF)
_ON_CENTER = np.int32(0x10001)
"""Bits of a number that holds the steps to a row above those to a column."""


def corners_near_centers(
    points_cells: Float32Array | Float64Array, triangles: Int32Array, rows: int, columns: int
) -> tuple[Float64Array, Int64Array]:
    """Triangles in whose bounds a cell's centre lies; of finely meshed things hardly any.

    Args:
        points_cells: (2, ..., V) continuous (row, column) of points, a cell's centre at integers; in between, several
            times the same mesh.
        triangles: (T, 3) indices into the last axis.
        rows: Of the grid, fewer than 2**14.
        columns: As many at most.

    Returns:
        (2, 3, K) float64 (row, column) of their three corners, and (K,) where they are among (..., T).
    """
    place = _steps(points_cells[0], rows) << 16 | _steps(points_cells[1], columns)
    a, b, c = (np.take(place, corner, axis=-1) for corner in triangles.T)
    differs = (a ^ b) | (a ^ c) | (a & _ON_CENTER)
    near = np.flatnonzero((differs > _COLUMN) & ((differs & _COLUMN) != 0))
    mesh, triangle = np.divmod(near, max(len(triangles), 1))
    corner = triangles[triangle].T + mesh * points_cells.shape[-1]
    return np.take(points_cells.reshape(2, -1), corner, axis=1).astype(np.float64), near


def covered_cells(corners_cells: Float64Array, planes: UInt8Array, shape: tuple[int, int, int]) -> BoolArray:
    """Cells whose centre lies in the closed union of the triangles, plane by plane.

    Args:
        corners_cells: (2, 3, T) continuous (row, column) of the three corners, a cell's centre at integers.
        planes: (T,) the plane that each triangle is drawn into.
        shape: Planes, rows, columns of the result.

    Returns:
        ``shape`` bool.
    """
    _, rows, columns = shape
    corner_row, corner_column = corners_cells
    first_row, last_row = _integers_between(corner_row.min(axis=0), corner_row.max(axis=0), rows)
    spans = _spans(_edges(corner_row, corner_column), first_row, last_row)
    first, last = _integers_between(spans.low, spans.high, columns)
    line = (planes.astype(np.int64) * rows)[spans.triangle] + spans.row
    return _filled(line, first, last, shape)


@dataclass(frozen=True, slots=True)
class _Edges:
    """Per triangle its long edge (lowest to highest corner); the two others one after the other, split at ``middle``.

    Each edge is column = column0 + slope · (row - row0), anchored at its lower end. Arrays: (T,), of the short (2, T).
    """

    middle: Float64Array
    long: tuple[Float64Array, Float64Array, Float64Array]
    short: tuple[Float64Array, Float64Array, Float64Array]


@dataclass(frozen=True, slots=True)
class _Spans:
    """(N,) spans: index of the triangle, row, and the closed interval of columns."""

    triangle: Int64Array
    row: Int64Array
    low: Float64Array
    high: Float64Array


def _steps(at: Float32Array | Float64Array, count: int) -> Int32Array:
    """How far coordinates are along a grid's axis: odd at the centres 0..count-1, even between them."""
    clipped = np.clip(at, -0.5, count - 0.5)
    steps: Int32Array = (np.ceil(clipped) + np.floor(clipped)).astype(np.int32) + np.int32(1)
    return steps


def _integers_between(low: Float64Array, high: Float64Array, count: int) -> tuple[Int64Array, Int64Array]:
    """First and last integer of closed intervals, within 0..count-1; first > last where there is none."""
    first = np.ceil(np.clip(low, 0.0, count)).astype(np.int64)
    last = np.floor(np.clip(high, -1.0, count - 1.0)).astype(np.int64)
    return first, last


def _edges(row: Float64Array, column: Float64Array) -> _Edges:
    """The edges of triangles with (3, T) corners."""
    order = np.argsort(row, axis=0, kind="stable")
    row = np.take_along_axis(row, order, axis=0)
    column = np.take_along_axis(column, order, axis=0)
    return _Edges(
        middle=row[1],
        long=(row[0], column[0], _slope(row[2] - row[0], column[2] - column[0])),
        short=(row[:2], column[:2], _slope(row[1:] - row[:2], column[1:] - column[:2])),
    )


def _slope(rise: Float64Array, run: Float64Array) -> Float64Array:
    flat = rise < _FLAT_EDGE_ROWS
    slope: Float64Array = np.where(flat, 0.0, run) / np.where(flat, 1.0, rise)
    return slope


def _spans(edges: _Edges, first_row: Int64Array, last_row: Int64Array) -> _Spans:
    """One span per triangle and row; at the middle corner's row the upper short edge holds."""
    count = last_row - first_row + 1
    triangle = np.repeat(np.arange(len(count)), count)
    row = np.arange(len(triangle)) + np.repeat(first_row - np.cumsum(count) + count, count)
    at = row.astype(np.float64)
    row0, column0, slope = edges.long
    one = column0[triangle] + slope[triangle] * (at - row0[triangle])
    half = triangle + len(count) * (at >= edges.middle[triangle])
    row0, column0, slope = (values.ravel() for values in edges.short)
    other = column0[half] + slope[half] * (at - row0[half])
    return _Spans(triangle, row, np.minimum(one, other), np.maximum(one, other))


def _filled(line: Int64Array, first: Int64Array, last: Int64Array, shape: tuple[int, int, int]) -> BoolArray:
    """Spans drawn into planes, through a running sum of +1 at their start and -1 behind their end."""
    planes, rows, columns = shape
    some = first <= last
    start = line[some] * (columns + 1)
    steps = np.zeros(planes * rows * (columns + 1), np.int32)
    np.add.at(steps, start + first[some], np.int32(1))
    np.add.at(steps, start + last[some] + 1, np.int32(-1))
    np.cumsum(steps, out=steps)  # every row ends at zero, so one sum may run through all of them
    filled: BoolArray = steps.reshape(planes, rows, columns + 1)[:, :, :columns] > 0
    return filled
