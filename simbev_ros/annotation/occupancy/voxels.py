"""Exact voxelization of triangles: combines the passes for surfaces and solids."""

import numpy as np

from simbev_ros.annotation.occupancy.triangle_soup import GridShape, Soup
from simbev_ros.annotation.occupancy.voxel_solids import fill_solids
from simbev_ros.annotation.occupancy.voxel_surfaces import mark_surfaces
from simbev_ros.types import UInt8Array


def voxelize(soup: Soup, shape: GridShape) -> UInt8Array:
    """Highest rank of what is in each voxel, ``shape`` uint8; 0 where it is empty."""
    ranks = np.zeros(int(np.prod(shape)), np.uint8)
    fill_solids(ranks, soup, shape)
    mark_surfaces(ranks, soup, shape)
    return ranks.reshape(shape)
