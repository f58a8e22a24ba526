"""Voxel grid around the ego, aligned with the ego's x, y and z: voxel (0, 0, 0) is behind, right and below."""

from dataclasses import dataclass

import numpy as np

from simbev_ros.foundation.types import Float64Array


@dataclass(frozen=True, slots=True)
class VoxelGrid:
    """Grid of cubic voxels; voxel (i, j, k) begins at ``low_m`` + (i, j, k) · ``voxel_m``.

    Attributes:
        low_m: (x, y, z) of the grid's minimum corner, ego frame.
        voxel_m: Edge length of a voxel.
        shape: Number of voxels along x, y and z.
    """

    low_m: tuple[float, float, float]
    voxel_m: float
    shape: tuple[int, int, int]

    @property
    def grid_from_ego(self) -> Float64Array:
        """(4, 4) transform from meters in the ego frame to voxels: voxel (i, j, k) is the unit cube at (i, j, k)."""
        transform = np.diag([1.0, 1.0, 1.0, self.voxel_m]) / self.voxel_m
        transform[:3, 3] = -np.array(self.low_m) / self.voxel_m
        return transform

    @property
    def corners_ego(self) -> Float64Array:
        """(8, 3) corners of the whole grid, meters, ego frame."""
        steps = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])
        return np.array(self.low_m) + steps * self.voxel_m * np.array(self.shape)
