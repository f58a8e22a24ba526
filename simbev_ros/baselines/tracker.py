"""Tracks the boxes of a detector over time: greedy matching of the nearest, with one Kalman filter per track.

``Tracker`` takes the boxes of one frame after another and gives each the id of its track. It imports no ROS and draws
nothing at random. Sources: Weng et al., 3D Multi-Object Tracking, IROS 2020 (filter with a constant velocity); Yin et
al., Center-based 3D Object Detection and Tracking, CVPR 2021 (greedy matching of centers by class); Zhang et al.,
ByteTrack, ECCV 2022 (boxes of low scores continue tracks, but start none).
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from simbev_ros.evaluation.metrics.boxes import NO_TRACK
from simbev_ros.foundation.semantics import BOX_CLASSES
from simbev_ros.foundation.tables import load_table
from simbev_ros.foundation.types import BoolArray, Float64Array, Int64Array, Table
from simbev_ros.reference_stack.kalman import correct, predict

_SIGMA_M, _SIGMA_MPS = 0.3, 1.5
"""Standard deviations of detected positions and velocities, along each axis."""
_MAX_SIGMA_M = 2.0
"""Uncertainty of a position by which a gate is widened at most."""
_MIN_SCORE = 0.05
"""Boxes with a lower score do not continue tracks."""
_PATIENCE_S = 1.5
"""Time for which an object that is not found keeps its track."""
_SETTINGS = ("gate_m", "acceleration_mps2", "birth_score", "sure_score")
_TRACK_DTYPE = np.dtype(
    [
        ("id", "<i4"),
        ("class", "u1"),
        ("state", "<f8", 4),  # x, y (m), vx, vy (m/s), map frame
        ("covariance", "<f8", (4, 4)),
        ("boxes", "<i4"),  # number of boxes so far
        ("is_sure", "?"),
        ("seen_s", "<f8"),  # stamp of the last box
    ]
)


class TrackedBoxes(NamedTuple):
    """What the tracker knows about the N boxes of a frame.

    Attributes:
        id: (N,) id of the track; ``NO_TRACK``: none.
        velocity_mps: (N, 2) velocity of the track, map frame; of a box without an id, as detected.
    """

    id: Int64Array
    velocity_mps: Float64Array


class Tracker:
    """Tracks the boxes of one scene; an id is never used again, even if time goes back."""

    def __init__(self) -> None:
        self._settings = _settings()
        self._tracks: Table = np.zeros(0, _TRACK_DTYPE)
        self._stamp_s = -np.inf
        self._next_id = 1

    def end_tracks(self) -> None:
        """End all tracks, as at the beginning of another scene."""
        self._tracks = self._tracks[:0]

    def step(self, boxes: Table, stamp_s: float) -> TrackedBoxes:
        """Track the boxes of a frame.

        A track has an id once it has two boxes in a row, or one with a score that is high for its class.

        Args:
            boxes: (N,) with x, y (m, map frame), vx, vy (m/s, NaN: unknown), score and class.
            stamp_s: Stamp of the frame; if it is not later than the last one, all tracks end.
        """
        elapsed_s, self._stamp_s = stamp_s - self._stamp_s, stamp_s
        if not 0 < elapsed_s < np.inf:
            self._tracks, elapsed_s = self._tracks[:0], 0.0
        tracks, measured = self._tracks[stamp_s - self._tracks["seen_s"] <= _PATIENCE_S], _measured(boxes)
        acceleration_mps2 = self._settings["acceleration_mps2"][tracks["class"]]
        tracks["state"], tracks["covariance"] = predict(
            tracks["state"], tracks["covariance"], elapsed_s, acceleration_mps2
        )
        known, seen = self._match(tracks, boxes)
        tracks["state"][known], tracks["covariance"][known] = correct(
            tracks["state"][known], tracks["covariance"][known], measured[seen], _noise(boxes)[seen]
        )
        is_new = boxes["score"] >= self._settings["birth_score"][boxes["class"]]
        is_new[seen] = False
        self._tracks = np.concatenate([tracks, self._born(boxes, measured, np.flatnonzero(is_new))])
        of_box = np.full(len(boxes), -1)
        of_box[seen], of_box[is_new] = known, len(tracks) + np.arange(int(is_new.sum()))
        self._count(of_box, boxes, stamp_s)
        result = self._tracked(of_box, boxes)
        self._tracks = self._tracks[self._tracks["is_sure"] | (self._tracks["seen_s"] == stamp_s)]
        return result

    def _match(self, tracks: Table, boxes: Table) -> tuple[Int64Array, Int64Array]:
        """Indices of the tracks and of their boxes: those with scores that could start a track first, then nearest."""
        offset_m = tracks["state"][:, None, :2] - np.stack([boxes["x"], boxes["y"]], axis=1)
        distance_m = np.hypot(offset_m[..., 0], offset_m[..., 1])
        sigma_m = np.minimum(np.sqrt(tracks["covariance"][:, 0, 0]), _MAX_SIGMA_M)
        gate_m = self._settings["gate_m"][tracks["class"]] + sigma_m
        may_match = (distance_m < gate_m[:, None]) & (tracks["class"][:, None] == boxes["class"])
        track, box = np.nonzero(may_match & (boxes["score"] >= _MIN_SCORE))
        is_weak = boxes["score"][box] < self._settings["birth_score"][boxes["class"][box]]
        order = np.lexsort((distance_m[track, box], is_weak))
        return _greedy(track[order], box[order])

    def _born(self, boxes: Table, measured: Float64Array, chosen: Int64Array) -> Table:
        """New tracks of the chosen boxes, which are not counted yet."""
        born = np.zeros(len(chosen), _TRACK_DTYPE)
        born["id"] = self._next_id + np.arange(len(chosen))
        self._next_id += len(chosen)
        born["class"], born["state"], born["covariance"] = (
            boxes["class"][chosen],
            measured[chosen],
            _noise(boxes)[chosen],
        )
        return born

    def _count(self, of_box: Int64Array, boxes: Table, stamp_s: float) -> None:
        """Count the boxes of the tracks, given the track of each box, -1 if it has none."""
        track, tracks = of_box[of_box >= 0], self._tracks
        found = boxes[of_box >= 0]
        tracks["boxes"][track] += 1
        tracks["seen_s"][track] = stamp_s
        tracks["is_sure"][track] |= found["score"] >= self._settings["sure_score"][found["class"]]
        tracks["is_sure"] |= tracks["boxes"] > 1

    def _tracked(self, of_box: Int64Array, boxes: Table) -> TrackedBoxes:
        known: BoolArray = of_box >= 0
        known[known] = self._tracks["is_sure"][of_box[known]]
        ids = np.full(len(boxes), NO_TRACK, np.int64)
        ids[known] = self._tracks["id"][of_box[known]]
        velocity_mps = np.stack([boxes["vx"], boxes["vy"]], axis=1).astype(np.float64)
        velocity_mps[known] = self._tracks["state"][of_box[known], 2:]
        return TrackedBoxes(ids, velocity_mps)


def _measured(boxes: Table) -> Float64Array:
    """(N, 4) positions and velocities; an unknown velocity is 0."""
    velocity = (np.nan_to_num(boxes[name].astype(np.float64)) for name in ("vx", "vy"))
    return np.stack([boxes["x"], boxes["y"], *velocity], axis=1).astype(np.float64)


def _noise(boxes: Table) -> Float64Array:
    """(N, 4, 4) covariances of measurements; that of an unknown velocity spans the speeds of all road users."""
    sigma = np.full((len(boxes), 4), _SIGMA_M)
    is_known = np.isfinite(boxes["vx"]) & np.isfinite(boxes["vy"])
    sigma[:, 2:] = np.where(is_known, _SIGMA_MPS, 15.0)[:, None]
    return sigma[..., None] ** 2 * np.eye(4)


def _greedy(tracks: Int64Array, boxes: Int64Array) -> tuple[Int64Array, Int64Array]:
    """Of pairs in the order of preference, those whose track and box are both free."""
    chosen, used_tracks, used_boxes = list[int](), set[int](), set[int]()
    for index, (track, box) in enumerate(zip(tracks.tolist(), boxes.tolist(), strict=True)):
        if track not in used_tracks and box not in used_boxes:
            used_tracks.add(track)
            used_boxes.add(box)
            chosen.append(index)
    return tracks[chosen], boxes[chosen]


@lru_cache(maxsize=1)
def _settings() -> Table:
    """(C,) settings by class of ``BOX_CLASSES``; those that are never predicted start no track."""
    settings = np.full(len(BOX_CLASSES), np.inf, [(name, "<f8") for name in _SETTINGS])
    for row in load_table("simbev_ros.baselines", "tracker.yaml"):
        settings[BOX_CLASSES.index(row["class"])] = tuple(row[name] for name in _SETTINGS)
    return settings
