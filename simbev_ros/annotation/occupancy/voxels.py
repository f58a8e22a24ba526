"""Exact voxelisation of surfaces and solids."""

import numpy as np

from simbev_ros.annotation.occupancy.triangle_soup import Shape, Soup
from simbev_ros.annotation.occupancy.voxel_solids import fill_solids
from simbev_ros.annotation.occupancy.voxel_surfaces import mark_surfaces
from simbev_ros.types import UInt8Array


def voxelized(soup: Soup, shape: Shape) -> UInt8Array:
    """``shape`` the highest rank of what is in each voxel, 0 if nothing is."""
    ranks = np.zeros(int(np.prod(shape)), np.uint8)
    fill_solids(ranks, soup, shape)
    mark_surfaces(ranks, soup, shape)
    return ranks.reshape(shape)
