"""Which bodies touch: boxes that overlap in plan and in height, found around each vehicle with separating axes."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from simbev_ros.types import BoolArray, Float64Array, Int64Array


@dataclass(frozen=True, slots=True)
class Boxes:
    """The boxes of G bodies that follow points; the origin is the middle of a box's bottom.

    Attributes:
        size_m: (G, 3) length, width, height.
        vehicles: Number of vehicles; they come first, people after them.
    """

    size_m: Float64Array
    vehicles: int

    def touching(self, position_m: Float64Array, yaw_rad: Float64Array) -> Int64Array:
        """(K, 2) pairs of bodies, ascending, whose boxes overlap at (G, 3) positions and (G,) headings.

        At least one of a pair is a vehicle: people who brush past each other are none of our business.
        """
        if not self.vehicles:
            return np.zeros((0, 2), np.int64)
        radius_m = np.hypot(self.size_m[:, 0], self.size_m[:, 1]) / 2.0
        tree = cKDTree(position_m[:, :2])
        centers_m = position_m[: self.vehicles, :2]
        near = tree.query_ball_point(centers_m, radius_m[: self.vehicles] + radius_m.max(), return_sorted=False)
        counts = np.array([len(each) for each in near])
        others = np.concatenate(near).astype(np.int64)
        pairs = np.column_stack([np.repeat(np.arange(self.vehicles), counts), others])
        pairs = pairs[pairs[:, 0] < pairs[:, 1]]
        gap_m = position_m[pairs[:, 1]] - position_m[pairs[:, 0]]
        reach_m = radius_m[pairs].sum(axis=1)
        low, high = -self.size_m[pairs[:, 1], 2], self.size_m[pairs[:, 0], 2]
        near_enough = (np.hypot(gap_m[:, 0], gap_m[:, 1]) < reach_m) & (low < gap_m[:, 2]) & (gap_m[:, 2] < high)
        pairs = pairs[near_enough]
        pairs = pairs[self.overlap(pairs, position_m[pairs], yaw_rad[pairs])]
        ordered: Int64Array = pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]
        return ordered

    def overlap(self, pairs: Int64Array, position_m: Float64Array, yaw_rad: Float64Array) -> BoolArray:
        """(K,) whether (K, 2) pairs overlap in plan at their (K, 2, 3) positions and (K, 2) headings."""
        half_m = self.size_m[pairs][..., :2] / 2.0
        ahead = np.stack([np.cos(yaw_rad), np.sin(yaw_rad)], axis=-1)
        axes = np.stack([ahead, np.stack([-ahead[..., 1], ahead[..., 0]], axis=-1)], axis=2)  # pair, body, side, xy
        normals = axes.reshape(len(pairs), 4, 2)
        gap_m = np.abs(np.einsum("kax,kx->ka", normals, position_m[:, 1, :2] - position_m[:, 0, :2]))
        shadow = np.abs(np.einsum("kax,kbsx->kabs", normals, axes))
        reach_m = np.einsum("kabs,kbs->ka", shadow, half_m)
        apart: BoolArray = np.any(gap_m >= reach_m, axis=1)
        return ~apart
