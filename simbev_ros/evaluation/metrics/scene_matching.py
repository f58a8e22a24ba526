"""Matches one scene's predictions with its ground truth, by 3D IoU and by center distance.

``Matching`` matches the boxes once. It then gives a ``DetectionTally`` for any number of tables, each with its own
selection of boxes that count.
"""

from dataclasses import dataclass

import numpy as np

from simbev_ros.evaluation.metrics.boxes import Boxes, Predictions, require_frames
from simbev_ros.evaluation.metrics.detection import (
    HIT,
    MISS,
    UNCOUNTED,
    DetectionOptions,
    DetectionTally,
    Method,
)
from simbev_ros.evaluation.metrics.errors import ERRORS, distance, errors_of
from simbev_ros.evaluation.metrics.matching import Pairs, match, near_pairs, ranks, sorted_pairs
from simbev_ros.evaluation.metrics.overlap import iou_of_pairs
from simbev_ros.foundation.semantics import BOX_CLASSES
from simbev_ros.foundation.types import AnyArray, BoolArray, Float64Array, Int64Array


@dataclass(frozen=True, slots=True, eq=False)
class CountedBoxes:
    """Selection of the boxes that count, by which tables are sliced.

    Attributes:
        truth: (N,) whether a ground-truth box must be found; finding one of the others is neither right nor wrong.
        predictions: (M,) whether a prediction that matches no box is wrong; otherwise it does not count.
    """

    truth: BoolArray
    predictions: BoolArray


class Matching:
    """Match of the predictions of a scene, or of some of its frames, with the ground truth.

    Args:
        truth: (N,) ground-truth boxes.
        predictions: (M,) predicted boxes and scores, in the same coordinate frame.
        frames: (F,) evaluated frames; one without predictions counts as missed.
        options: Settings of the metrics; None: those of the paper.

    Attributes:
        rank: (M,) rank of each prediction, 0 the most confident.
        found: (T, M) index of the ground-truth box that each prediction matches, by threshold; -1: none.

    Raises:
        InputError: A box belongs to another frame.
    """

    def __init__(
        self, truth: Boxes, predictions: Predictions, frames: Int64Array, options: DetectionOptions | None = None
    ) -> None:
        require_frames(truth, frames, "truth")
        require_frames(predictions.boxes, frames, "predictions")
        self.truth, self.predictions, self.options = truth, predictions, options or DetectionOptions()
        self.rank = ranks(predictions.score)
        pairs, thresholds = _pairs(truth, predictions.boxes, self.options), self.options.thresholds
        self.found = np.full((len(thresholds), len(predictions)), -1)
        self._errors: list[Float64Array] = []
        for row, (method, limit) in enumerate(thresholds):
            near = pairs[method].take(pairs[method].cost < (-limit if method == "iou" else limit))
            self.found[row] = match(near, self.rank, len(truth))
            hits = np.flatnonzero(self.found[row] >= 0)
            hit_boxes = truth.take(self.found[row, hits]), predictions.boxes.take(hits)
            self._errors.append(errors_of(*hit_boxes, self.options.planar))

    def tally(self, counting: CountedBoxes | None = None) -> DetectionTally:
        """Tally of the scene at every threshold; predictions that count nowhere are left out.

        Args:
            counting: Boxes that count; None: all.
        """
        label = self.predictions.boxes.label
        sums = np.zeros((len(BOX_CLASSES), len(self.found), len(ERRORS)))
        counts = np.zeros(sums.shape, np.int64)
        outcome = self.outcome(counting)
        for row, errors in enumerate(self._errors):
            hits = outcome[self.found[row] >= 0, row] == HIT
            labels = label[outcome[:, row] == HIT]
            known = ~np.isnan(errors[hits])
            np.add.at(sums[:, row], labels, np.where(known, errors[hits], 0.0))
            np.add.at(counts[:, row], labels, known)
        counted = self.truth.label if counting is None else self.truth.label[counting.truth]
        kept = (outcome != UNCOUNTED).any(axis=1)
        truths = np.bincount(counted, minlength=len(BOX_CLASSES))
        return DetectionTally(truths, label[kept], self.predictions.score[kept], outcome[kept], sums, counts)

    def outcome(self, counting: CountedBoxes | None = None) -> AnyArray:
        """(M, T) int8 outcome of each prediction at each threshold: ``HIT``, ``MISS`` or ``UNCOUNTED``.

        A prediction is uncounted if its box does not count, or if it matches no box and does not count itself.

        Args:
            counting: Boxes that count; None: all.
        """
        found = self.found.T
        if counting is None:
            return np.where(found >= 0, HIT, MISS).astype(np.int8)
        hit_outcome = np.where(np.append(counting.truth, False)[found], HIT, UNCOUNTED)
        miss_outcome = np.where(counting.predictions, MISS, UNCOUNTED)[:, None]
        return np.where(found >= 0, hit_outcome, miss_outcome).astype(np.int8)


def _pairs(truth: Boxes, predicted: Boxes, options: DetectionOptions) -> dict[Method, Pairs]:
    """Pairs that match at the most lenient threshold of each method."""
    max_distance_m = max(options.distances_m, default=0.0)
    prediction, found = near_pairs(truth, predicted, np.full(len(predicted), max_distance_m))
    distance_m = distance(truth.center_m[found], predicted.center_m[prediction], options.planar)
    near = distance_m < max_distance_m
    by_distance = sorted_pairs(prediction[near], found[near], distance_m[near])
    min_iou = min(options.ious, default=1.0)
    half_m, predicted_half_m = (np.hypot(each.size_m[:, 0], each.size_m[:, 1]) / 2 for each in (truth, predicted))
    prediction, found = near_pairs(truth, predicted, predicted_half_m + half_m.max(initial=0.0))
    # Rotation and distance only reduce the overlap, so sizes and heights alone rule out most pairs.
    near = (
        distance(truth.center_m[found], predicted.center_m[prediction], True)
        <= half_m[found] + predicted_half_m[prediction]
    )
    prediction, found = prediction[near], found[near]
    volume_m3, predicted_m3 = truth.size_m[found].prod(axis=1), predicted.size_m[prediction].prod(axis=1)
    near = np.minimum(volume_m3, predicted_m3) > min_iou * np.maximum(volume_m3, predicted_m3)
    prediction, found = prediction[near], found[near]
    iou = iou_of_pairs(truth, predicted, found, prediction)
    near = iou > min_iou
    by_iou = sorted_pairs(prediction[near], found[near], -iou[near])
    return {"iou": by_iou, "distance": by_distance}
