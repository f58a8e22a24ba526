"""The paper's detection metrics: AP by 3D IoU and by centre distance, mAP, ATE, AOE, ASE, AVE, SDS.

Scene by scene, ``scene_matching`` reduces predictions to scores and outcomes; ``merge`` joins the tallies of many
scenes, made anywhere, in the order given; ``detection_result`` makes the table. A tally holds about 20 bytes per
prediction.

What the paper leaves open is defined here:
    * A match is above an IoU, or below a distance, never at it. The surest prediction takes the best box of its class
      and frame that is still free.
    * A class without truth has no figures (NaN) and is in no mean, but one with truth and no prediction has AP 0.
    * Where nothing matches, errors are 1, from where on SDS sees no difference. Unknown velocities are left out.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from simbev_ros.errors import InputError
from simbev_ros.evaluation.metrics.averages import known_mean
from simbev_ros.evaluation.metrics.curves import Area, Curve, average_precision, curve
from simbev_ros.evaluation.metrics.errors import ERRORS
from simbev_ros.types import AnyArray, Float64Array, Int64Array, UInt8Array

Method = Literal["iou", "distance"]
HIT, MISS, UNCOUNTED = 1, 0, -1
_WORST_ERROR = 1.0
_MAP_WEIGHT = 4.0


@dataclass(frozen=True, slots=True)
class DetectionOptions:
    """How detections are measured; the defaults are the paper's.

    Attributes:
        ious: Thresholds of matching by 3D IoU.
        distances_m: Thresholds of matching by distance of the centres.
        planar: Whether distances and velocities leave out z.
        area: How the area under precision over recall is taken.
    """

    ious: tuple[float, ...] = (0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)
    distances_m: tuple[float, ...] = (0.5, 1.0, 2.0, 4.0)
    planar: bool = False
    area: Area = "steps"

    def __post_init__(self) -> None:
        """Raise InputError if nothing could match."""
        if not self.thresholds:
            raise InputError("thresholds: there is none, neither of 3D IoU nor of distance; at least one is needed")

    @property
    def thresholds(self) -> tuple[tuple[Method, float], ...]:
        """All columns of a tally, in their order."""
        return (*(("iou", each) for each in self.ious), *(("distance", each) for each in self.distances_m))


@dataclass(frozen=True, slots=True, eq=False)
class DetectionTally:
    """What the metrics need of some scenes.

    Attributes:
        truths: (C,) boxes of the truth that count, by class (``BOX_CLASSES``).
        label: (M,) class of each prediction.
        score: (M,) its score.
        outcome: (M, T) int8, by threshold: ``HIT``, ``MISS``, or ``UNCOUNTED``: it found a box that does not count.
        error_sums: (C, T, 4) sums of known errors of hits.
        error_counts: (C, T, 4) how many they were.
    """

    truths: Int64Array
    label: UInt8Array
    score: Float64Array
    outcome: AnyArray
    error_sums: Float64Array
    error_counts: Int64Array


@dataclass(frozen=True, slots=True, eq=False)
class DetectionResult:
    """The table.

    Attributes:
        options: How it was measured.
        truths: (C,) boxes of the truth.
        ap: (C, T) average precision by class and threshold; NaN: no truth.
        errors: (C, T, 4) mean errors of hits in the order of ``ERRORS``; NaN: no truth.
    """

    options: DetectionOptions
    truths: Int64Array
    ap: Float64Array
    errors: Float64Array

    def columns(self, method: Method) -> Int64Array:
        """Indices of the thresholds of a method."""
        return np.flatnonzero([each == method for each, _ in self.options.thresholds])

    def mean_ap(self, method: Method) -> float:
        """MAP over classes and thresholds; NaN: no truth at all."""
        return float(known_mean(self.ap[:, self.columns(method)]))

    def mean_errors(self, method: Method) -> dict[str, float]:
        """ATE, AOE, ASE and AVE, each the mean over classes and thresholds; NaN: no truth at all."""
        chosen = self.errors[:, self.columns(method)]
        return {name: float(known_mean(chosen[..., index])) for index, name in enumerate(ERRORS)}

    def sds(self, method: Method) -> float:
        """SimBEV detection score, 0 … 1; NaN: no truth at all."""
        return detection_score(self.mean_ap(method), [*self.mean_errors(method).values()])


def detection_score(mean_ap: float, errors: Sequence[float], ap_weight: float = _MAP_WEIGHT) -> float:
    """Weighted mean of mAP and of what the errors leave of 1."""
    kept = sum(1.0 - min(1.0, error) for error in errors)
    return (ap_weight * mean_ap + kept) / (ap_weight + len(errors))


def merge(tallies: Sequence[DetectionTally]) -> DetectionTally:
    """All of at least one tally together."""
    return DetectionTally(
        np.sum([each.truths for each in tallies], axis=0),
        np.concatenate([each.label for each in tallies]),
        np.concatenate([each.score for each in tallies]),
        np.concatenate([each.outcome for each in tallies]),
        np.sum([each.error_sums for each in tallies], axis=0),
        np.sum([each.error_counts for each in tallies], axis=0),
    )


def detection_result(total: DetectionTally, options: DetectionOptions | None = None) -> DetectionResult:
    """The table of a tally; ``options`` as it was made with, None: as the paper."""
    options = options or DetectionOptions()
    ap = np.full(total.error_sums.shape[:2], np.nan)
    for label in np.flatnonzero(total.truths):
        chosen = total.label == label
        score, outcome = total.score[chosen], total.outcome[chosen]
        order = np.argsort(-score, kind="stable")
        for column in range(outcome.shape[1]):
            of_class = curve(score[order], outcome[order, column], int(total.truths[label]))
            ap[label, column] = average_precision(of_class, options.area)
    worst = np.full(total.error_sums.shape, _WORST_ERROR)
    errors = np.divide(total.error_sums, total.error_counts, out=worst, where=total.error_counts > 0)
    errors[total.truths == 0] = np.nan
    return DetectionResult(options, total.truths, ap, errors)


def precision_recall(total: DetectionTally, label: int, column: int) -> Curve:
    """Precision over recall of a class (of ``BOX_CLASSES``) at a threshold (of ``DetectionOptions.thresholds``)."""
    chosen = np.flatnonzero(total.label == label)
    order = chosen[np.argsort(-total.score[chosen], kind="stable")]
    return curve(total.score[order], total.outcome[order, column], int(total.truths[label]))
