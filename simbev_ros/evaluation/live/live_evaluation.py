"""Evaluates one scene while it runs.

``LiveEvaluation`` takes the frames that ``answer_join`` has completed. It gives running metrics at any time, and at the
end the tally of the scene, equal to the one that ``scene_evaluation`` computes from a recording.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from typing import Any

import numpy as np

from simbev_ros.dataset.calibration import calibrations
from simbev_ros.evaluation.driving.figures import drives_figures
from simbev_ros.evaluation.evaluation import evaluation_from_tallies
from simbev_ros.evaluation.figures import METHODS, figures_of
from simbev_ros.evaluation.live.answer_join import BOXES, LABELS, POSE, JoinCounts, OpenFrame, pose_of
from simbev_ros.evaluation.metrics.averages import mean_ignoring_nan
from simbev_ros.evaluation.metrics.detection import DetectionTally, detection_result, merge_tallies
from simbev_ros.evaluation.metrics.segmentation import TABLE_THRESHOLD, THRESHOLDS
from simbev_ros.evaluation.metrics.tracks import SceneTracks, join_tracks
from simbev_ros.evaluation.options import EvaluationOptions
from simbev_ros.evaluation.predictions.predicted_boxes import (
    MAP_FRAME,
    PredictedBoxes,
    Reference,
    boxes_in_map,
    join_boxes,
)
from simbev_ros.evaluation.predictions.reference_frames import AgentPoses, ReferenceFrames
from simbev_ros.evaluation.predictions.score_grid import ScoreGrid
from simbev_ros.evaluation.scene_boxes import GroundTruthFrame, LeftOut, SceneBoxes
from simbev_ros.evaluation.scene_evaluation import FRAME_DTYPE, SceneTally
from simbev_ros.evaluation.scene_grids import SceneGrids
from simbev_ros.evaluation.slices import Conditions, TableSlice
from simbev_ros.foundation.semantics import BEV_CLASSES
from simbev_ros.foundation.types import BoolArray, Float64Array, Table
from simbev_ros.schema.scene.agents import AgentView, agent_views

_MATCH_BATCH_FRAMES = 64
"""Upper bound on the number of frames matched in one batch: batches save time, but frames wait in memory."""
_PERCENTILES = (50, 90, 99)


@dataclass(frozen=True, slots=True, eq=False)
class LiveScene:
    """Result of the live evaluation of one scene.

    Attributes:
        tally: Tally of the scene, in the form of a recorded scene's.
        latency_ms: (L,) time from the input to the last answer, of the frames that were answered in every kind.
        counts: Numbers of missed frames and late answers.
        drive: The last score of the scene's drive (``driving.figures.drive_figures``); None: there is none.
    """

    tally: SceneTally
    latency_ms: Float64Array
    counts: JoinCounts
    drive: Mapping[str, Any] | None


class LiveEvaluation:
    """Tallies one scene while it runs.

    Args:
        view: The scene as the evaluated agent sees it.
        options: What to evaluate; ``every`` and ``nuscenes`` have no effect.
    """

    def __init__(self, view: AgentView, options: EvaluationOptions) -> None:
        self._view, self._options = view, options
        self._poses: dict[str, Float64Array] = {}
        self._frames = ReferenceFrames(
            AgentPoses(each, calibrations(each.rig), partial(self._pose, each.agent))
            for each in agent_views(view.scene)
        )
        self._waiting: list[tuple[GroundTruthFrame, PredictedBoxes]] = []
        self._cells = SceneGrids(view.annotation.bev.grid, options.slices)
        self._rows: list[Table] = []
        self._left_out = LeftOut(0, 0)
        self._tracks: list[dict[TableSlice, SceneTracks]] = []
        self._tallies: dict[TableSlice, list[DetectionTally]] = {table_slice: [] for table_slice in options.slices}
        self._latency_ms: list[float] = []
        self._iou: list[float] = []
        self._answered: list[tuple[bool, bool]] = []
        self._tally(SceneBoxes(view, [], join_boxes([]).predictions, options), [])

    def add_frame(self, frame: OpenFrame) -> None:
        """Count a frame; frames must come in order.

        Args:
            frame: A frame that ``answer_join.AnswerJoin`` has released.

        Raises:
            InputError: An answer does not fit the scene.
        """
        conditions, map_from_ego = Conditions.of_tick(self._view.scene, frame.tick), frame.truth[POSE]
        own = self._view.agent
        others = (agent.name for agent in self._view.scene.agents if agent.name != own)
        self._poses = {own: map_from_ego, **{name: frame.truth[pose_of(name)] for name in others}}
        boxes = [each for each in frame.answers.values() if isinstance(each, PredictedBoxes)]
        grids = [each for each in frame.answers.values() if isinstance(each, ScoreGrid)]
        predictions = boxes_in_map(join_boxes(boxes), self._frames)
        iou = self._cells.add_frame(frame.truth[LABELS], conditions, _merge_grids(grids), self._options.slices[0])
        truth = GroundTruthFrame(frame.tick, frame.truth[BOXES], map_from_ego, conditions)
        self._waiting.append((truth, PredictedBoxes.with_reference(predictions, Reference(MAP_FRAME, ""))))
        self._answered.append((bool(boxes), bool(grids)))
        self._iou.append(iou)
        if frame.is_complete and frame.input_s is not None:
            self._latency_ms.append(max(0.0, 1000.0 * (frame.answered_s - frame.input_s)))
        if len(self._waiting) >= _MATCH_BATCH_FRAMES:
            self._match()

    def running_figures(self) -> dict[str, float]:
        """Metrics of all frames so far, by name; undefined ones are left out."""
        self._match()
        base = self._options.slices[0]
        figures: dict[str, float] = {"frames": sum(map(len, self._rows))}
        with_boxes, with_grid = self._answered_kinds.sum(axis=0).tolist()
        figures |= {"answered_boxes": with_boxes, "answered_grids": with_grid}
        if with_boxes:
            self._tallies[base] = [merge_tallies(self._tallies[base])]
            result = detection_result(self._tallies[base][0], self._options.detection)
            for method in METHODS:
                figures |= {f"mAP_{method}": result.mean_ap(method), f"SDS_{method}": result.sds(method)}
        if self._cells.classes:
            rows = [BEV_CLASSES.index(name) for name in self._options.bev_classes if name in self._cells.classes]
            iou = self._cells.tallies[base].iou()[rows, THRESHOLDS.index(TABLE_THRESHOLD)]
            figures["mean_IoU"] = float(mean_ignoring_nan(iou))
        figures |= {f"latency_{name}_ms": value for name, value in _percentiles(np.array(self._latency_ms)).items()}
        return {name: value for name, value in figures.items() if np.isfinite(value)}

    def finish(self, counts: JoinCounts, drive: Mapping[str, Any] | None = None) -> LiveScene:
        """Result of the scene; its tally equals ``scene_evaluation.evaluate_scene`` for the same frames and answers."""
        self._match()
        rows = np.concatenate([np.zeros(0, FRAME_DTYPE), *self._rows])
        rows["answered_boxes"], rows["answered_grid"] = self._answered_kinds.T
        has_grids = bool(rows["answered_grid"].any())
        rows["iou"] = self._iou if has_grids else np.nan
        tally = SceneTally(
            self._view.scene.name,
            rows,
            {table_slice: merge_tallies(tallies) for table_slice, tallies in self._tallies.items()},
            self._cells.tallies if has_grids else {},
            frozenset(self._cells.classes),
            None,
            self._left_out,
            {each: join_tracks([part[each] for part in self._tracks]) for each in self._tracks[0]},
        )
        return LiveScene(tally, np.array(self._latency_ms), counts, drive)

    @property
    def _answered_kinds(self) -> BoolArray:
        """(F, 2) whether each frame has an answer with boxes, and one with scores of cells."""
        return np.array(self._answered, np.bool_).reshape(-1, 2)

    def _pose(self, agent: str, _: int) -> Float64Array:
        """(4, 4) pose of an agent at the tick of the frame that is being counted."""
        return self._poses[agent]

    def _match(self) -> None:
        """Match the boxes of the waiting frames."""
        if not self._waiting:
            return
        truth, predictions = [frame for frame, _ in self._waiting], join_boxes([boxes for _, boxes in self._waiting])
        self._tally(
            SceneBoxes(self._view, truth, predictions.predictions, self._options), [each.tick for each in truth]
        )
        self._waiting = []

    def _tally(self, boxes: SceneBoxes, ticks: Sequence[int]) -> None:
        rows = np.zeros(len(ticks), FRAME_DTYPE)
        rows["tick"] = ticks
        rows["boxes"], rows["found"] = boxes.count_found()
        self._rows.append(rows)
        self._left_out = self._left_out.plus(boxes.count_left_out())
        self._tracks.append(boxes.tracks())
        for table_slice, tallies in self._tallies.items():
            tallies.append(boxes.tally(table_slice))


def live_figures(scenes: Sequence[LiveScene], options: EvaluationOptions) -> dict[str, Any]:
    """Metrics of at least one scene, as in ``figures.figures_of``, and those that are only known live.

    The latter are ``latency_ms`` (percentiles; null if there is none), ``scenes`` (names), and the fields of
    ``answer_join.JoinCounts`` in ``frames``. With drives there are also their scores, as in ``drives_figures``.
    """
    figures = figures_of(evaluation_from_tallies([each.tally for each in scenes], options))
    counts = [asdict(each.counts) for each in scenes]
    figures["frames"] |= {name: sum(each[name] for each in counts) for name in counts[0]}
    percentiles = _percentiles(np.concatenate([each.latency_ms for each in scenes]))
    figures["latency_ms"] = {name: value if np.isfinite(value) else None for name, value in percentiles.items()}
    if drives := {each.tally.scene: each.drive for each in scenes if each.drive is not None}:
        figures["drives"] = drives_figures(drives)
    return {"scenes": [each.tally.scene for each in scenes], **figures}


def _percentiles(values: Float64Array) -> dict[str, float]:
    """Percentiles of (N,) values by name; NaN if there are no values."""
    found = np.percentile(values, _PERCENTILES) if len(values) else np.full(len(_PERCENTILES), np.nan)
    return {f"p{each}": float(value) for each, value in zip(_PERCENTILES, found, strict=True)}


def _merge_grids(grids: Sequence[ScoreGrid]) -> ScoreGrid | None:
    """Merge grids of different classes into one; None if there is none.

    Raises:
        InputError: The grids differ in size, or have a class in common.
    """
    if len(grids) < 2:
        return grids[0] if grids else None
    for each in grids:
        each.require_shape(*grids[0].scores.shape[1:])
    classes = tuple(name for each in grids for name in each.classes)
    return ScoreGrid(classes, np.concatenate([each.scores for each in grids]), grids[0].source)
