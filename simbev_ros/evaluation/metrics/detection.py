"""The detection metrics of the paper: AP by 3D IoU and by center distance, mAP, ATE, AOE, ASE, AVE, SDS.

``scene_matching`` reduces the predictions of each scene to a tally of scores and outcomes. ``merge_tallies`` joins the
tallies of many scenes, from any process, in the order given. ``detection_result`` computes the metrics. A tally takes
about 20 bytes per prediction.

Points that the paper leaves open are defined here:
    * A match lies above an IoU or below a distance, never at it. Predictions are matched in order of falling
      confidence, each with the best box of its class and frame that is still free.
    * A class without ground truth has no metrics (NaN) and is in no mean; one with ground truth but no predictions
      has AP 0.
    * Without matches, errors are 1, from which value on SDS does not distinguish. Unknown velocities are ignored.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from simbev_ros.config.evaluation import DISTANCES_M, IOUS
from simbev_ros.evaluation.metrics.averages import mean_ignoring_nan
from simbev_ros.evaluation.metrics.curves import Area, Curve, average_precision, curve
from simbev_ros.evaluation.metrics.errors import ERRORS
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.types import AnyArray, Float64Array, Int64Array, UInt8Array

Method = Literal["iou", "distance"]
HIT, MISS, UNCOUNTED = 1, 0, -1
_MAX_ERROR = 1.0
_MAP_WEIGHT = 4.0


@dataclass(frozen=True, slots=True)
class DetectionOptions:
    """Settings of the detection metrics; the defaults are those of the paper.

    Attributes:
        ious: Thresholds for matching by 3D IoU.
        distances_m: Thresholds for matching by distance between centers.
        planar: Whether distances and velocities ignore z.
        area: How the area under the precision-recall curve is computed.
    """

    ious: tuple[float, ...] = IOUS
    distances_m: tuple[float, ...] = DISTANCES_M
    planar: bool = False
    area: Area = "steps"

    def __post_init__(self) -> None:
        """Raise InputError if there is no threshold."""
        if not self.thresholds:
            raise InputError("thresholds: there is none, neither of 3D IoU nor of distance; at least one is needed")

    @property
    def thresholds(self) -> tuple[tuple[Method, float], ...]:
        """Method and threshold of each column of a tally."""
        return (*(("iou", each) for each in self.ious), *(("distance", each) for each in self.distances_m))


@dataclass(frozen=True, slots=True, eq=False)
class DetectionTally:
    """Counts of some scenes that the metrics need.

    Attributes:
        truths: (C,) number of ground-truth boxes that count, by class (``BOX_CLASSES``).
        label: (M,) class of each prediction.
        score: (M,) score of each prediction.
        outcome: (M, T) int8, by threshold: ``HIT``, ``MISS``, or ``UNCOUNTED`` if it found a box that does not count.
        error_sums: (C, T, 4) sums of the known errors of hits.
        error_counts: (C, T, 4) numbers of known errors.
    """

    truths: Int64Array
    label: UInt8Array
    score: Float64Array
    outcome: AnyArray
    error_sums: Float64Array
    error_counts: Int64Array


@dataclass(frozen=True, slots=True, eq=False)
class DetectionResult:
    """Detection metrics by class and threshold, and their means.

    Attributes:
        options: Settings of the metrics.
        truths: (C,) numbers of ground-truth boxes.
        ap: (C, T) average precision; NaN: no ground truth.
        errors: (C, T, 4) mean errors of hits in the order of ``ERRORS``; NaN: no ground truth.
    """

    options: DetectionOptions
    truths: Int64Array
    ap: Float64Array
    errors: Float64Array

    def columns(self, method: Method) -> Int64Array:
        """Indices of the thresholds of a matching method."""
        return np.flatnonzero([each == method for each, _ in self.options.thresholds])

    def mean_ap(self, method: Method) -> float:
        """Mean AP (mAP) over classes and thresholds; NaN: no ground truth at all."""
        return float(mean_ignoring_nan(self.ap[:, self.columns(method)]))

    def mean_errors(self, method: Method) -> dict[str, float]:
        """Means of ATE, AOE, ASE and AVE over classes and thresholds; NaN: no ground truth at all."""
        chosen = self.errors[:, self.columns(method)]
        return {name: float(mean_ignoring_nan(chosen[..., index])) for index, name in enumerate(ERRORS)}

    def sds(self, method: Method) -> float:
        """SimBEV detection score (SDS), 0 … 1; NaN: no ground truth at all."""
        return detection_score(self.mean_ap(method), [*self.mean_errors(method).values()])


def detection_score(mean_ap: float, errors: Sequence[float], ap_weight: float = _MAP_WEIGHT) -> float:
    """Weighted mean of mAP and of 1 - error for each error, where errors above 1 count as 1."""
    kept = sum(1.0 - min(1.0, error) for error in errors)
    return (ap_weight * mean_ap + kept) / (ap_weight + len(errors))


def merge_tallies(tallies: Sequence[DetectionTally]) -> DetectionTally:
    """Merge at least one tally into one."""
    return DetectionTally(
        np.sum([each.truths for each in tallies], axis=0),
        np.concatenate([each.label for each in tallies]),
        np.concatenate([each.score for each in tallies]),
        np.concatenate([each.outcome for each in tallies]),
        np.sum([each.error_sums for each in tallies], axis=0),
        np.sum([each.error_counts for each in tallies], axis=0),
    )


def detection_result(total: DetectionTally, options: DetectionOptions | None = None) -> DetectionResult:
    """Compute the metrics of a tally.

    Args:
        total: The tally.
        options: The options with which the tally was made; None: those of the paper.
    """
    options = options or DetectionOptions()
    ap = np.full(total.error_sums.shape[:2], np.nan)
    for label in np.flatnonzero(total.truths):
        chosen = total.label == label
        score, outcome = total.score[chosen], total.outcome[chosen]
        order = np.argsort(-score, kind="stable")
        for column in range(outcome.shape[1]):
            class_curve = curve(score[order], outcome[order, column], int(total.truths[label]))
            ap[label, column] = average_precision(class_curve, options.area)
    worst = np.full(total.error_sums.shape, _MAX_ERROR)
    errors = np.divide(total.error_sums, total.error_counts, out=worst, where=total.error_counts > 0)
    errors[total.truths == 0] = np.nan
    return DetectionResult(options, total.truths, ap, errors)


def precision_recall(total: DetectionTally, label: int, column: int) -> Curve:
    """Precision-recall curve of a class (of ``BOX_CLASSES``) at a threshold (of ``DetectionOptions.thresholds``)."""
    chosen = np.flatnonzero(total.label == label)
    order = chosen[np.argsort(-total.score[chosen], kind="stable")]
    return curve(total.score[order], total.outcome[order, column], int(total.truths[label]))
