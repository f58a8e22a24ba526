"""Counting the cells of one scene, frame by frame, for every row of every table."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from simbev_ros.evaluation.metrics.segmentation import (
    TABLE_THRESHOLD,
    THRESHOLDS,
    SegmentationTally,
    no_frames,
    regional_tallies,
)
from simbev_ros.evaluation.predictions.score_grid import ScoreGrid
from simbev_ros.evaluation.slices import Conditions, Cut
from simbev_ros.geometry.grid import BevGrid
from simbev_ros.semantics import BEV_CLASSES
from simbev_ros.types import AnyArray, Float64Array


class SceneGrids:
    """Adds up the cells of a scene's frames.

    Args:
        grid: Of the truth.
        cuts: Rows of tables, of which those count that say something of cells.

    Attributes:
        classes: Those that some frame had scores of.
    """

    def __init__(self, grid: BevGrid, cuts: Sequence[Cut]) -> None:
        apart_m: Float64Array = np.hypot(*np.moveaxis(grid.centers_ego, -1, 0))
        self._edges_m = np.unique([edge_m for cut in cuts if cut.of_cells for edge_m in cut.boxes.range_m])
        self._region = np.searchsorted(self._edges_m, apart_m, side="right").astype(np.uint8)
        self._tallies = {cut: no_frames() for cut in cuts if cut.of_cells}
        self.classes: set[str] = set()

    @property
    def tallies(self) -> Mapping[Cut, SegmentationTally]:
        """Of all frames so far."""
        return self._tallies

    def add(self, labels: AnyArray, conditions: Conditions, predicted: ScoreGrid | None, base: Cut) -> float:
        """Count a frame; without scores all of its truth is missed.

        Args:
            labels: (H, W) of the truth, as ``segmentation.segmentation_tally`` takes them.
            conditions: Of the frame.
            predicted: What is predicted.
            base: One of the cuts.

        Returns:
            The frame's own mean IoU within that cut.

        Raises:
            InputError: The scores have another size than the truth.
        """
        scores = np.zeros((len(BEV_CLASSES), *labels.shape), np.uint8)
        if predicted is not None:
            predicted.require_shape(*labels.shape)
            scores = scores.astype(predicted.scores.dtype)
            scores[[BEV_CLASSES.index(name) for name in predicted.classes]] = predicted.scores
            self.classes.update(predicted.classes)
        tallies = regional_tallies(labels, scores, self._region, len(self._edges_m) + 1)
        for cut in self._tallies:
            if cut.has(conditions):
                self._tallies[cut] += self._within(cut, tallies)
        own = self._within(base, tallies)
        known = [BEV_CLASSES.index(name) for name in sorted(self.classes)]
        iou = own.iou()[known, THRESHOLDS.index(TABLE_THRESHOLD)]
        return float(np.nanmean(iou)) if np.isfinite(iou).any() else float("nan")

    def _within(self, cut: Cut, tallies: Sequence[SegmentationTally]) -> SegmentationTally:
        """Of a frame's regions between two edges."""
        first, last = np.searchsorted(self._edges_m, cut.boxes.range_m, side="right")
        return replace(sum(tallies[first:last], no_frames()), frames=1)
