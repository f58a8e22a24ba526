"""Which prediction finds which box of the truth: the surest first, each the best that is still free."""

from dataclasses import dataclass

import numpy as np

from simbev_ros.evaluation.metrics.boxes import Boxes
from simbev_ros.semantics import BOX_CLASSES
from simbev_ros.types import BoolArray, Float64Array, Int64Array

_ROUNDING_M = 1e-4


@dataclass(frozen=True, slots=True, eq=False)
class Pairs:
    """Pairs of a prediction and a box of the truth that might match, in order of the prediction, then of cost.

    Attributes:
        prediction: (K,) index.
        truth: (K,) index.
        cost: (K,) the lower, the better; of those that cost the same, the first of the truth comes first.
    """

    prediction: Int64Array
    truth: Int64Array
    cost: Float64Array

    def take(self, chosen: BoolArray) -> "Pairs":
        """Those of a mask."""
        return Pairs(self.prediction[chosen], self.truth[chosen], self.cost[chosen])


def sorted_pairs(prediction: Int64Array, truth: Int64Array, cost: Float64Array) -> Pairs:
    """Pairs in their order."""
    order = np.lexsort((truth, cost, prediction))
    return Pairs(prediction[order], truth[order], cost[order])


def near_pairs(truth: Boxes, predictions: Boxes, reach_m: Float64Array) -> tuple[Int64Array, Int64Array]:
    """All pairs of one frame and class whose centres are no farther apart along x than a reach.

    Args:
        truth: (N,) boxes.
        predictions: (M,) boxes.
        reach_m: (M,) of each prediction.

    Returns:
        (K,) index of the prediction and (K,) of the truth.
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
    # Groups lie side by side on one axis, and what a prediction reaches ends within its own.
    start_m = truth.center_m[:, 0].min()
    extent_m = truth.center_m[:, 0].max() - start_m
    place_m = group * (extent_m + 4.0) + truth.center_m[:, 0] - start_m
    order = np.argsort(place_m, kind="stable")
    predicted_m = predictions.center_m[:, 0] - start_m
    low_m, high_m = (np.clip(predicted_m + sign * (reach_m + _ROUNDING_M), -1.0, extent_m + 1.0) for sign in (-1, 1))
    group_m = predicted_group * (extent_m + 4.0)
    first = np.searchsorted(place_m[order], group_m + low_m)
    counts = np.where(known, np.searchsorted(place_m[order], group_m + high_m) - first, 0)
    prediction = np.repeat(np.arange(len(predictions)), counts)
    within = np.arange(len(prediction)) - np.repeat(np.cumsum(counts) - counts, counts)
    return prediction, order[first[prediction] + within]


def ranks(score: Float64Array) -> Int64Array:
    """(M,) place of each prediction, 0 the surest; of equal ones the last comes first, as in nuscenes-devkit."""
    result = np.empty(len(score), np.int64)
    result[np.argsort(score, kind="stable")[::-1]] = np.arange(len(score))
    return result


def match(pairs: Pairs, rank: Int64Array, truths: int) -> Int64Array:
    """Let each prediction, the surest first, take the best of its pairs whose truth is still free.

    All at once instead of one by one: each asks for its best, the truth keeps the surest that ever asked, the others
    go on to their next best. As all boxes of the truth prefer alike, the outcome is the same.

    Args:
        pairs: All that may match.
        rank: (M,) place of each prediction, all different; 0 takes first.
        truths: Number of boxes of the truth.

    Returns:
        (M,) index of the truth, -1: none was left.
    """
    bounds = np.searchsorted(pairs.prediction, np.arange(len(rank) + 1))
    at, end = bounds[:-1].copy(), bounds[1:]
    keeper = np.full(truths, len(rank))
    asking = np.flatnonzero(at < end)
    while len(asking):
        wanted = pairs.truth[at[asking]]
        np.minimum.at(keeper, wanted, rank[asking])
        refused = asking[keeper[wanted] != rank[asking]]
        if not len(refused):
            break
        at[refused] += 1
        asking = asking[at[asking] < end[asking]]
    result = np.full(len(rank), -1)
    result[asking] = pairs.truth[at[asking]]
    return result
