"""Detection metrics of nuScenes as nuscenes-devkit 1.2.0 computes them, for comparison with published values.

They differ from the paper's. Distances are in the plane. Precision is sampled at 101 recalls, without the first tenth
and without the part below a precision of 0.1. Errors are cumulative means over recall at a distance of 2 m. A class
without ground truth counts 0, with errors of 1. Attributes count. The caller must remove boxes that are out of range or
without points from ground truth and predictions.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from simbev_ros.evaluation.metrics.averages import mean_ignoring_nan
from simbev_ros.evaluation.metrics.boxes import NO_ATTRIBUTE, Boxes, Predictions, require_frames
from simbev_ros.evaluation.metrics.detection import detection_score
from simbev_ros.evaluation.metrics.errors import angle_between_rad, distance, errors_of
from simbev_ros.evaluation.metrics.matching import match, near_pairs, ranks, sorted_pairs
from simbev_ros.foundation.semantics import BOX_CLASSES
from simbev_ros.foundation.types import BoolArray, Float64Array, Int64Array, UInt8Array
from simbev_ros.schema.nuscenes import detection_ranges_m

CLASSES: tuple[str, ...] = tuple(detection_ranges_m())
"""Classes of the nuScenes detection task; two of them never occur in our scenes."""
ERRORS: tuple[str, ...] = ("mATE", "mAOE", "mASE", "mAVE", "mAAE")
DISTANCES_M: tuple[float, ...] = (0.5, 1.0, 2.0, 4.0)
_ERRORS_AT = DISTANCES_M.index(2.0)
_MIN_PRECISION = 0.1
_FIRST_BIN = 11
"""Index into the 101 recalls: those up to 0.1 do not count."""
_MAP_WEIGHT = 5.0
_NO_FIGURE = {"traffic_cone": ("mAOE", "mAVE", "mAAE"), "barrier": ("mAVE", "mAAE")}


@dataclass(frozen=True, slots=True, eq=False)
class NuscenesTally:
    """Counts of some scenes that the metrics need.

    Attributes:
        truths: (C,) number of ground-truth boxes by class (``BOX_CLASSES``).
        label: (M,) class of each prediction.
        score: (M,) score of each prediction.
        hit: (M, 4) whether the prediction matches, by ``DISTANCES_M``.
        errors: (K, 5) errors of the predictions that match at 2 m, in their order; columns as ``ERRORS``; NaN: unknown.
    """

    truths: Int64Array
    label: UInt8Array
    score: Float64Array
    hit: BoolArray
    errors: Float64Array


@dataclass(frozen=True, slots=True, eq=False)
class NuscenesResult:
    """NuScenes metrics by class, in the order of ``CLASSES`` or of the requested classes.

    Attributes:
        classes: C names of classes.
        truths: (C,) number of ground-truth boxes.
        ap: (C, 4) average precision.
        errors: (C, 5) in the order of ``ERRORS``; NaN: not defined for this class.
    """

    classes: tuple[str, ...]
    truths: Int64Array
    ap: Float64Array
    errors: Float64Array

    @property
    def over_occurring(self) -> "NuscenesResult | None":
        """The metrics over the classes that have ground truth, as the devkit computes them if it knows no others."""
        rows = np.flatnonzero(self.truths)
        if not len(rows):
            return None
        names = tuple(self.classes[row] for row in rows.tolist())
        return NuscenesResult(names, self.truths[rows], self.ap[rows], self.errors[rows])

    @property
    def mean_ap(self) -> float:
        """Mean over all classes and distances."""
        return float(self.ap.mean())

    @property
    def mean_errors(self) -> dict[str, float]:
        """Means over the classes for which each error is defined."""
        return dict(zip(ERRORS, mean_ignoring_nan(self.errors, axis=0).tolist(), strict=True))

    @property
    def nds(self) -> float:
        """NuScenes detection score (NDS)."""
        return detection_score(self.mean_ap, [*self.mean_errors.values()], _MAP_WEIGHT)


def nuscenes_tally(truth: Boxes, predictions: Predictions, frames: Int64Array) -> NuscenesTally:
    """Match the predictions of one scene.

    Args:
        truth: (N,) ground-truth boxes.
        predictions: (M,) predicted boxes and scores, in the same coordinate frame.
        frames: (F,) evaluated frames.

    Raises:
        InputError: A box belongs to another frame.
    """
    require_frames(truth, frames, "truth")
    require_frames(predictions.boxes, frames, "predictions")
    predicted, rank = predictions.boxes, ranks(predictions.score)
    prediction, found = near_pairs(truth, predicted, np.full(len(predicted), max(DISTANCES_M)))
    distance_m = distance(truth.center_m[found], predicted.center_m[prediction], planar=True)
    pairs = sorted_pairs(prediction, found, distance_m)
    matches = [match(pairs.take(pairs.cost < limit_m), rank, len(truth)) for limit_m in DISTANCES_M]
    hits = np.flatnonzero(matches[_ERRORS_AT] >= 0)
    errors = _errors(truth.take(matches[_ERRORS_AT][hits]), predicted.take(hits))
    truths = np.bincount(truth.label, minlength=len(BOX_CLASSES))
    return NuscenesTally(truths, predicted.label, predictions.score, np.stack(matches, axis=1) >= 0, errors)


def nuscenes_merge(tallies: Sequence[NuscenesTally]) -> NuscenesTally:
    """Merge at least one tally into one; of predictions with equal scores, the last ones rank first."""
    return NuscenesTally(
        np.sum([each.truths for each in tallies], axis=0),
        np.concatenate([each.label for each in tallies]),
        np.concatenate([each.score for each in tallies]),
        np.concatenate([each.hit for each in tallies]),
        np.concatenate([each.errors for each in tallies]),
    )


def nuscenes_result(total: NuscenesTally, classes: Sequence[str] = CLASSES) -> NuscenesResult:
    """Compute the metrics of a tally; they are the devkit's if ``classes`` are all of ``CLASSES``."""
    ap, errors = np.zeros((len(classes), len(DISTANCES_M))), np.ones((len(classes), len(ERRORS)))
    counts = np.zeros(len(classes), np.int64)
    row_of_hit = np.cumsum(total.hit[:, _ERRORS_AT]) - 1
    for row, name in enumerate(classes):
        label = BOX_CLASSES.index(name) if name in BOX_CLASSES else None
        if label is not None and total.truths[label]:
            chosen = np.flatnonzero(total.label == label)
            order = chosen[np.argsort(total.score[chosen], kind="stable")][::-1]
            score, hit, truths = total.score[order], total.hit[order], int(total.truths[label])
            counts[row] = truths
            ap[row] = [_average_precision(each, truths) for each in hit.T]
            hit_at = hit[:, _ERRORS_AT]
            errors[row] = _mean_errors(score, hit_at, total.errors[row_of_hit[order[hit_at]]], truths)
        errors[row, [ERRORS.index(error) for error in _NO_FIGURE.get(name, ())]] = np.nan
    return NuscenesResult(tuple(classes), counts, ap, errors)


