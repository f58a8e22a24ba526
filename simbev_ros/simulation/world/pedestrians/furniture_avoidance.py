"""Pedestrians walk around street furniture: SUMO's pedestrians do not know about trees and poles.

Each obstacle pushes the pedestrians' positions away from the road by a smooth bump along their path, so that
pedestrians side by side stay side by side and nobody jumps.
"""

import numpy as np
from scipy.spatial import cKDTree

from simbev_ros.foundation.types import Float64Array, Table

_BODY_CLEARANCE_M = 0.3  # half of a pedestrian's width, plus some clearance
_APPROACH_M = 1.2  # length before and behind an obstacle over which the path bends
_CROSSING_M = 0.6  # pedestrians closer to the road are not pushed: they are about to cross it
_FADE_M = 0.6
_MAX_OBSTACLES = 5  # maximum number of obstacles that push one pedestrian
_LEVEL_TOLERANCE_M = 2.0


class FurnitureAvoidance:
    """Street furniture that pedestrians walk around."""

    def __init__(self, obstacles: Table) -> None:
        """From (K,) ``assets.street.obstacles.OBSTACLE_DTYPE``."""
        self._position_m = np.column_stack([obstacles["x"], obstacles["y"], obstacles["z"]])
        self._outward = np.column_stack([obstacles["away_x"], obstacles["away_y"]])
        self._clear_m = obstacles["radius"] + _BODY_CLEARANCE_M
        self._reach_m = float(self._clear_m.max(initial=0.0)) + _APPROACH_M
        self._tree = cKDTree(self._position_m[:, :2])

    def move_aside(self, pedestrian_m: Float64Array) -> Float64Array:
        """(P, 3) positions of pedestrians beside the obstacles, from their desired (P, 3) positions, map frame."""
        if not len(self._position_m) or not len(pedestrian_m):
            return pedestrian_m
        _, nearest = self._tree.query(
            pedestrian_m[:, :2], _MAX_OBSTACLES, distance_upper_bound=self._reach_m + _CROSSING_M
        )
        pedestrian, rank = np.nonzero(nearest < len(self._position_m))
        obstacle = nearest[pedestrian, rank]
        gap_m = pedestrian_m[pedestrian] - self._position_m[obstacle]
        outward, clear_m = self._outward[obstacle], self._clear_m[obstacle]
        outward_m = np.sum(gap_m[:, :2] * outward, axis=1)
        along_m = np.abs(gap_m[:, 0] * outward[:, 1] - gap_m[:, 1] * outward[:, 0])
        weight = _smoothstep((clear_m + _APPROACH_M - along_m) / _APPROACH_M) * (
            np.abs(gap_m[:, 2]) < _LEVEL_TOLERANCE_M
        )
        push_m = (
            weight * _smoothstep((outward_m + _CROSSING_M + _FADE_M) / _FADE_M) * np.maximum(clear_m - outward_m, 0.0)
        )
        max_push_m = np.zeros(len(pedestrian_m))
        np.maximum.at(max_push_m, pedestrian, push_m)
        position_m = pedestrian_m.copy()
        is_strongest = np.flatnonzero((push_m > 0.0) & (push_m == max_push_m[pedestrian]))
        position_m[pedestrian[is_strongest], :2] += push_m[is_strongest, None] * outward[is_strongest]
        return position_m


def _smoothstep(fraction: Float64Array) -> Float64Array:
    """Map 0..1 to 0..1 without kinks at the ends."""
    fraction = np.clip(fraction, 0.0, 1.0)
    return fraction * fraction * (3.0 - 2.0 * fraction)
