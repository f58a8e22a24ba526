"""Evaluating a scene while it runs: frames that have been joined in, running figures and the scene's tally out."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from simbev_ros.dataset.calibration import calibrations
from simbev_ros.evaluation.evaluation import evaluation_of
from simbev_ros.evaluation.figures import METHODS, figures_of
from simbev_ros.evaluation.live.answer_join import BOXES, LABELS, POSE, Books, OpenFrame
from simbev_ros.evaluation.metrics.averages import known_mean
from simbev_ros.evaluation.metrics.detection import DetectionTally, detection_result, merge
from simbev_ros.evaluation.metrics.segmentation import TABLE_THRESHOLD, THRESHOLDS
from simbev_ros.evaluation.options import EvaluationOptions
from simbev_ros.evaluation.predictions.predicted_boxes import MAP_FRAME, PredictedBoxes, Reference, in_map, joined
from simbev_ros.evaluation.predictions.reference_frames import ReferenceFrames
from simbev_ros.evaluation.predictions.score_grid import ScoreGrid
from simbev_ros.evaluation.scene_boxes import SceneBoxes, TrueFrame
from simbev_ros.evaluation.scene_evaluation import FRAME_DTYPE, SceneTally
from simbev_ros.evaluation.scene_grids import SceneGrids
from simbev_ros.evaluation.slices import Conditions, Cut
from simbev_ros.scene.spec import SceneSpec
from simbev_ros.semantics import BEV_CLASSES
from simbev_ros.types import BoolArray, Float64Array, Table

_FRAMES_TOGETHER = 64
"""So many are matched at once at most: it takes less time together, but they must be kept until then."""
_PERCENTILES = (50, 90, 99)


@dataclass(frozen=True, slots=True, eq=False)
class LiveScene:
    """What is known of a scene that was evaluated live.

    Attributes:
        tally: As of a recorded scene.
        latency_ms: (L,) of the frames that were answered in every kind, from the input to the last answer.
        books: What became of frames and answers.
    """

    tally: SceneTally
    latency_ms: Float64Array
    books: Books


class LiveEvaluation:
    """Tallies one scene.

    Args:
        spec: The scene.
        options: What is evaluated; neither ``every`` nor ``nuscenes``.
    """

    def __init__(self, spec: SceneSpec, options: EvaluationOptions) -> None:
        self._spec, self._options, self._calibration = spec, options, calibrations(spec.rig)
        self._waiting: list[tuple[TrueFrame, PredictedBoxes]] = []
        self._cells = SceneGrids(spec.annotation.bev.grid, options.cuts)
        self._rows: list[Table] = []
        self._tallies: dict[Cut, list[DetectionTally]] = {cut: [] for cut in options.cuts}
        self._latency_ms: list[float] = []
        self._iou: list[float] = []
        self._answered: list[tuple[bool, bool]] = []
        self._tally(SceneBoxes(spec, [], joined([]).predictions, options), [])

    def add(self, frame: OpenFrame) -> None:
        """Count a frame, later than those before.

        Args:
            frame: As ``answer_join.AnswerJoin`` gives it out.

        Raises:
            InputError: An answer does not fit the scene.
        """
        conditions, map_from_ego = Conditions.of(self._spec.weather_at(frame.tick)), frame.truth[POSE]
        boxes = [each for each in frame.answers.values() if isinstance(each, PredictedBoxes)]
        grids = [each for each in frame.answers.values() if isinstance(each, ScoreGrid)]
        predictions = in_map(joined(boxes), ReferenceFrames(self._spec, self._calibration, lambda tick: map_from_ego))
        iou = self._cells.add(frame.truth[LABELS], conditions, _together(grids), self._options.cuts[0])
        truth = TrueFrame(frame.tick, frame.truth[BOXES], map_from_ego, conditions)
        self._waiting.append((truth, PredictedBoxes.of(predictions, Reference(MAP_FRAME, ""))))
        self._answered.append((bool(boxes), bool(grids)))
        self._iou.append(iou)
        if frame.is_complete and frame.input_s is not None:
            self._latency_ms.append(max(0.0, 1000.0 * (frame.answered_s - frame.input_s)))
        if len(self._waiting) >= _FRAMES_TOGETHER:
            self._match()

    def running(self) -> dict[str, float]:
        """Figures of all frames so far, by name; those that are undefined are missing."""
        self._match()
        base = self._options.cuts[0]
        figures: dict[str, float] = {"frames": sum(map(len, self._rows))}
        with_boxes, with_grid = self._answered_of.sum(axis=0).tolist()
        figures |= {"answered_boxes": with_boxes, "answered_grids": with_grid}
        if with_boxes:
            self._tallies[base] = [merge(self._tallies[base])]
            result = detection_result(self._tallies[base][0], self._options.detection)
            for method in METHODS:
                figures |= {f"mAP_{method}": result.mean_ap(method), f"SDS_{method}": result.sds(method)}
        if self._cells.classes:
            rows = [BEV_CLASSES.index(name) for name in self._options.bev_classes if name in self._cells.classes]
            iou = self._cells.tallies[base].iou()[rows, THRESHOLDS.index(TABLE_THRESHOLD)]
            figures["mean_IoU"] = float(known_mean(iou))
        figures |= {f"latency_{name}_ms": value for name, value in _percentiles(np.array(self._latency_ms)).items()}
        return {name: value for name, value in figures.items() if np.isfinite(value)}

    def scene(self, books: Books) -> LiveScene:
        """All of it, as ``scene_evaluation.evaluate_scene`` has it of the same frames and answers."""
        self._match()
        rows = np.concatenate([np.zeros(0, FRAME_DTYPE), *self._rows])
        rows["answered_boxes"], rows["answered_grid"] = self._answered_of.T
        has_grids = bool(rows["answered_grid"].any())
        rows["iou"] = self._iou if has_grids else np.nan
        tally = SceneTally(
            self._spec.name,
            rows,
            {cut: merge(tallies) for cut, tallies in self._tallies.items()},
            self._cells.tallies if has_grids else {},
            frozenset(self._cells.classes),
            None,
        )
        return LiveScene(tally, np.array(self._latency_ms), books)

    @property
    def _answered_of(self) -> BoolArray:
        """(F, 2) of all frames, whether there are boxes and scores of cells."""
        return np.array(self._answered, np.bool_).reshape(-1, 2)

    def _match(self) -> None:
        """Match the boxes of the frames that wait."""
        if not self._waiting:
            return
        truth, predictions = [frame for frame, _ in self._waiting], joined([boxes for _, boxes in self._waiting])
        self._tally(
            SceneBoxes(self._spec, truth, predictions.predictions, self._options), [each.tick for each in truth]
        )
        self._waiting = []

    def _tally(self, boxes: SceneBoxes, ticks: Sequence[int]) -> None:
        rows = np.zeros(len(ticks), FRAME_DTYPE)
        rows["tick"] = ticks
        rows["boxes"], rows["found"] = boxes.found()
        self._rows.append(rows)
        for cut, tallies in self._tallies.items():
            tallies.append(boxes.tally(cut))


def live_figures(scenes: Sequence[LiveScene], options: EvaluationOptions) -> dict[str, Any]:
    """The figures of at least one scene, as ``figures.figures_of``, and what is only known live.

    These are ``latency_ms`` (percentiles; null where there is none), ``scenes`` (their names), and in ``frames`` what
    ``answer_join.Books`` has.
    """
    figures = figures_of(evaluation_of([each.tally for each in scenes], options))
    books = [asdict(each.books) for each in scenes]
    figures["frames"] |= {name: sum(each[name] for each in books) for name in books[0]}
    percentiles = _percentiles(np.concatenate([each.latency_ms for each in scenes]))
    figures["latency_ms"] = {name: value if np.isfinite(value) else None for name, value in percentiles.items()}
    return {"scenes": [each.tally.scene for each in scenes], **figures}


def _percentiles(values: Float64Array) -> dict[str, float]:
    """By name, of (N,) values; NaN: there is none."""
    found = np.percentile(values, _PERCENTILES) if len(values) else np.full(len(_PERCENTILES), np.nan)
    return {f"p{each}": float(value) for each, value in zip(_PERCENTILES, found, strict=True)}


def _together(grids: Sequence[ScoreGrid]) -> ScoreGrid | None:
    """One grid of the classes of all; None: there is none.

    Raises:
        InputError: They differ in size, or have a class in common.
    """
    if len(grids) < 2:
        return grids[0] if grids else None
    for each in grids:
        each.require_shape(*grids[0].scores.shape[1:])
    classes = tuple(name for each in grids for name in each.classes)
    return ScoreGrid(classes, np.concatenate([each.scores for each in grids]), grids[0].source)
