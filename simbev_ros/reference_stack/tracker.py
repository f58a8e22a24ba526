"""Tracks objects over time: each cluster is assigned to the nearest track or starts a new one."""

import numpy as np
from scipy.optimize import linear_sum_assignment

from simbev_ros.reference_stack.arrays import Booleans, Floats, Integers, Table
from simbev_ros.reference_stack.classes import Kinds
from simbev_ros.reference_stack.kalman import predict
from simbev_ros.reference_stack.readings import Readings
from simbev_ros.reference_stack.tracks import distances_m, track_dtype, update

_ACCELERATION_MPS2 = 3.0
_FIRST_SIGMA = np.array([1.0, 1.0, 6.0, 6.0])
"""Standard deviations of a new object's position, m, and velocity, m/s."""
_GATE_M, _CENTER_WEIGHT = 0.6, 0.3
_MAX_SIGMA_M = 1.0
_FAR = 1e6
_MAX_COST = 12.0
"""Maximum cost of a cluster's best kind for starting a track."""
_PATIENCE, _NEW_PATIENCE, _ESTABLISHED = 10, 2, 4
"""Consecutive readings that an established and a new object may miss, and readings after which it is established."""
_MAX_GAP_S = 1.0


class Tracker:
    """Tracks all objects around the ego.

    Attributes:
        tracks: (T,) tracks, ``tracks.track_dtype``.
    """

    def __init__(self, kinds: Kinds) -> None:
        self._kinds = kinds
        self._stamp_s = -np.inf
        self._next_id = 1
        self.tracks: Table = np.zeros(0, track_dtype(kinds))

    def step(self, readings: Readings, stamp_s: float, ego_yaw_rad: float) -> Table:
        """Update the tracks with the readings at a stamp; return the tracks seen in them.

        Args:
            readings: Readings of all clusters, map frame.
            stamp_s: Stamp, s; after a gap or a step back in time tracking starts over.
            ego_yaw_rad: Assumed heading of objects that have not moved yet, up to a quarter turn.
        """
        step_s, self._stamp_s = stamp_s - self._stamp_s, stamp_s
        if not 0 < step_s < _MAX_GAP_S:
            self.tracks = self.tracks[:0]
            step_s = 0.0
        tracks = self.tracks
        tracks["state"], tracks["covariance"] = predict(
            tracks["state"], tracks["covariance"], step_s, _ACCELERATION_MPS2
        )
        tracks["misses"] += 1
        known, seen, is_new = self._assign(readings)
        tracks[known] = update(tracks[known], readings, seen, self._kinds)
        new_tracks = update(
            self._new_tracks(int(is_new.sum()), ego_yaw_rad), readings, np.flatnonzero(is_new), self._kinds
        )
        patience = np.where(tracks["readings"] < _ESTABLISHED, _NEW_PATIENCE, _PATIENCE)
        self.tracks = np.concatenate([tracks[tracks["misses"] < patience], new_tracks])
        seen_now: Table = self.tracks[self.tracks["misses"] == 0]
        return seen_now

    def _assign(self, readings: Readings) -> tuple[Integers, Integers, Booleans]:
        """Assign clusters to tracks: indices of tracks and of their clusters, and (C,) which clusters are new."""
        outside_m, center_distance_m = distances_m(self.tracks, readings.center_m)
        sigma_m = np.minimum(np.sqrt(self.tracks["covariance"][:, 0, 0]), _MAX_SIGMA_M)
        in_gate = outside_m < _GATE_M + sigma_m[:, None]
        cost = np.where(in_gate, outside_m + _CENTER_WEIGHT * center_distance_m, _FAR)
        known, seen = linear_sum_assignment(cost)
        matched = cost[known, seen] < _FAR
        known, seen = known[matched], seen[matched]
        is_new: Booleans = readings.cost.min(axis=(1, 2), initial=np.inf) < _MAX_COST
        is_new[seen] = False
        is_new &= ~(outside_m == 0).any(axis=0)  # otherwise another part of a tracked object
        return known, seen, is_new

    def _new_tracks(self, count: int, yaw_rad: float) -> Table:
        """(count,) new tracks without any reading."""
        tracks = np.zeros(count, self.tracks.dtype)
        tracks["id"] = self._next_id + np.arange(count)
        tracks["covariance"], tracks["yaw"] = np.diag(_FIRST_SIGMA**2), yaw_rad
        self._next_id += count
        return tracks


def scores(tracks: Table, kinds: Kinds) -> Floats:
    """(T,) probabilities that the objects exist: odds from size, points, age and, above all, motion."""
    fit = np.exp(-tracks["cost"].min(axis=1, initial=np.inf) / 4)
    density = 1.0 - np.exp(-tracks["points"] / 8)
    age = np.minimum(tracks["readings"] / 5, 1.0)
    relative_path = np.clip(tracks["moved_m"] / np.maximum(tracks["size_m"][:, 0], 2.0), 0.0, 1.0)
    motion = relative_path * np.clip(np.hypot(*tracks["state"][:, 2:].T), 0.2, 1.0)
    odds = fit * density * age * (1.0 + 20.0 * motion**2) / kinds.clutter[tracks["kind"]]
    score: Floats = odds / (1.0 + odds)
    return score
