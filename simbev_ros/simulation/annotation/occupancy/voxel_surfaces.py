"""Marks the voxels that triangles pass through: one of the two passes of voxelization, next to ``voxel_solids``.

A triangle and a cube overlap if and only if their projections along the axes do and the triangle's plane cuts the cube
(Schwarz and Seidel, Fast parallel surface and solid voxelization on GPUs, 2010). In the projection that shows most of
the triangle, the plane crosses at most three cubes per column. Only cubes without a mark of that rank or higher are
tested; most already have one, from solids, triangle corners or columns that the triangle fills.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise, product
from typing import NamedTuple

import numpy as np

from simbev_ros.foundation.geometry.ragged import ragged_indices
from simbev_ros.foundation.types import BoolArray, Float32Array, Int32Array, Int64Array, UInt8Array
from simbev_ros.simulation.annotation.occupancy.triangle_soup import MIN_PLANE_AREA, GridShape, Soup, normals

_PAIRS_PER_BATCH = 200_000

_MIN_EDGE_STEP = 1e-12
"""An edge that advances by less than this along a row has no usable crossing with it."""
_UNBOUNDED = 1e6
"""Half-range for triangles without a usable plane: they may be anywhere within their bounds."""


def mark_surfaces(ranks: UInt8Array, soup: Soup, shape: GridShape) -> None:
    """Raise the ranks of the voxels that contain corners, then of all others that triangles pass through, in place."""
    cells = np.floor(soup.points).astype(np.int32)
    i, j, k = cells
    within = (i >= 0) & (i < shape[0]) & (j >= 0) & (j < shape[1]) & (k >= 0) & (k < shape[2])
    voxel = np.where(within, (i * shape[1] + j) * shape[2] + k, -1)
    np.maximum.at(ranks, voxel[within], soup.point_rank[within])
    a, b, c = (np.take(voxel, corner) for corner in soup.triangles)
    corners = np.take(soup.triangles, np.flatnonzero((a != b) | (b != c) | (a < 0)), axis=1)
    corners = np.take(corners, np.flatnonzero(_spans_more_voxels(cells, corners, shape)), axis=1)
    cells = cells[:, corners]
    low = np.maximum(np.minimum(np.minimum(cells[:, 0], cells[:, 1]), cells[:, 2]), 0)
    high = np.maximum(np.maximum(cells[:, 0], cells[:, 1]), cells[:, 2])
    high = np.minimum(high, np.array(shape, np.int32)[:, None] - 1)
    rank = soup.point_rank[corners[0]]
    remaining = np.flatnonzero(_may_need_marks(ranks, rank, low, high, shape))
    corners, low, high = (np.take(each, remaining, axis=1) for each in (corners, low, high))
    _mark_triangles(ranks, soup.points[:, corners], rank[remaining], low, high, shape)


def _may_need_marks(
    ranks: UInt8Array, rank: UInt8Array, low: Int32Array, high: Int32Array, shape: GridShape
) -> BoolArray:
    """(T,) whether voxels in the (3, T) bounds of triangles may be unmarked; large bounds are not looked up."""
    strides = _strides(shape).astype(np.int32)[:, None]
    lowest = rank
    for x, y, z in product(*zip(low * strides, high * strides, strict=True)):
        lowest = np.minimum(lowest, ranks[x + y + z])
    return (lowest < rank) | ((high - low).max(axis=0, initial=0) > 1)


def _strides(shape: GridShape) -> Int64Array:
    """(3,) steps in the flat grid to the next voxel along each axis."""
    return np.array([shape[1] * shape[2], shape[2], 1])


def _spans_more_voxels(cells: Int32Array, triangles: Int64Array, shape: GridShape) -> BoolArray:
    """(K,) whether triangles may pass through voxels besides those of their (3, K) corners; ``cells`` of points."""
    meets, steps = np.ones(triangles.shape[1], bool), np.zeros(triangles.shape[1], np.int32)
    for axis in range(3):
        a, b, c = (np.take(cells[axis], corner) for corner in triangles)
        low, high = np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)
        meets &= (high >= 0) & (low < shape[axis])
        steps += high - low
    return meets & (steps > 1)  # two voxels with a common face both contain corners


def _mark_triangles(
    ranks: UInt8Array, corners: Float32Array, rank: UInt8Array, low: Int32Array, high: Int32Array, shape: GridShape
) -> None:
    """Raise the ranks of the voxels that triangles pass through, in place.

    Args:
        ranks: Flat grid of ranks.
        corners: (3, 3, T) by axis and corner.
        rank: (T,) rank of each triangle.
        low: (3, T) first voxel of their bounds within the grid, by axis.
        high: (3, T) last voxel.
        shape: Shape of the grid.
    """
    facing = normals(corners)
    along = np.abs(facing).argmax(axis=0)
    strides = _strides(shape)
    for axis in range(3):
        order = [(axis + 1) % 3, (axis + 2) % 3, axis]
        rows = np.flatnonzero(along == axis)
        count = np.prod([high[each, rows].astype(np.int64) - low[each, rows] + 1 for each in order[:2]], axis=0)
        for batch in _batches(count):
            selected = rows[batch]
            projected = _Projected.from_corners(corners[order][..., selected], facing[order][:, selected])
            projected.mark(ranks, rank[selected], low[order][:, selected], high[order][:, selected], strides[order])


@dataclass(frozen=True, slots=True)
class _Projected:
    """Triangles projected along w, the axis on which their normals are longest; coordinates are in the order u, v, w.

    Attributes:
        edges: For the projections along w, u and v: (3, 4, T) by edge: weights of both coordinates of a voxel's center
            and 1, with a sum that is positive inside, and its variation within half a voxel.
        plane: (4, T) weights of u, v and 1 that give w, and its variation within half a column.
    """

    edges: tuple[Float32Array, Float32Array, Float32Array]
    plane: Float32Array

    @classmethod
    def from_corners(cls, corners: Float32Array, facing: Float32Array) -> "_Projected":
        """Project triangles with (3, 3, T) corners, by axis and corner, and (3, T) normals."""
        corners = corners - np.float32(0.5)  # puts voxel centers at integers
        u, v, w = facing
        edges = _edges(corners[0], corners[1], w), _edges(corners[1], corners[2], u), _edges(corners[2], corners[0], v)
        flat = np.abs(w) < MIN_PLANE_AREA
        slope_u, slope_v = (np.where(flat, np.float32(0.0), -part / np.where(flat, 1.0, w)) for part in (u, v))
        offset = corners[2, 0] - slope_u * corners[0, 0] - slope_v * corners[1, 0]
        reach = np.where(flat, _UNBOUNDED, (np.abs(slope_u) + np.abs(slope_v)) / 2.0)
        return cls(edges, np.stack([slope_u, slope_v, offset, reach]).astype(np.float32))

    def mark(self, ranks: UInt8Array, rank: UInt8Array, low: Int32Array, high: Int32Array, strides: Int64Array) -> None:
        """Raise the ranks of all voxels that are passed through, within (3, T) bounds; axes in the order u, v, w."""
        triangle, step = ragged_indices(high[0] - low[0] + 1)
        u = low[0][triangle] + step
        spans = _Spans.from_edges(self.edges[0], triangle, u, low[1], high[1])
        row, step = ragged_indices(np.maximum(spans.last - spans.first + 1, 0))
        triangle, u, v = triangle[row], u[row], spans.first[row] + step
        covered = (v >= spans.first_covered[row]) & (v <= spans.last_covered[row])
        slope_u, slope_v, offset, reach = (each[triangle] for each in self.plane)
        middle = slope_u * u.astype(np.float32) + slope_v * v.astype(np.float32) + offset + np.float32(0.5)
        lowest = np.maximum(np.floor(middle - reach).astype(np.int32), low[2][triangle])
        highest = np.minimum(np.floor(middle + reach).astype(np.int32), high[2][triangle])
        pair, step = ragged_indices(np.maximum(highest - lowest + 1, 0))
        triangle, u, v, w, covered = triangle[pair], u[pair], v[pair], lowest[pair] + step, covered[pair]
        voxel = u * strides[0] + v * strides[1] + w * strides[2]
        np.maximum.at(ranks, voxel[covered], rank[triangle[covered]])
        remaining = np.flatnonzero(~covered & (ranks[voxel] < rank[triangle]))
        for edges, first, second in ((self.edges[1], v, w), (self.edges[2], w, u)):
            remaining = remaining[_touches(edges, triangle[remaining], first[remaining], second[remaining])]
        np.maximum.at(ranks, voxel[remaining], rank[triangle[remaining]])


class _Spans(NamedTuple):
    """(N,) spans of unit squares in rows: those that a triangle's projection touches, and those that it covers."""

    first: Int32Array
    last: Int32Array
    first_covered: Int32Array
    last_covered: Int32Array

    @classmethod
    def from_edges(
        cls, edges: Float32Array, triangle: Int64Array, row: Int64Array, low: Int32Array, high: Int32Array
    ) -> "_Spans":
        """Spans of rows and the triangles in them; the bounds are those of (T,) triangles."""
        lower, upper = low[triangle].astype(np.float32), high[triangle].astype(np.float32)
        limits = [lower, upper, lower, upper]
        for edge in edges:
            a, b, c, reach = (each[triangle] for each in edge)
            constant = -(a * row.astype(np.float32) + c)
            level = np.abs(b) < _MIN_EDGE_STEP
            slope = np.where(level, np.float32(1.0), b)
            for index, margin in ((0, -reach), (2, reach)):
                border, excluded = (constant + margin) / slope, level & (constant + margin > 0.0)
                first, last = limits[index : index + 2]
                limits[index] = np.where(~level & (b > 0.0), np.maximum(first, border), first)
                last = np.where(~level & (b < 0.0), np.minimum(last, border), last)
                limits[index + 1] = np.where(excluded, np.float32(-1.0), last)
        first, last, first_covered, last_covered = (np.clip(limit, -1.0, _UNBOUNDED) for limit in limits)
        return cls(
            *(np.ceil(first).astype(np.int32), np.floor(last).astype(np.int32)),
            *(np.ceil(first_covered).astype(np.int32), np.floor(last_covered).astype(np.int32)),
        )


