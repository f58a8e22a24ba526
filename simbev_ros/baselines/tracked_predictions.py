"""Tracks predictions of whole scenes, as the live stack does frame by frame."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from simbev_ros.baselines.tracker import Tracker
from simbev_ros.evaluation.metrics.boxes import Predictions

_DTYPE = np.dtype(
    [("x", "<f8"), ("y", "<f8"), ("vx", "<f8"), ("vy", "<f8"), ("score", "<f8"), ("class", "u1"), ("frame", "<i8")]
)


def track_predictions(predictions: Predictions, stamps_s: Mapping[int, float]) -> Predictions:
    """The predictions of a scene with ids and the velocities of their tracks.

    Args:
        predictions: Boxes in the map frame.
        stamps_s: Stamp of each frame of the scene, those without boxes too, in their order.
    """
    own, tracker = predictions.boxes, Tracker()
    table = np.zeros(len(own), _DTYPE)
    table["x"], table["y"] = own.center_m[:, :2].T
    table["vx"], table["vy"] = own.velocity_mps[:, :2].T
    table["score"], table["class"], table["frame"] = predictions.score, own.label, own.frame
    track, velocity_mps = own.track.copy(), own.velocity_mps.copy()
    for frame, stamp_s in stamps_s.items():
        rows = np.flatnonzero(own.frame == frame)
        track[rows], velocity_mps[rows, :2] = tracker.step(table[rows], stamp_s)
    return Predictions(replace(own, track=track, velocity_mps=velocity_mps), predictions.score)
