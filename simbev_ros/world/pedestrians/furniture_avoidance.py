"""People walk around what stands on sidewalks: SUMO's know of no trees and poles.

Each obstacle pushes people's places away from the road, by a bump along their way that rises and falls smoothly, so
that two places beside each other stay beside each other and nobody jumps.
"""

import numpy as np
from scipy.spatial import cKDTree

from simbev_ros.types import Float64Array, Table

_BODY_M = 0.3  # half of a person's width, and some air
_APPROACH_M = 1.2  # before and behind an obstacle's sides, where the way bends
_KERB_M = 0.6  # people further towards the road than this go on undisturbed: they are about to cross it
_FADE_M = 0.6
_NEAREST = 5  # obstacles that one place is pushed by at most
_LEVEL_M = 2.0


class Furniture:
    """What stands in people's way."""

    def __init__(self, obstacles: Table) -> None:
        """Takes (K,) ``assets.street.obstacles.OBSTACLE_DTYPE``."""
        self._place_m = np.column_stack([obstacles["x"], obstacles["y"], obstacles["z"]])
        self._away = np.column_stack([obstacles["away_x"], obstacles["away_y"]])
        self._clear_m = obstacles["radius"] + _BODY_M
        self._reach_m = float(self._clear_m.max(initial=0.0)) + _APPROACH_M
        self._tree = cKDTree(self._place_m[:, :2])

    def aside(self, pedestrian_m: Float64Array) -> Float64Array:
        """(P, 3) places of people who want to be at (P, 3), map frame."""
        if not len(self._place_m) or not len(pedestrian_m):
            return pedestrian_m
        _, nearest = self._tree.query(pedestrian_m[:, :2], _NEAREST, distance_upper_bound=self._reach_m + _KERB_M)
        person, rank = np.nonzero(nearest < len(self._place_m))
        obstacle = nearest[person, rank]
        gap_m = pedestrian_m[person] - self._place_m[obstacle]
        away, clear_m = self._away[obstacle], self._clear_m[obstacle]
        aside_m = np.sum(gap_m[:, :2] * away, axis=1)
        along_m = np.abs(gap_m[:, 0] * away[:, 1] - gap_m[:, 1] * away[:, 0])
        weight = _smooth((clear_m + _APPROACH_M - along_m) / _APPROACH_M) * (np.abs(gap_m[:, 2]) < _LEVEL_M)
        push_m = weight * _smooth((aside_m + _KERB_M + _FADE_M) / _FADE_M) * np.maximum(clear_m - aside_m, 0.0)
        strongest_m = np.zeros(len(pedestrian_m))
        np.maximum.at(strongest_m, person, push_m)
        place_m = pedestrian_m.copy()
        wins = np.flatnonzero((push_m > 0.0) & (push_m == strongest_m[person]))
        place_m[person[wins], :2] += push_m[wins, None] * away[wins]
        return place_m


def _smooth(share: Float64Array) -> Float64Array:
    """From 0 to 1 over the same, without kinks."""
    share = np.clip(share, 0.0, 1.0)
    smooth: Float64Array = share * share * (3.0 - 2.0 * share)
    return smooth
