"""Computes precision-recall curves and the area under them.

Both are computed from the scores and outcomes of the matched predictions of one class.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from simbev_ros.foundation.types import AnyArray, Float64Array

Area = Literal["steps", "envelope"]
"""How the area under the curve is computed.

``steps``: each recall counts at the precision at which it is reached. ``envelope``: at the maximum precision of this or
any higher recall, as in Pascal VOC since 2010.
"""


@dataclass(frozen=True, slots=True, eq=False)
class Curve:
    """Precision and recall of all predictions with at least a certain score, for each score.

    Attributes:
        score: (K,) limits, descending, without duplicates.
        precision: (K,) hits divided by predictions.
        recall: (K,) hits divided by ground-truth boxes; NaN if there are none.
    """

    score: Float64Array
    precision: Float64Array
    recall: Float64Array


def curve(score: Float64Array, outcome: AnyArray, truths: int) -> Curve:
    """Precision-recall curve of (M,) predictions; predictions with equal scores form one point.

    Args:
        score: (M,) scores, descending.
        outcome: (M,) 1: hit, 0: miss, -1: neither.
        truths: Number of ground-truth boxes.
    """
    score, hit = score[outcome >= 0], outcome[outcome >= 0] > 0
    last = np.flatnonzero(np.append(score[1:] != score[:-1], True)[: len(score)])
    hits = np.cumsum(hit)[last]
    recall = hits / truths if truths else np.full(len(last), np.nan)
    return Curve(score[last], hits / (last + 1), recall)


def average_precision(class_curve: Curve, area: Area = "steps") -> float:
    """Area under a precision-recall curve, 0 … 1; 0 without predictions."""
    precision = class_curve.precision
    if area == "envelope":
        precision = np.maximum.accumulate(precision[::-1])[::-1]
    return float((np.diff(class_curve.recall, prepend=0.0) * precision).sum())
