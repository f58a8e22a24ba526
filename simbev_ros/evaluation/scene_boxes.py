"""Boxes of one scene's frames, matched once: their part of every table, and which of them each frame has found."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from simbev_ros.annotation.boxes.boxes import BOX_DTYPE
from simbev_ros.dataset import Frame
from simbev_ros.evaluation.metrics.boxes import Predictions, boxes_of
from simbev_ros.evaluation.metrics.detection import HIT, DetectionOptions, DetectionTally
from simbev_ros.evaluation.metrics.ranking import surest
from simbev_ros.evaluation.metrics.scene_matching import Counting, Matching
from simbev_ros.evaluation.options import EvaluationOptions
from simbev_ros.evaluation.slices import Conditions, Cut
from simbev_ros.scene.blueprints import blueprint_named
from simbev_ros.scene.spec import SceneSpec
from simbev_ros.semantics import BOX_CLASSES
from simbev_ros.types import AnyArray, BoolArray, Float64Array, Int64Array, Table

_FOUND_WITHIN_M = 2.0


def found_column(options: DetectionOptions) -> int:
    """At which of the ``thresholds`` boxes of single frames are found: 2 m, as errors of nuScenes; else the first."""
    at = ("distance", _FOUND_WITHIN_M)
    return options.thresholds.index(at) if at in options.thresholds else 0


@dataclass(frozen=True, slots=True, eq=False)
class Outcomes:
    """What became of each box at the threshold of ``found_column``, if only the ``surest`` predictions are taken.

    Attributes:
        table: (N,) boxes of the truth, ``BOX_DTYPE``.
        tick: (N,) of their frames.
        counted: (N,) whether they are to be found.
        found: (N,) whether they are.
        predictions: (M,) in the map frame; ``frame`` is the tick.
        taken: (M,) whether they are taken.
        outcome: (M,) ``detection.HIT``, ``MISS`` or ``UNCOUNTED``.
    """

    table: Table
    tick: Int64Array
    counted: BoolArray
    found: BoolArray
    predictions: Predictions
    taken: BoolArray
    outcome: AnyArray


class TrueFrame(NamedTuple):
    """The truth of a frame, as far as boxes need it.

    Attributes:
        tick: Its place in the scene.
        boxes: (N,) ``BOX_DTYPE``.
        map_from_ego: (4, 4) pose of the ego.
        conditions: Of the frame.
    """

    tick: int
    boxes: Table
    map_from_ego: Float64Array
    conditions: Conditions

    @classmethod
    def of(cls, frame: Frame) -> "TrueFrame":
        """That of a recorded frame."""
        conditions = Conditions.of(frame.scene.spec.weather_at(frame.tick))
        return cls(frame.tick, frame["boxes"], frame.map_from_ego, conditions)


class SceneBoxes:
    """Boxes of some frames of a scene.

    Args:
        spec: The scene.
        truth: (F) the frames that are evaluated, by ascending tick.
        predictions: In the map frame, whose ``frame`` is the tick; those of other ticks are left out.
        options: What is evaluated.
    """

    def __init__(
        self, spec: SceneSpec, truth: Sequence[TrueFrame], predictions: Predictions, options: EvaluationOptions
    ) -> None:
        self._ticks = np.array([each.tick for each in truth], np.int64)
        self._conditions, self._options = [each.conditions for each in truth], options
        tables = {each.tick: each.boxes for each in truth}
        self._table = np.concatenate([np.zeros(0, BOX_DTYPE), *tables.values()])
        self._predictions = predictions.take(np.isin(predictions.boxes.frame, self._ticks))
        self._matching = Matching(boxes_of(tables), self._predictions, self._ticks, options.detection)
        ego_m = _ego_centers_m(spec, truth)[self._row(self._predictions.boxes.frame)]
        self._apart_m = np.linalg.norm(self._predictions.boxes.center_m - ego_m, axis=1)
        self._labelled = self._apart_m <= spec.annotation.box_radius_m  # farther away nobody knows the truth

    def tally(self, cut: Cut) -> DetectionTally:
        """The part of a row of a table."""
        return self._matching.tally(self._counting(cut))

    def found(self) -> tuple[Int64Array, Int64Array]:
        """(F,) boxes that count, and (F,) those found by as many surest predictions."""
        outcomes = self.outcomes()
        row, frames = self._row(outcomes.tick), len(self._ticks)
        counted, found = (np.bincount(row[chosen], minlength=frames) for chosen in (outcomes.counted, outcomes.found))
        return counted, found

    def outcomes(self) -> Outcomes:
        """What became of each box."""
        counting = self._counting(self._options.cuts[0])
        truth, predicted = self._matching.truth, self._predictions.boxes
        counts = np.zeros((len(self._ticks), len(BOX_CLASSES)), np.int64)
        np.add.at(counts, (self._row(truth.frame), truth.label), counting.truth)
        column = found_column(self._options.detection)
        outcome = self._matching.outcome(counting)[:, column]
        taken = surest(self._row(predicted.frame), predicted.label, self._matching.rank, outcome, counts)
        found = np.zeros(len(truth), np.bool_)
        found[self._matching.found[column, taken & (outcome == HIT)]] = True
        return Outcomes(self._table, truth.frame, counting.truth, found, self._predictions, taken, outcome)

    def _counting(self, cut: Cut) -> Counting:
        truth, predicted = self._matching.truth, self._predictions.boxes
        in_frame = np.array([cut.has(each) for each in self._conditions], np.bool_)
        chosen = np.isin(BOX_CLASSES, self._options.box_classes)
        return Counting(
            cut.boxes.of_truth(self._table) & in_frame[self._row(truth.frame)] & chosen[truth.label],
            cut.boxes.in_range(self._apart_m)
            & in_frame[self._row(predicted.frame)]
            & chosen[predicted.label]
            & self._labelled,
        )

    def _row(self, tick: Int64Array) -> Int64Array:
        return np.searchsorted(self._ticks, tick)


def _ego_centers_m(spec: SceneSpec, truth: Sequence[TrueFrame]) -> Float64Array:
    """(F, 3) centres of the ego's box, from which distances of boxes are measured, map frame."""
    height_m = blueprint_named(spec.vehicles[0].blueprint).size_m[2]
    poses = [each.map_from_ego for each in truth]
    return np.array([pose[:3, 3] + pose[:3, 2] * height_m / 2.0 for pose in poses]).reshape(-1, 3)
