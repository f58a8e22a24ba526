"""Matches predictions with ground-truth boxes greedily, in order of falling confidence.

``near_pairs`` finds candidate pairs of boxes, and ``match`` selects from them the box that each prediction is matched
with.
"""

from dataclasses import dataclass

import numpy as np

from simbev_ros.evaluation.metrics.boxes import Boxes
from simbev_ros.foundation.geometry.ragged import ragged_indices
from simbev_ros.foundation.semantics import BOX_CLASSES
from simbev_ros.foundation.types import BoolArray, Float64Array, Int64Array

_ROUNDING_M = 1e-4


@dataclass(frozen=True, slots=True, eq=False)
class Pairs:
    """Candidate pairs of a prediction and a ground-truth box, ordered by prediction, then by cost.

    Attributes:
        prediction: (K,) index of the prediction.
        truth: (K,) index of the ground-truth box.
        cost: (K,) lower is better; among equal costs the lower ground-truth index comes first.
    """

    prediction: Int64Array
    truth: Int64Array
    cost: Float64Array

    def take(self, chosen: BoolArray) -> "Pairs":
        """Pairs selected by a mask."""
        return Pairs(self.prediction[chosen], self.truth[chosen], self.cost[chosen])


def sorted_pairs(prediction: Int64Array, truth: Int64Array, cost: Float64Array) -> Pairs:
    """Pairs in the order that ``Pairs`` requires."""
    order = np.lexsort((truth, cost, prediction))
    return Pairs(prediction[order], truth[order], cost[order])


def near_pairs(truth: Boxes, predictions: Boxes, max_distance_m: Float64Array) -> tuple[Int64Array, Int64Array]:
    """All pairs of one frame and class with centers within a distance along x.

    Args:
        truth: (N,) ground-truth boxes.
        predictions: (M,) predicted boxes.
        max_distance_m: (M,) maximum distance for each prediction.

    Returns:
        (K,) index of the prediction and (K,) index of the ground-truth box.
    """
    none = np.zeros(0, np.int64)
    if not len(truth) or not len(predictions):
        return none, none
    frames, frame = np.unique(truth.frame, return_inverse=True)
    predicted_frame = np.minimum(np.searchsorted(frames, predictions.frame), len(frames) - 1)
    known = frames[predicted_frame] == predictions.frame
    group, predicted_group = (
        index * len(BOX_CLASSES) + boxes.label for index, boxes in ((frame, truth), (predicted_frame, predictions))
    )
    # Groups lie side by side on one axis, and the search range of a prediction ends within its own group.
    start_m = truth.center_m[:, 0].min()
    extent_m = truth.center_m[:, 0].max() - start_m
    position_m = group * (extent_m + 4.0) + truth.center_m[:, 0] - start_m
    order = np.argsort(position_m, kind="stable")
    predicted_m = predictions.center_m[:, 0] - start_m
    low_m, high_m = (
        np.clip(predicted_m + sign * (max_distance_m + _ROUNDING_M), -1.0, extent_m + 1.0) for sign in (-1, 1)
    )
    group_m = predicted_group * (extent_m + 4.0)
    first = np.searchsorted(position_m[order], group_m + low_m)
    counts = np.where(known, np.searchsorted(position_m[order], group_m + high_m) - first, 0)
    prediction, offset = ragged_indices(counts)
    return prediction, order[first[prediction] + offset]


def ranks(score: Float64Array) -> Int64Array:
    """(M,) rank of each prediction, 0 the most confident.

    Among equal scores the last prediction comes first, as in nuscenes-devkit.
    """
    result = np.empty(len(score), np.int64)
    result[np.argsort(score, kind="stable")[::-1]] = np.arange(len(score))
    return result


def match(pairs: Pairs, rank: Int64Array, truths: int) -> Int64Array:
    """Match each prediction, the most confident first, with the best of its pairs whose ground-truth box is still free.

    All predictions are processed at once instead of one after the other: each asks for its best box, each box keeps the
    most confident prediction that ever asked, and the others ask for their next best. All boxes have the same
    preference, so the outcome is the same.

    Args:
        pairs: All pairs that may match.
        rank: (M,) rank of each prediction, all different; 0 chooses first.
        truths: Number of ground-truth boxes.

    Returns:
        (M,) index of the ground-truth box, -1: none was left.
    """
    bounds = np.searchsorted(pairs.prediction, np.arange(len(rank) + 1))
    cursor, end = bounds[:-1].copy(), bounds[1:]
    best_rank = np.full(truths, len(rank))
    active = np.flatnonzero(cursor < end)
    while len(active):
        target = pairs.truth[cursor[active]]
        np.minimum.at(best_rank, target, rank[active])
        rejected = active[best_rank[target] != rank[active]]
        if not len(rejected):
            break
        cursor[rejected] += 1
        active = active[cursor[active] < end[active]]
    result = np.full(len(rank), -1)
    result[active] = pairs.truth[cursor[active]]
    return result
