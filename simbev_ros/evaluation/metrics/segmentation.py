"""The paper's bird's-eye-view segmentation metric: IoU of each class at several score thresholds.

Labels and scores of the cells of a frame are reduced to counts, which can be added over frames.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.semantics import BEV_CLASSES
from simbev_ros.foundation.types import AnyArray, Float64Array, Int64Array, UInt8Array

THRESHOLDS: tuple[float, ...] = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)
TABLE_THRESHOLD = 0.5
"""Threshold of the paper's table."""
_FULL = 255.0


@dataclass(frozen=True, slots=True, eq=False)
class SegmentationTally:
    """Counts of cells in some frames; the memory does not grow with their number.

    Attributes:
        frames: Number of frames.
        both: (C, T) number of cells that are of a class and predicted at a threshold.
        predicted: (C, T) number of cells that are predicted at a threshold.
        truth: (C,) number of cells that are of a class.
    """

    frames: int
    both: Int64Array
    predicted: Int64Array
    truth: Int64Array

    def __add__(self, other: "SegmentationTally") -> "SegmentationTally":
        return SegmentationTally(
            self.frames + other.frames,
            self.both + other.both,
            self.predicted + other.predicted,
            self.truth + other.truth,
        )

    def iou(self) -> Float64Array:
        """(C, T) cells in both over cells in either; NaN: no cell is of the class."""
        either = self.truth[:, None] + self.predicted - self.both
        has_truth = np.broadcast_to(self.truth[:, None] > 0, either.shape)
        return np.divide(self.both, either, out=np.full(either.shape, np.nan), where=has_truth)


def empty_tally(classes: int = len(BEV_CLASSES), thresholds: int = len(THRESHOLDS)) -> SegmentationTally:
    """Tally of no frames, to start a sum with."""
    zeros = np.zeros((classes, thresholds), np.int64)
    return SegmentationTally(0, zeros, zeros, np.zeros(classes, np.int64))


def tallies_by_region(
    labels: AnyArray,
    scores: AnyArray,
    region: UInt8Array,
    regions: int,
    classes: Sequence[str] = BEV_CLASSES,
    thresholds: Sequence[float] = THRESHOLDS,
) -> list[SegmentationTally]:
    """Count the cells of one frame, separately for each region of the grid.

    A cell is predicted where its score is above the threshold.

    Args:
        labels: (H, W) unsigned; bit k of a cell is class k of ``BEV_CLASSES``.
        scores: (C, H, W) of ``classes``: floating, 0 … 1, or uint8, where 255 is 1.
        region: (H, W) index of the region that each cell belongs to.
        regions: Number of regions.
        classes: Predicted classes, out of ``BEV_CLASSES``.
        thresholds: Score thresholds above 0, ascending.

    Raises:
        InputError: Shape, type or a score is not as above.
    """
    _check(labels, scores, classes)
    reached, levels = _count_reached(scores, thresholds), len(thresholds) + 1
    offset = region.astype(np.intp) * (2 * levels)
    counts = np.empty((regions, len(classes), levels, 2), np.int64)
    for row, name in enumerate(classes):
        has_class = labels >> labels.dtype.type(BEV_CLASSES.index(name)) & labels.dtype.type(1)
        codes = offset + (reached[row] << np.uint8(1) | has_class.astype(np.uint8))
        counts[:, row] = np.bincount(codes.ravel(), minlength=regions * 2 * levels).reshape(regions, levels, 2)
    cumulative = counts[:, :, ::-1].cumsum(axis=2)[:, :, ::-1]
    return [
        SegmentationTally(
            1,
            both=counts_at_least[:, 1:, 1],
            predicted=counts_at_least[:, 1:].sum(axis=2),
            truth=counts_at_least[:, 0, 1],
        )
        for counts_at_least in cumulative
    ]


def _count_reached(scores: AnyArray, thresholds: Sequence[float]) -> UInt8Array:
    """(C, H, W) number of thresholds that each score is above."""
    limits = thresholds_in_dtype(thresholds, scores.dtype)
    if scores.dtype == np.uint8:
        table = np.searchsorted(limits, np.arange(256), side="left").astype(np.uint8)
        return table[scores]
    reached = np.zeros(scores.shape, np.uint8)
    for limit in limits:
        reached += scores > limit
    return reached


def thresholds_in_dtype(thresholds: Sequence[float], dtype: np.dtype[np.generic]) -> AnyArray:
    """Thresholds in the data type of the scores, so that a score equal to a threshold is not above it."""
    if dtype == np.uint8:
        return np.floor(np.round(np.array(thresholds) * _FULL, 6)).astype(np.uint8)
    return np.array(thresholds, dtype)


def _check(labels: AnyArray, scores: AnyArray, classes: Sequence[str]) -> None:
    unknown = [name for name in classes if name not in BEV_CLASSES]
    if unknown:
        raise InputError(f"scores: classes: there is no {unknown[0]!r}; allowed: {', '.join(BEV_CLASSES)}")
    shape = (len(classes), *labels.shape)
    if scores.shape != shape:
        raise InputError(f"scores: have the shape {scores.shape}; it must be {shape}: classes, rows, columns")
    if scores.dtype == np.uint8:
        return
    if scores.dtype.kind != "f":
        raise InputError(f"scores: are of the type {scores.dtype}; allowed: floating and uint8")
    # NaN fails both comparisons, and min and max of an array with NaN are NaN.
    if scores.size and not (scores.min() >= 0 and scores.max() <= 1):
        bad = scores[~((scores >= 0) & (scores <= 1))][0]
        raise InputError(f"scores: one is {bad}; allowed: 0 to 1")
