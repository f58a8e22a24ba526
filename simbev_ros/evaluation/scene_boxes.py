"""Matches the boxes in frames of one scene.

Ground truth and predictions in the map frame are matched once. The scene's part of every table, and the boxes that each
frame has found, are derived from that match.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from simbev_ros.config.evaluation import Truth
from simbev_ros.dataset import Frame
from simbev_ros.evaluation.joint_truth import boxes_in_reach, truth_key
from simbev_ros.evaluation.metrics.boxes import Predictions, boxes_from_tables
from simbev_ros.evaluation.metrics.detection import HIT, DetectionOptions, DetectionTally
from simbev_ros.evaluation.metrics.ranking import top_predictions
from simbev_ros.evaluation.metrics.scene_matching import CountedBoxes, Matching
from simbev_ros.evaluation.metrics.tracks import SceneTracks, scene_tracks
from simbev_ros.evaluation.options import EvaluationOptions
from simbev_ros.evaluation.slices import Conditions, TableSlice
from simbev_ros.foundation.semantics import BOX_CLASSES
from simbev_ros.foundation.types import AnyArray, BoolArray, Float64Array, Int64Array, Table
from simbev_ros.scene.frames import ego_size_m
from simbev_ros.schema.boxes import BOX_DTYPE
from simbev_ros.schema.scene.agents import AgentView

_FOUND_DISTANCE_M = 2.0


def found_column(options: DetectionOptions) -> int:
    """Index of the threshold in ``DetectionOptions.thresholds`` at which single frames are judged.

    This is the distance of 2 m at which nuScenes measures errors, or else the first threshold.
    """
    preferred = ("distance", _FOUND_DISTANCE_M)
    return options.thresholds.index(preferred) if preferred in options.thresholds else 0


@dataclass(frozen=True, slots=True, eq=False)
class Outcomes:
    """Outcome of every box at the threshold of ``found_column``, with only the ``top_predictions`` of each frame.

    Attributes:
        table: (N,) ground-truth boxes, ``BOX_DTYPE``.
        tick: (N,) tick of each ground-truth box.
        counted: (N,) whether the box must be found.
        found: (N,) whether the box is found.
        predictions: (M,) predictions in the map frame; ``frame`` is the tick.
        taken: (M,) whether the prediction is among the top predictions.
        outcome: (M,) ``detection.HIT``, ``MISS`` or ``UNCOUNTED``.
    """

    table: Table
    tick: Int64Array
    counted: BoolArray
    found: BoolArray
    predictions: Predictions
    taken: BoolArray
    outcome: AnyArray


class LeftOut(NamedTuple):
    """Numbers of boxes that meet all conditions but one, and so need not be found.

    Attributes:
        of_other_classes: Their class is not evaluated.
        unseen: No point is inside, and no camera sees them.
    """

    of_other_classes: int
    unseen: int

    def plus(self, other: "LeftOut") -> "LeftOut":
        """The numbers of both together."""
        return LeftOut(self.of_other_classes + other.of_other_classes, self.unseen + other.unseen)


class GroundTruthFrame(NamedTuple):
    """Ground truth of one frame, as far as box evaluation needs it.

    Attributes:
        tick: Index of the frame in the scene.
        boxes: (N,) ``BOX_DTYPE``.
        map_from_ego: (4, 4) pose of the ego.
        conditions: Time of day and weather of the frame.
    """

    tick: int
    boxes: Table
    map_from_ego: Float64Array
    conditions: Conditions

    @classmethod
    def from_frame(cls, frame: Frame, truth: Truth) -> "GroundTruthFrame":
        """Ground truth of a recorded frame: its agent's own, or the joint one.

        Raises:
            InputError: The joint table belongs to another scene.
        """
        view = frame.scene.view
        boxes = frame[truth_key(truth)]
        boxes = boxes_in_reach(boxes, view) if truth == "joint" else boxes
        return cls(frame.tick, boxes, frame.map_from_ego, Conditions.of_tick(view.scene, frame.tick))


class SceneBoxes:
    """Matched boxes of some frames of a scene.

    Args:
        view: The scene as the evaluated agent sees it.
        truth: (F) ground truth of the evaluated frames, by ascending tick.
        predictions: Predictions in the map frame; their ``frame`` is the tick; those of other ticks are ignored.
        options: What to evaluate.
    """

    def __init__(
        self, view: AgentView, truth: Sequence[GroundTruthFrame], predictions: Predictions, options: EvaluationOptions
    ) -> None:
        self._ticks = np.array([each.tick for each in truth], np.int64)
        self._conditions, self._options = [each.conditions for each in truth], options
        tables = {each.tick: each.boxes for each in truth}
        self._table = np.concatenate([np.zeros(0, BOX_DTYPE), *tables.values()])
        self._predictions = predictions.take(np.isin(predictions.boxes.frame, self._ticks))
        self._matching = Matching(boxes_from_tables(tables), self._predictions, self._ticks, options.detection)
        ego_m = _ego_centers_m(view, truth)[self._rows_of(self._predictions.boxes.frame)]
        self._distance_m = np.linalg.norm(self._predictions.boxes.center_m - ego_m, axis=1)
        self._is_labeled = self._distance_m <= view.annotation.box_radius_m  # there are no labels beyond this radius

    def tally(self, table_slice: TableSlice) -> DetectionTally:
        """Tally of the scene for one row of a table."""
        return self._matching.tally(self._counting(table_slice))

    def tracks(self) -> dict[TableSlice, SceneTracks]:
        """Tracked boxes by table slice that includes tracks.

        Raises:
            InputError: Two predictions of a frame and class have the same track.
        """
        return {
            table_slice: scene_tracks(self._matching.truth, self._predictions, self._counting(table_slice))
            for table_slice in self._options.slices
            if table_slice.includes_tracks
        }

    def count_found(self) -> tuple[Int64Array, Int64Array]:
        """(F,) numbers of boxes that count, and (F,) numbers of those found by the top predictions."""
        outcomes = self.outcomes()
        row, frames = self._rows_of(outcomes.tick), len(self._ticks)
        counted, found = (np.bincount(row[chosen], minlength=frames) for chosen in (outcomes.counted, outcomes.found))
        return counted, found

    def count_left_out(self) -> LeftOut:
        """Number of boxes in reach that do not count, by reason."""
        base = self._options.slices[0]
        has_class = np.isin(BOX_CLASSES, self._options.box_classes)[self._matching.truth.label]
        in_frame = self._frames_of(base)[self._rows_of(self._matching.truth.frame)]
        wanted = replace(base.boxes, seen=False).truth_mask(self._table) & in_frame
        unseen = wanted & has_class & ~base.boxes.truth_mask(self._table)
        return LeftOut(int((wanted & ~has_class).sum()), int(unseen.sum()))

    def outcomes(self) -> Outcomes:
        """Outcome of every box and prediction of the first table slice."""
        counting = self._counting(self._options.slices[0])
        truth, predicted = self._matching.truth, self._predictions.boxes
        counts = np.zeros((len(self._ticks), len(BOX_CLASSES)), np.int64)
        np.add.at(counts, (self._rows_of(truth.frame), truth.label), counting.truth)
        column = found_column(self._options.detection)
        outcome = self._matching.outcome(counting)[:, column]
        taken = top_predictions(self._rows_of(predicted.frame), predicted.label, self._matching.rank, outcome, counts)
        found = np.zeros(len(truth), np.bool_)
        found[self._matching.found[column, taken & (outcome == HIT)]] = True
        return Outcomes(self._table, truth.frame, counting.truth, found, self._predictions, taken, outcome)

    def _counting(self, table_slice: TableSlice) -> CountedBoxes:
        """Boxes that count in a table slice."""
        truth, predicted = self._matching.truth, self._predictions.boxes
        in_frame = self._frames_of(table_slice)
        chosen = np.isin(BOX_CLASSES, self._options.box_classes)
        return CountedBoxes(
            table_slice.boxes.truth_mask(self._table) & in_frame[self._rows_of(truth.frame)] & chosen[truth.label],
            table_slice.boxes.range_mask(self._distance_m)
            & in_frame[self._rows_of(predicted.frame)]
            & chosen[predicted.label]
            & self._is_labeled,
        )

    def _frames_of(self, table_slice: TableSlice) -> BoolArray:
        """(F,) whether each evaluated frame counts in a table slice."""
        return np.array([table_slice.has(each) for each in self._conditions], np.bool_)

    def _rows_of(self, tick: Int64Array) -> Int64Array:
        """Row of each tick among the evaluated frames."""
        return np.searchsorted(self._ticks, tick)


def _ego_centers_m(view: AgentView, truth: Sequence[GroundTruthFrame]) -> Float64Array:
    """(F, 3) centers of the ego's box in the map frame; distances of boxes are measured from there."""
    height_m = ego_size_m(view)[2]
    poses = [each.map_from_ego for each in truth]
    return np.array([pose[:3, 3] + pose[:3, 2] * height_m / 2.0 for pose in poses]).reshape(-1, 3)
