"""Tracked boxes of a scene, and the pairs of objects and tracks that may match: the input of the tracking metrics.

``scene_tracks`` reduces a scene, or some of its frames, to the boxes that count. ``class_tracks`` gives those of one
class with consecutive numbers of objects and tracks.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from simbev_ros.evaluation.metrics.boxes import NO_TRACK, Boxes, Predictions
from simbev_ros.evaluation.metrics.errors import distance
from simbev_ros.evaluation.metrics.matching import match, near_pairs, ranks, sorted_pairs
from simbev_ros.evaluation.metrics.scene_matching import CountedBoxes
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.semantics import BOX_CLASSES
from simbev_ros.foundation.types import Float64Array, Int64Array, Table

MATCH_DISTANCE_M = 2.0
"""Centers of a match are nearer in the plane: the distance of the nuScenes tracking task."""
_TRUTH_DTYPE = np.dtype([("frame", "<i8"), ("label", "u1"), ("track", "<i8")])
_PREDICTION_DTYPE = np.dtype([*_TRUTH_DTYPE.descr, ("score", "<f8")])
_PAIR_DTYPE = np.dtype([("truth", "<i8"), ("prediction", "<i8"), ("distance_m", "<f8")])


@dataclass(frozen=True, slots=True, eq=False)
class SceneTracks:
    """Tracked boxes of one scene that count.

    Attributes:
        truth: (N,) frame, label and object of each ground-truth box.
        predictions: (M,) frame, label, track and score of each prediction that has a track.
        pairs: (K,) indices of ground-truth box and prediction of the same frame and class, and distance of the centers
            in the plane, below ``MATCH_DISTANCE_M``.
    """

    truth: Table
    predictions: Table
    pairs: Table


@dataclass(frozen=True, slots=True, eq=False)
class ClassTracks:
    """The tracks of one class in a scene, with O objects and T tracks.

    Attributes:
        object: (N,) object of each ground-truth box, in the order of the frames.
        frame: (N,) its frame.
        track: (M,) track of each prediction.
        score: (T,) mean score of each track.
        truth: (K,) index of the ground-truth box of each pair, ascending.
        pair_track: (K,) track of each pair.
        distance_m: (K,) distance of the centers of each pair.
    """

    object: Int64Array
    frame: Int64Array
    track: Int64Array
    score: Float64Array
    truth: Int64Array
    pair_track: Int64Array
    distance_m: Float64Array

    def above(self, min_score: float) -> "ClassTracks":
        """The same without pairs and predictions of tracks with lower scores; tracks keep their numbers."""
        pairs = self.score[self.pair_track] >= min_score
        return ClassTracks(
            self.object,
            self.frame,
            self.track[self.score[self.track] >= min_score],
            self.score,
            self.truth[pairs],
            self.pair_track[pairs],
            self.distance_m[pairs],
        )


def scene_tracks(truth: Boxes, predictions: Predictions, counting: CountedBoxes) -> SceneTracks:
    """Tracked boxes that count, of a scene or of some of its frames.

    As for detection, a prediction is left out if the ground-truth box that it finds does not count, or if it finds none
    and does not count itself; the most confident prediction of a frame and class chooses first.

    Args:
        truth: (N,) ground-truth boxes.
        predictions: (M,) predictions in the same coordinate frame; those without a track are ignored.
        counting: Boxes that count.

    Raises:
        InputError: Two predictions of a frame and class have the same track.
    """
    is_tracked = predictions.boxes.track != NO_TRACK
    predictions = predictions.take(is_tracked)
    predicted, may_be_wrong = predictions.boxes, counting.predictions[is_tracked]
    _require_distinct(predicted)
    prediction, found = near_pairs(truth, predicted, np.full(len(predicted), MATCH_DISTANCE_M))
    distance_m = distance(truth.center_m[found], predicted.center_m[prediction], planar=True)
    near = distance_m < MATCH_DISTANCE_M
    pairs = sorted_pairs(prediction[near], found[near], distance_m[near])
    best = match(pairs, ranks(predictions.score), len(truth))
    kept = np.where(best >= 0, np.append(counting.truth, False)[best], may_be_wrong)
    table = np.zeros(len(predicted), _PREDICTION_DTYPE)
    for name in ("frame", "label", "track"):
        table[name] = getattr(predicted, name)
    table["score"] = predictions.score
    objects = np.zeros(len(truth), _TRUTH_DTYPE)
    for name in ("frame", "label", "track"):
        objects[name] = getattr(truth, name)
    chosen = counting.truth[pairs.truth] & kept[pairs.prediction]
    joined = np.zeros(int(chosen.sum()), _PAIR_DTYPE)
    joined["truth"] = (np.cumsum(counting.truth) - 1)[pairs.truth[chosen]]
    joined["prediction"] = (np.cumsum(kept) - 1)[pairs.prediction[chosen]]
    joined["distance_m"] = pairs.cost[chosen]
    return SceneTracks(objects[counting.truth], table[kept], joined)


def join_tracks(parts: Sequence[SceneTracks]) -> SceneTracks:
    """The tracks of at least one part of a scene as one."""
    pairs, truths, predictions = [], 0, 0
    for each in parts:
        pairs.append(each.pairs.copy())
        pairs[-1]["truth"] += truths
        pairs[-1]["prediction"] += predictions
        truths, predictions = truths + len(each.truth), predictions + len(each.predictions)
    return SceneTracks(
        np.concatenate([each.truth for each in parts]),
        np.concatenate([each.predictions for each in parts]),
        np.concatenate(pairs),
    )


def class_tracks(tracks: SceneTracks, label: int) -> ClassTracks:
    """The tracks of one class, an index into ``BOX_CLASSES``."""
    truth, predictions = np.flatnonzero(tracks.truth["label"] == label), tracks.predictions["label"] == label
    truth = truth[np.argsort(tracks.truth["frame"][truth], kind="stable")]
    row = np.full(len(tracks.truth), -1)
    row[truth] = np.arange(len(truth))
    _, objects = np.unique(tracks.truth["track"][truth], return_inverse=True)
    ids, track = np.unique(tracks.predictions["track"][predictions], return_inverse=True)
    count, total = np.bincount(track, minlength=len(ids)), np.bincount(track, tracks.predictions["score"][predictions])
    pairs = tracks.pairs[tracks.truth["label"][tracks.pairs["truth"]] == label]
    pairs = pairs[np.lexsort((pairs["prediction"], row[pairs["truth"]]))]
    return ClassTracks(
        object=objects,
        frame=tracks.truth["frame"][truth],
        track=track,
        score=total / count,
        truth=row[pairs["truth"]],
        pair_track=np.searchsorted(ids, tracks.predictions["track"][pairs["prediction"]]),
        distance_m=pairs["distance_m"],
    )


def assigned(values: Float64Array, *, maximize: bool = False) -> tuple[Int64Array, Int64Array]:
    """Rows and columns of a matrix, each at most once, with the least or the largest sum of values.

    Raises:
        ModuleNotFoundError: SciPy is not installed, which only tracks need.
    """
    from scipy.optimize import linear_sum_assignment

    row, column = linear_sum_assignment(values, maximize=maximize)
    return row, column


def _require_distinct(boxes: Boxes) -> None:
    rows = np.stack([boxes.frame, boxes.label.astype(np.int64), boxes.track], axis=1)
    distinct, count = np.unique(rows, axis=0, return_counts=True)
    if len(distinct) < len(rows):
        frame, label, track = distinct[np.argmax(count)].tolist()
        raise InputError(f"id: {count.max()} boxes of class {BOX_CLASSES[label]} in frame {frame} have the id {track}")
