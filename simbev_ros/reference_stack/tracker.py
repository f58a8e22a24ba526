"""Objects over time: each cluster goes to the object that it is nearest to, or begins a new one."""

import numpy as np
from scipy.optimize import linear_sum_assignment

from simbev_ros.reference_stack.arrays import Booleans, Floats, Integers, Table
from simbev_ros.reference_stack.classes import Kinds
from simbev_ros.reference_stack.kalman import predict
from simbev_ros.reference_stack.readings import Readings
from simbev_ros.reference_stack.tracks import distances_m, track_dtype, update

_ACCELERATION_MPS2 = 3.0
_FIRST_SIGMA = np.array([1.0, 1.0, 6.0, 6.0])
"""Of a new object's place, m, and velocity, m/s."""
_GATE_M, _CENTER_WEIGHT = 0.6, 0.3
_LARGEST_SIGMA_M = 1.0
_FAR = 1e6
_MOST_COST = 12.0
"""What fits no kind better begins no track."""
_PATIENCE, _FIRST_PATIENCE, _SETTLED = 10, 2, 4
"""Readings in a row that an object may miss, old or young, and how many make it old."""
_LONGEST_GAP_S = 1.0


class Tracker:
    """All objects around.

    Attributes:
        tracks: (T,) ``tracks.track_dtype``.
    """

    def __init__(self, kinds: Kinds) -> None:
        self._kinds = kinds
        self._stamp_s = -np.inf
        self._next_id = 1
        self.tracks: Table = np.zeros(0, track_dtype(kinds))

    def step(self, readings: Readings, stamp_s: float, ego_yaw_rad: float) -> Table:
        """Take what is seen at a stamp, map frame; give the tracks that are in it.

        Args:
            readings: Of all clusters.
            stamp_s: Later than the last; after a gap or a leap back in time all begins anew.
            ego_yaw_rad: Taken for the heading of what has not moved yet, up to a quarter turn.
        """
        step_s, self._stamp_s = stamp_s - self._stamp_s, stamp_s
        if not 0 < step_s < _LONGEST_GAP_S:
            self.tracks = self.tracks[:0]
            step_s = 0.0
        tracks = self.tracks
        tracks["state"], tracks["covariance"] = predict(
            tracks["state"], tracks["covariance"], step_s, _ACCELERATION_MPS2
        )
        tracks["misses"] += 1
        known, seen, is_new = self._assign(readings)
        tracks[known] = update(tracks[known], readings, seen, self._kinds)
        begun = update(self._begun(int(is_new.sum()), ego_yaw_rad), readings, np.flatnonzero(is_new), self._kinds)
        patience = np.where(tracks["readings"] < _SETTLED, _FIRST_PATIENCE, _PATIENCE)
        self.tracks = np.concatenate([tracks[tracks["misses"] < patience], begun])
        seen_now: Table = self.tracks[self.tracks["misses"] == 0]
        return seen_now

    def _assign(self, readings: Readings) -> tuple[Integers, Integers, Booleans]:
        """Tracks and the clusters that are theirs, and (C,) which clusters are something new."""
        outside_m, apart_m = distances_m(self.tracks, readings.center_m)
        sigma_m = np.minimum(np.sqrt(self.tracks["covariance"][:, 0, 0]), _LARGEST_SIGMA_M)
        in_gate = outside_m < _GATE_M + sigma_m[:, None]
        cost = np.where(in_gate, outside_m + _CENTER_WEIGHT * apart_m, _FAR)
        known, seen = linear_sum_assignment(cost)
        matched = cost[known, seen] < _FAR
        known, seen = known[matched], seen[matched]
        is_new: Booleans = readings.cost.min(axis=(1, 2), initial=np.inf) < _MOST_COST
        is_new[seen] = False
        is_new &= ~(outside_m == 0).any(axis=0)  # another part of a known object
        return known, seen, is_new

    def _begun(self, count: int, yaw_rad: float) -> Table:
        """(count,) tracks of which nothing is known yet."""
        tracks = np.zeros(count, self.tracks.dtype)
        tracks["id"] = self._next_id + np.arange(count)
        tracks["covariance"], tracks["yaw"] = np.diag(_FIRST_SIGMA**2), yaw_rad
        self._next_id += count
        return tracks


def scores(tracks: Table, kinds: Kinds) -> Floats:
    """(T,) how probable such an object is: odds by its size, its points, its age, and above all whether it moves."""
    fit = np.exp(-tracks["cost"].min(axis=1, initial=np.inf) / 4)
    dense = 1.0 - np.exp(-tracks["points"] / 8)
    age = np.minimum(tracks["readings"] / 5, 1.0)
    way = np.clip(tracks["moved_m"] / np.maximum(tracks["size_m"][:, 0], 2.0), 0.0, 1.0)
    moves = way * np.clip(np.hypot(*tracks["state"][:, 2:].T), 0.2, 1.0)
    odds = fit * dense * age * (1.0 + 20.0 * moves**2) / kinds.clutter[tracks["kind"]]
    score: Floats = odds / (1.0 + odds)
    return score