def _edges(first: Float32Array, second: Float32Array, facing: Float32Array) -> Float32Array:
    """``_Projected.edges`` of one projection, (3, 4, T): from (3, T) coordinates and (T,) signed normals."""
    sign = np.where(facing < 0.0, np.float32(-1.0), np.float32(1.0))
    weights = np.empty((3, 4, len(facing)), np.float32)
    for edge in range(3):
        onward = (edge + 1) % 3
        a = (second[edge] - second[onward]) * sign
        b = (first[onward] - first[edge]) * sign
        weights[edge] = a, b, -a * first[edge] - b * second[edge], (np.abs(a) + np.abs(b)) / 2.0
    return weights


def _touches(edges: Float32Array, triangle: Int64Array, first: Int64Array, second: Int64Array) -> BoolArray:
    """(N,) whether projections of triangles touch unit squares."""
    touched = np.ones(len(triangle), bool)
    first, second = first.astype(np.float32), second.astype(np.float32)
    for edge in edges:
        a, b, c, reach = (each[triangle] for each in edge)
        touched &= a * first + b * second + c >= -reach
    return touched


def _batches(counts: Int64Array) -> Iterator[slice]:
    """Slices of (N,) triangles, each with about as many pairs as fit into the cache."""
    batch = np.cumsum(counts) // _PAIRS_PER_BATCH
    borders = [0, *(np.flatnonzero(np.diff(batch)) + 1).tolist(), len(counts)]
    yield from (slice(start, end) for start, end in pairwise(borders) if end > start)
