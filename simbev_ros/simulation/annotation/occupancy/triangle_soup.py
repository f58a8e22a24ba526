"""Triangles in voxel coordinates, the input of voxelization: voxel (i, j, k) is the unit cube at (i, j, k)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from simbev_ros.foundation.types import BoolArray, Float32Array, Int64Array, UInt8Array

GridShape = tuple[int, int, int]
"""Number of voxels along x, y and z."""

MIN_PLANE_AREA = 1e-9
"""Triangles of less area, in voxels², are too thin to compute a plane from."""


@dataclass(frozen=True, slots=True)
class Soup:
    """A batch of triangles to voxelize, each with the rank of its tag.

    Attributes:
        points: (3, P) float32, voxels, by axis.
        point_rank: (P,) uint8; the highest rank in a voxel wins, rank 0 marks nothing.
        triangles: (3, T) int64 indices of points, by corner; the corners of a triangle share a rank.
        is_solid: (T,) whether the triangle belongs to a closed surface; the same for all triangles of a surface.
    """

    points: Float32Array
    point_rank: UInt8Array
    triangles: Int64Array
    is_solid: BoolArray

    @classmethod
    def merge(cls, soups: Sequence["Soup"]) -> "Soup":
        """Concatenate one or more batches, in order."""
        starts = np.cumsum([0, *(len(soup.point_rank) for soup in soups)])
        return cls(
            np.concatenate([soup.points for soup in soups], axis=1),
            np.concatenate([soup.point_rank for soup in soups]),
            np.concatenate([soup.triangles + start for soup, start in zip(soups, starts, strict=False)], axis=1),
            np.concatenate([soup.is_solid for soup in soups]),
        )


def normals(corners: Float32Array) -> Float32Array:
    """(3, T) normals, twice the triangle's area long, from (3, 3, T) corners by axis and corner."""
    ax, ay, az = corners[:, 1] - corners[:, 0]
    bx, by, bz = corners[:, 2] - corners[:, 0]
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])
