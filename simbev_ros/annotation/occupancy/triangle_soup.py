"""Triangles in voxels: voxel (i, j, k) is the unit cube at (i, j, k)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from simbev_ros.types import AnyArray, BoolArray, Float32Array, Int64Array, UInt8Array

Shape = tuple[int, int, int]
"""Voxels along x, y and z."""

LEVEL_AREA = 1e-9
"""Triangles of less area, in voxels², have no plane that numbers could hold."""


@dataclass(frozen=True, slots=True)
class Soup:
    """Triangles to voxelise.

    Attributes:
        points: (3, P) float32, voxels, by axis.
        point_rank: (P,) uint8; of several things in a voxel the highest counts, and what has 0 never does.
        triangles: (3, T) int64, by corner; the corners of a triangle share a rank.
        is_solid: (T,) whether the triangle is of a closed surface; all of that surface are.
    """

    points: Float32Array
    point_rank: UInt8Array
    triangles: Int64Array
    is_solid: BoolArray

    @classmethod
    def merged(cls, soups: Sequence["Soup"]) -> "Soup":
        """All of at least one, in order."""
        starts = np.cumsum([0, *(len(soup.point_rank) for soup in soups)])
        return cls(
            np.concatenate([soup.points for soup in soups], axis=1),
            np.concatenate([soup.point_rank for soup in soups]),
            np.concatenate([soup.triangles + start for soup, start in zip(soups, starts, strict=False)], axis=1),
            np.concatenate([soup.is_solid for soup in soups]),
        )


def normals(corners: Float32Array) -> Float32Array:
    """(3, T) normals, twice the area long, of (3, 3, T) corners by axis and corner."""
    ax, ay, az = corners[:, 1] - corners[:, 0]
    bx, by, bz = corners[:, 2] - corners[:, 0]
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])


def counted(counts: AnyArray) -> tuple[Int64Array, Int64Array]:
    """For each i of (N,), ``counts[i]`` times: i, and which time it is."""
    owner = np.repeat(np.arange(len(counts)), counts)
    return owner, np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts, counts)
