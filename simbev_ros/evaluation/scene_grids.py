"""Counts the bird's-eye-view cells of one scene, frame by frame, for every row of every table.

Ground-truth labels and predicted scores are reduced to one ``SegmentationTally`` per table slice.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from simbev_ros.evaluation.metrics.segmentation import (
    TABLE_THRESHOLD,
    THRESHOLDS,
    SegmentationTally,
    empty_tally,
    tallies_by_region,
)
from simbev_ros.evaluation.predictions.score_grid import ScoreGrid
from simbev_ros.evaluation.slices import Conditions, TableSlice
from simbev_ros.foundation.geometry.grid import BevGrid
from simbev_ros.foundation.semantics import BEV_CLASSES
from simbev_ros.foundation.types import AnyArray, Float64Array


class SceneGrids:
    """Accumulates the cells of a scene's frames.

    Args:
        grid: Geometry of the ground-truth grid.
        slices: Rows of tables; only those that include cells are counted.

    Attributes:
        classes: Classes for which some frame had scores.
    """

    def __init__(self, grid: BevGrid, slices: Sequence[TableSlice]) -> None:
        distance_m: Float64Array = np.hypot(*np.moveaxis(grid.centers_ego, -1, 0))
        self._edges_m = np.unique(
            [edge_m for table_slice in slices if table_slice.includes_cells for edge_m in table_slice.boxes.range_m]
        )
        self._region = np.searchsorted(self._edges_m, distance_m, side="right").astype(np.uint8)
        self._tallies = {table_slice: empty_tally() for table_slice in slices if table_slice.includes_cells}
        self.classes: set[str] = set()

    @property
    def tallies(self) -> Mapping[TableSlice, SegmentationTally]:
        """Counts of all frames so far, by table slice."""
        return self._tallies

    def add_frame(
        self, labels: AnyArray, conditions: Conditions, predicted: ScoreGrid | None, base: TableSlice
    ) -> float:
        """Count the cells of a frame; without scores all of its ground truth is missed.

        Args:
            labels: (H, W) ground truth, as ``segmentation.tallies_by_region`` takes it.
            conditions: Time of day and weather of the frame.
            predicted: Predicted scores, or None.
            base: The table slice for the returned IoU.

        Returns:
            Mean IoU of this frame alone within ``base``.

        Raises:
            InputError: The scores and the ground truth differ in size.
        """
        scores = np.zeros((len(BEV_CLASSES), *labels.shape), np.uint8)
        if predicted is not None:
            predicted.require_shape(*labels.shape)
            scores = scores.astype(predicted.scores.dtype)
            scores[[BEV_CLASSES.index(name) for name in predicted.classes]] = predicted.scores
            self.classes.update(predicted.classes)
        tallies = tallies_by_region(labels, scores, self._region, len(self._edges_m) + 1)
        for table_slice in self._tallies:
            if table_slice.has(conditions):
                self._tallies[table_slice] += self._tally_within(table_slice, tallies)
        frame_tally = self._tally_within(base, tallies)
        known = [BEV_CLASSES.index(name) for name in sorted(self.classes)]
        iou = frame_tally.iou()[known, THRESHOLDS.index(TABLE_THRESHOLD)]
        return float(np.nanmean(iou)) if np.isfinite(iou).any() else float("nan")

    def _tally_within(self, table_slice: TableSlice, tallies: Sequence[SegmentationTally]) -> SegmentationTally:
        """Counts of a frame within the distance range of a table slice."""
        first, last = np.searchsorted(self._edges_m, table_slice.boxes.range_m, side="right")
        return replace(sum(tallies[first:last], empty_tally()), frames=1)
