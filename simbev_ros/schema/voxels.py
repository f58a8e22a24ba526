"""Table of occupied voxels."""

import numpy as np

from simbev_ros.foundation.geometry.voxel_grid import VoxelGrid
from simbev_ros.foundation.types import Table, UInt8Array

VOXEL_DTYPE = np.dtype(
    [
        ("x", "<f4"),  # m, ego frame: center of the voxel
        ("y", "<f4"),
        ("z", "<f4"),
        ("ix", "<u2"),  # voxel index from the rear of the box
        ("iy", "<u2"),  # voxel index from its right side
        ("iz", "<u2"),  # voxel index from its bottom
        ("tag", "u1"),  # semantic Tag
    ]
)
"""Row of the table of occupied voxels. Field names and order are those of /ego/occupancy/points."""


def dense_tags(voxels: Table, grid: VoxelGrid) -> UInt8Array:
    """(x, y, z) uint8 tags, 0 where free, from the rows that ``occupied_voxels`` returns."""
    tags = np.zeros(grid.shape, np.uint8)
    tags[voxels["ix"], voxels["iy"], voxels["iz"]] = voxels["tag"]
    return tags
