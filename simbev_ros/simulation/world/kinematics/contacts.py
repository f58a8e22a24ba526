"""Contacts between bodies: boxes that overlap in plan and in height, found with separating axes around each vehicle."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from simbev_ros.foundation.geometry.footprints import footprints_overlap
from simbev_ros.foundation.types import BoolArray, Float64Array, Int64Array


@dataclass(frozen=True)
class BodyBoxes:
    """Boxes of G bodies that follow points; the origin is the center of a box's bottom face.

    Attributes:
        size_m: (G, 3) length, width, height.
        vehicles: Number of vehicles; they come first, pedestrians after them.
    """

    size_m: Float64Array
    vehicles: int

    @cached_property
    def _radius_m(self) -> Float64Array:
        """(G,) radii of circles around the boxes in plan."""
        return np.hypot(self.size_m[:, 0], self.size_m[:, 1]) / 2.0

    def near_pairs(self, position_m: Float64Array, slack_m: float) -> Int64Array:
        """(K, 2) pairs of bodies that may touch at (G, 3) positions, or if their distance changes by ``slack_m``.

        The first body of each pair is a vehicle with the lower index; contacts between pedestrians are ignored.
        """
        if not self.vehicles:
            return np.zeros((0, 2), np.int64)
        reach_m = self._radius_m[: self.vehicles] + self._radius_m.max() + slack_m
        found = cKDTree(position_m[:, :2]).query_ball_point(
            position_m[: self.vehicles, :2], reach_m, return_sorted=False
        )
        vehicle = np.repeat(np.arange(self.vehicles), [len(each) for each in found])
        pairs = np.column_stack([vehicle, np.concatenate(found).astype(np.int64)])
        return pairs[pairs[:, 0] < pairs[:, 1]]

    def touching_pairs(
        self, position_m: Float64Array, yaw_rad: Float64Array, pairs: Int64Array | None = None
    ) -> Int64Array:
        """(K, 2) pairs of bodies, ascending, whose boxes overlap at (G, 3) positions and (G,) headings.

        Only some ``pairs`` are examined if given, as from ``near_pairs``.
        """
        pairs = self.near_pairs(position_m, 0.0) if pairs is None else pairs
        gap_m = position_m[pairs[:, 1]] - position_m[pairs[:, 0]]
        reach_m = self._radius_m[pairs].sum(axis=1)
        min_gap_m, max_gap_m = -self.size_m[pairs[:, 1], 2], self.size_m[pairs[:, 0], 2]
        is_near = (np.hypot(gap_m[:, 0], gap_m[:, 1]) < reach_m) & (min_gap_m < gap_m[:, 2]) & (gap_m[:, 2] < max_gap_m)
        pairs = pairs[is_near]
        pairs = pairs[self.overlap(pairs, position_m[pairs], yaw_rad[pairs])]
        return pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]

    def overlap(self, pairs: Int64Array, position_m: Float64Array, yaw_rad: Float64Array) -> BoolArray:
        """(K,) whether (K, 2) pairs overlap in plan at their (K, 2, 3) positions and (K, 2) headings."""
        return footprints_overlap(position_m, yaw_rad, self.size_m[pairs])
