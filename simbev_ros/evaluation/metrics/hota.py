"""Higher Order Tracking Accuracy (HOTA), as TrackEval 1.3.0 computes it.

Source: Luiten et al., HOTA: A Higher Order Metric for Evaluating Multi-Object Tracking, IJCV 2020. The similarity of
two boxes is 1 − d / 2 m, where d is the distance of their centers in the plane: TrackEval's Euclidean similarity. All
metrics are means over the 19 similarities from 0.05 to 0.95 above which boxes match.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from simbev_ros.evaluation.metrics.clear_mot import frames_of
from simbev_ros.evaluation.metrics.tracks import MATCH_DISTANCE_M, ClassTracks, assigned
from simbev_ros.foundation.types import AnyArray, Float64Array, Int64Array

_SIMILARITIES = np.arange(0.05, 0.99, 0.05)
_EPSILON = np.finfo(np.float64).eps


@dataclass(frozen=True, slots=True)
class Hota:
    """Metrics of one class, 0 … 1.

    Attributes:
        hota: Mean of the geometric means of detection and association accuracy.
        det_a: Detection accuracy: matches over matches, misses and false positives.
        ass_a: Association accuracy: of the boxes of the object and the track of a match, the share in common.
        ass_pr: The share in common of the boxes of the track.
        ass_re: The share in common of the boxes of the object.
    """

    hota: float
    det_a: float
    ass_a: float
    ass_pr: float
    ass_re: float


def hota(scenes: Sequence[ClassTracks]) -> Hota:
    """Metrics of one class over all scenes."""
    sums = np.sum([_scene_sums(each) for each in scenes], axis=0)
    truths, predictions = (sum(len(getattr(each, name)) for each in scenes) for name in ("object", "track"))
    matches, accuracy, precision, recall = sums
    det_a = matches / np.maximum(1, truths + predictions - matches)
    ass_a, ass_pr, ass_re = (each / np.maximum(1, matches) for each in (accuracy, precision, recall))
    values = np.sqrt(det_a * ass_a), det_a, ass_a, ass_pr, ass_re
    return Hota(*(float(each.mean()) for each in values))


def _scene_sums(tracks: ClassTracks) -> Float64Array:
    """(4, 19) sums over the matches of a scene: 1, association accuracy, precision and recall."""
    objects, names = tracks.object[tracks.truth], tracks.pair_track
    similarity = 1.0 - tracks.distance_m / MATCH_DISTANCE_M
    of_object, of_track = np.bincount(tracks.object), np.bincount(tracks.track, minlength=len(tracks.score))
    common, link = np.unique(objects * max(len(tracks.score), 1) + names, return_inverse=True)
    first = np.zeros(len(common), np.int64)
    first[link] = np.arange(len(link))
    of_object, of_track = of_object[objects[first]], of_track[names[first]]
    potential = np.bincount(link, _shares(tracks, similarity), minlength=len(common))
    alignment = potential / (of_object + of_track - potential)
    chosen = _assign(tracks, alignment[link] * similarity)
    sums = np.zeros((4, len(_SIMILARITIES)))
    for column, limit in enumerate(_SIMILARITIES):
        linked = link[chosen[similarity[chosen] >= limit - _EPSILON]]
        count = np.bincount(linked, minlength=len(common))
        denominators = of_object + of_track - count, of_track, of_object
        sums[0, column] = count.sum()
        sums[1:, column] = [(count * count / np.maximum(1, each)).sum() for each in denominators]
    return sums


def _shares(tracks: ClassTracks, similarity: Float64Array) -> Float64Array:
    """(K,) similarity of each pair over that of all pairs of its two boxes."""
    box = _boxes_of(tracks)
    total = np.bincount(tracks.truth, similarity)[tracks.truth] + np.bincount(box, similarity)[box] - similarity
    shares: Float64Array = np.divide(similarity, total, out=np.zeros_like(similarity), where=total > _EPSILON)
    return shares


def _boxes_of(tracks: ClassTracks) -> Int64Array:
    """(K,) number of the predicted box of each pair: its frame and track."""
    frame, track = tracks.frame[tracks.truth], tracks.pair_track
    _, box = np.unique(np.stack([frame, track], axis=1), axis=0, return_inverse=True)
    return box.ravel()


def _assign(tracks: ClassTracks, value: Float64Array) -> Int64Array:
    """Indices of pairs with the highest sum of values in each frame, each box at most once."""
    box = _boxes_of(tracks)
    is_alone = (np.bincount(tracks.truth)[tracks.truth] == 1) & (np.bincount(box)[box] == 1)
    chosen = [np.flatnonzero(is_alone)]
    for pairs in frames_of(tracks):
        contested = np.array(pairs)[~is_alone[pairs.start : pairs.stop]]
        if len(contested):
            chosen.append(contested[_best(tracks.truth[contested], box[contested], value[contested])])
    return np.concatenate(chosen)


def _best(truth: Int64Array, box: Int64Array, value: Float64Array) -> AnyArray:
    """Indices of the pairs of one frame with the highest sum of values."""
    rows, row = np.unique(truth, return_inverse=True)
    columns, column = np.unique(box, return_inverse=True)
    table, index = np.zeros((len(rows), len(columns))), np.full((len(rows), len(columns)), -1)
    table[row, column], index[row, column] = value, np.arange(len(value))
    best = index[assigned(table, maximize=True)]
    return best[best >= 0]
