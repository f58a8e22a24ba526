"""Selects the predictions by which single frames are judged.

From each class, only as many of the most confident predictions are taken as the frame has boxes. The share of these
that is correct says how good the answer to the frame is.
"""

import numpy as np

from simbev_ros.foundation.semantics import BOX_CLASSES
from simbev_ros.foundation.types import AnyArray, BoolArray, Int64Array, UInt8Array


def top_predictions(
    frame: Int64Array, label: UInt8Array, rank: Int64Array, outcome: AnyArray, truths: Int64Array
) -> BoolArray:
    """Select as many predictions of each frame and class as it has boxes; hits among them over boxes is R-precision.

    This needs no score threshold, which differs from stack to stack, and false positives displace correct predictions.

    Args:
        frame: (M,) row of ``truths`` that each prediction belongs to.
        label: (M,) class of each prediction.
        rank: (M,) rank of each prediction, 0 the most confident.
        outcome: (M,) 1: hit, 0: miss, -1: neither.
        truths: (F, C) number of ground-truth boxes that count, by frame and class.

    Returns:
        (M,) whether each is selected; one that is neither a hit nor a miss never is.
    """
    counted = np.flatnonzero(outcome >= 0)
    group = frame[counted] * len(BOX_CLASSES) + label[counted]
    order = np.lexsort((rank[counted], group))
    group = group[order]
    group_rank = np.arange(len(group)) - np.searchsorted(group, group)
    chosen = np.zeros(len(outcome), np.bool_)
    chosen[counted[order]] = group_rank < truths.ravel()[group]
    return chosen