def _errors(truth: Boxes, predicted: Boxes) -> Float64Array:
    """(K, 5) errors of matched boxes."""
    geometric = errors_of(truth, predicted, planar=True)
    barrier = truth.label == BOX_CLASSES.index("barrier")
    half_turn_rad = angle_between_rad(truth.yaw_rad, predicted.yaw_rad, np.pi)
    geometric[:, 1] = np.where(barrier, half_turn_rad, geometric[:, 1])
    attribute = np.where(truth.attribute == NO_ATTRIBUTE, np.nan, truth.attribute != predicted.attribute)
    return np.column_stack([geometric, attribute])


def _average_precision(hit: BoolArray, truths: int) -> float:
    """Average precision of (M,) predictions of one class, the most confident first."""
    if not hit.any():
        return 0.0
    hits = np.cumsum(hit)
    precision = np.interp(_recalls(), hits / truths, hits / np.arange(1, len(hit) + 1), right=0)
    above = np.maximum(precision[_FIRST_BIN:] - _MIN_PRECISION, 0.0)
    return float(above.mean()) / (1.0 - _MIN_PRECISION)


def _mean_errors(score: Float64Array, hit: BoolArray, errors: Float64Array, truths: int) -> Float64Array:
    """(5,) mean errors of a class, from (M,) predictions, most confident first, and (K, 5) errors of their hits."""
    if not hit.any():
        return np.ones(len(ERRORS))
    confidence = np.interp(_recalls(), np.cumsum(hit) / truths, score, right=0)
    reached = np.flatnonzero(confidence)
    last = reached[-1] if len(reached) else 0
    if last < _FIRST_BIN:
        return np.ones(len(ERRORS))
    curves = [np.interp(confidence[::-1], score[hit][::-1], each[::-1])[::-1] for each in _cumulative_means(errors).T]
    return np.array(curves)[:, _FIRST_BIN : last + 1].mean(axis=1)


def _cumulative_means(errors: Float64Array) -> Float64Array:
    """(K, 5) running means of the known errors: 0 before the first one, 1 where all are unknown."""
    known = ~np.isnan(errors)
    counts = np.cumsum(known, axis=0)
    sums = np.cumsum(np.where(known, errors, 0.0), axis=0)
    means: Float64Array = np.divide(sums, counts, out=np.zeros_like(sums), where=counts > 0)
    means[:, ~known.any(axis=0)] = 1.0
    return means


def _recalls() -> Float64Array:
    return np.linspace(0.0, 1.0, 101)
