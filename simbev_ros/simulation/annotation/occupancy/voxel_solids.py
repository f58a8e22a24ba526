"""Fills the voxels that lie inside closed surfaces: one of the two passes of voxelization, next to ``voxel_surfaces``.

A voxel that no surface passes through lies inside if its center does. On the vertical line through the center, surfaces
that face down open a solid and those that face up close it; solids may overlap. Triangles with a common edge compute
its crossings from the same numbers, so a line through an edge crosses exactly one of them.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from simbev_ros.foundation.geometry.ragged import ragged_indices
from simbev_ros.foundation.types import Float32Array, Int64Array, UInt8Array
from simbev_ros.simulation.annotation.occupancy.triangle_soup import MIN_PLANE_AREA, GridShape, Soup, normals


def fill_solids(ranks: UInt8Array, soup: Soup, shape: GridShape) -> None:
    """Raise the ranks of voxels with centers inside closed surfaces, in place."""
    triangles = np.take(soup.triangles, np.flatnonzero(soup.is_solid), axis=1)
    points = soup.points - np.float32(0.5)
    for axis in range(2):
        line = np.ceil(points[axis]).astype(np.int32)
        a, b, c = (np.take(line, corner) for corner in triangles)
        triangles = np.take(triangles, np.flatnonzero((a != b) | (b != c)), axis=1)
    crossings = _Crossings.from_corners(points[:, triangles], soup.point_rank[triangles[0]], shape)
    voxel, rank = crossings.enclosed(shape)
    np.maximum.at(ranks, voxel, rank)


@dataclass(frozen=True, slots=True)
class _Crossings:
    """(N,) crossings of triangles by the vertical lines through voxel centers.

    Attributes:
        column: Index of the line.
        layer: The first voxel above, 0 to the number of layers.
        turn: 1 where a surface faces down, -1 where it faces up.
        rank: Rank of the triangle.
    """

    column: Int64Array
    layer: Int64Array
    turn: Int64Array
    rank: UInt8Array

    @classmethod
    def from_corners(cls, corners: Float32Array, rank: UInt8Array, shape: GridShape) -> "_Crossings":
        """Cross (3, 3, T) triangle corners, by axis and corner, with voxel centers at integers."""
        order = np.argsort(corners[0], axis=0, kind="stable")
        parity = np.where((order[1] - order[0]) % 3 == 1, 1, -1)
        corners = np.take_along_axis(corners, order[None], axis=1)
        (x0, x1, x2), (y0, y1, y2), _ = corners
        first, end = (np.clip(np.ceil(each), 0, shape[0]).astype(np.int32) for each in (x0, x2))
        triangle, step = ragged_indices(end - first)
        x = first[triangle] + step
        long, lower, upper = (
            _Lines.from_ends(*ends).y_at(triangle, x) for ends in ((x0, y0, x2, y2), (x0, y0, x1, y1), (x1, y1, x2, y2))
        )
        short = np.where(x1[triangle] <= x, upper, lower)
        first, end = (
            np.clip(np.ceil(each), 0, shape[1]).astype(np.int32)
            for each in (np.minimum(long, short), np.maximum(long, short))
        )
        turn = np.where(long > short, -1, 1) * parity[triangle]
        line, step = ragged_indices(end - first)
        triangle, x, y = triangle[line], x[line], first[line] + step
        layer = np.clip(np.floor(_heights(corners, triangle, x, y)).astype(np.int64) + 1, 0, shape[2])
        return cls(x * shape[1] + y, layer, turn[line], rank[triangle])

    def enclosed(self, shape: GridShape) -> tuple[Int64Array, UInt8Array]:
        """Voxels inside the solids, and their ranks; a voxel may occur several times."""
        lines = int(shape[0] * shape[1])
        position = (self.rank.astype(np.int64) * lines + self.column) * (shape[2] + 1) + self.layer
        position = np.sort(position << 1 | (self.turn < 0))
        depth = np.cumsum(1 - 2 * (position & 1))
        position >>= 1
        within = np.flatnonzero(depth[:-1] > 0)
        run, step = ragged_indices(position[within + 1] - position[within])
        rest, layer = np.divmod(position[within], shape[2] + 1)
        rank, column = np.divmod(rest, lines)
        return (column * shape[2] + layer)[run] + step, rank[run].astype(np.uint8)


class _Lines(NamedTuple):
    """(T,) lines in plan view; equal ends give bit-equal coefficients."""

    x: Float32Array
    y: Float32Array
    slope: Float32Array

    @classmethod
    def from_ends(cls, x0: Float32Array, y0: Float32Array, x1: Float32Array, y1: Float32Array) -> "_Lines":
        """Lines through (T,) ends; where x does not change, the slope is arbitrary."""
        run = x1 - x0
        return cls(x0, y0, np.divide(y1 - y0, run, out=np.zeros_like(run), where=run > 0.0))

    def y_at(self, line: Int64Array, x: Int64Array) -> Float32Array:
        """(N,) y of the selected lines at x."""
        return self.y[line] + (x.astype(np.float32) - self.x[line]) * self.slope[line]


def _heights(corners: Float32Array, triangle: Int64Array, x: Int64Array, y: Int64Array) -> Float32Array:
    """(N,) heights of triangles, (3, 3, T) corners, at positions within them."""
    normal_x, normal_y, normal_z = normals(corners)
    steep = np.abs(normal_z) < MIN_PLANE_AREA
    slope_x, slope_y = (
        np.where(steep, np.float32(0.0), -each / np.where(steep, np.float32(1.0), normal_z))[triangle]
        for each in (normal_x, normal_y)
    )
    x0, y0, z0 = (each[0][triangle] for each in corners)
    height = z0 + slope_x * (x.astype(np.float32) - x0) + slope_y * (y.astype(np.float32) - y0)
    low, high = corners[2].min(axis=0), corners[2].max(axis=0)
    return np.clip(height, low[triangle], high[triangle])
