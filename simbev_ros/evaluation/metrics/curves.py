"""Precision over recall, and the area under it."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from simbev_ros.types import AnyArray, Float64Array

Area = Literal["steps", "envelope"]
"""``steps``: each recall at the precision with which it is reached. ``envelope``: at the best precision of this or any
higher recall, as in Pascal VOC since 2010."""


@dataclass(frozen=True, slots=True, eq=False)
class Curve:
    """Precision and recall if all predictions of at least a score are taken.

    Attributes:
        score: (K,) falling, each once.
        precision: (K,) hits over predictions.
        recall: (K,) hits over truth, NaN without truth.
    """

    score: Float64Array
    precision: Float64Array
    recall: Float64Array


def curve(score: Float64Array, outcome: AnyArray, truths: int) -> Curve:
    """The curve of (M,) predictions in order of falling score; predictions of one score are taken together.

    Args:
        score: (M,) falling.
        outcome: (M,) 1 a hit, 0 a miss, -1 neither.
        truths: Number of boxes of the truth.
    """
    score, hit = score[outcome >= 0], outcome[outcome >= 0] > 0
    last = np.flatnonzero(np.append(score[1:] != score[:-1], True)[: len(score)])
    hits = np.cumsum(hit)[last]
    recall = hits / truths if truths else np.full(len(last), np.nan)
    return Curve(score[last], hits / (last + 1), recall)


def average_precision(of_class: Curve, area: Area = "steps") -> float:
    """Area under the curve, 0 … 1; 0 without predictions."""
    precision = of_class.precision
    if area == "envelope":
        precision = np.maximum.accumulate(precision[::-1])[::-1]
    return float((np.diff(of_class.recall, prepend=0.0) * precision).sum())
