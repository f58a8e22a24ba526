"""How well single frames are answered: of as many surest predictions of a class as it has boxes, how many are right."""

import numpy as np

from simbev_ros.semantics import BOX_CLASSES
from simbev_ros.types import AnyArray, BoolArray, Int64Array, UInt8Array


def surest(frame: Int64Array, label: UInt8Array, rank: Int64Array, outcome: AnyArray, truths: Int64Array) -> BoolArray:
    """Choose as many predictions of each frame and class as it has boxes; hits among them over boxes is R-precision.

    It needs no threshold of the score, which differs from stack to stack, and what is predicted in vain takes the
    places of what is right.

    Args:
        frame: (M,) row of ``truths`` that each prediction belongs to.
        label: (M,) class of each.
        rank: (M,) place of each, 0 the surest.
        outcome: (M,) 1 a hit, 0 a miss, -1 neither.
        truths: (F, C) boxes of the truth that count, by frame and class.

    Returns:
        (M,) whether each is chosen; one that is neither a hit nor a miss never is.
    """
    counted = np.flatnonzero(outcome >= 0)
    group = frame[counted] * len(BOX_CLASSES) + label[counted]
    order = np.lexsort((rank[counted], group))
    group = group[order]
    place = np.arange(len(group)) - np.searchsorted(group, group)
    chosen = np.zeros(len(outcome), np.bool_)
    chosen[counted[order]] = place < truths.ravel()[group]
    return chosen
