"""Evaluating predictions over a dataset: scenes in, in as many processes as wanted, tables out."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from simbev_ros.dataset import Scene
from simbev_ros.dataset.parallel import map_in_processes
from simbev_ros.errors import InputError
from simbev_ros.evaluation.metrics.curves import Curve
from simbev_ros.evaluation.metrics.detection import (
    DetectionResult,
    DetectionTally,
    detection_result,
    merge,
    precision_recall,
)
from simbev_ros.evaluation.metrics.nuscenes import NuscenesResult, nuscenes_merge, nuscenes_result
from simbev_ros.evaluation.metrics.segmentation import SegmentationTally, no_frames
from simbev_ros.evaluation.options import EvaluationOptions
from simbev_ros.evaluation.predictions.dataset_predictions import PredictionSet
from simbev_ros.evaluation.scene_evaluation import SceneTally, evaluate_scene
from simbev_ros.evaluation.slices import Cut
from simbev_ros.semantics import BEV_CLASSES
from simbev_ros.types import Table

_CURVE_POINTS = 200


@dataclass(frozen=True, slots=True, eq=False)
class Evaluation:
    """All figures of some predictions.

    Attributes:
        options: What was evaluated.
        frames: By scene, its evaluated frames (``scene_evaluation.FRAME_DTYPE``).
        answered_boxes: Of the frames with an answer about boxes, by scene.
        answered_grids: As well, about grids.
        detections: By cut; empty: nothing is said about boxes.
        curves: Of the first cut, by class (of ``BOX_CLASSES``) and threshold (of ``DetectionOptions.thresholds``), of
            at most ``200`` points each.
        segmentations: By cut; empty: nothing is said about grids.
        grid_classes: Those that some grid has scores of, of ``BEV_CLASSES``; the others are in no figure.
        nuscenes: nuScenes' metrics, if asked for.
    """

    options: EvaluationOptions
    frames: Mapping[str, Table]
    answered_boxes: Mapping[str, int]
    answered_grids: Mapping[str, int]
    detections: Mapping[Cut, DetectionResult]
    curves: Mapping[tuple[int, int], Curve]
    segmentations: Mapping[Cut, SegmentationTally]
    grid_classes: tuple[str, ...]
    nuscenes: NuscenesResult | None

    @property
    def frame_count(self) -> int:
        """How many frames were evaluated."""
        return sum(map(len, self.frames.values()))


def evaluate(
    scenes: Sequence[Scene],
    predictions: PredictionSet,
    options: EvaluationOptions | None = None,
    jobs: int = 1,
    report: Callable[[int], None] = lambda frames: None,
) -> Evaluation:
    """Evaluate predictions.

    Args:
        scenes: With the truth; those of which nothing is predicted count as missed.
        predictions: Of these scenes, and perhaps of others.
        options: What is evaluated; None: as the paper.
        jobs: How many processes.
        report: Told how many frames are done.

    Raises:
        InputError: What is predicted does not fit the scenes, a bag has no truth, or there is no frame to evaluate.
        BagError: A bag is damaged.
    """
    options = options or EvaluationOptions()
    work = _Work(predictions, options)
    tallies = list(map_in_processes(work, scenes, min(jobs, max(len(scenes), 1)), report))
    if not any(len(each.frames) for each in tallies):
        raise InputError(f"{predictions.path}: no frame of {len(tallies)} scenes is left to evaluate")
    return evaluation_of(tallies, options)


def evaluation_of(tallies: Sequence[SceneTally], options: EvaluationOptions) -> Evaluation:
    """The figures of at least one scene's tally; ``options`` as they were made with."""
    boxes = {each.scene: int(each.frames["answered_boxes"].sum()) for each in tallies}
    grids = {each.scene: int(each.frames["answered_grid"].sum()) for each in tallies}
    detections = {
        cut: merge([each.detections[cut] for each in tallies])
        for cut in options.cuts
        if any(boxes.values()) and options.box_classes
    }
    classes = frozenset(name for each in tallies for name in each.grid_classes).intersection(options.bev_classes)
    cells = {
        cut: _sum([each.segmentations[cut] for each in tallies]) for cut in options.cuts if cut.of_cells and classes
    }
    nuscenes = [each.nuscenes for each in tallies if each.nuscenes is not None]
    return Evaluation(
        options=options,
        frames={each.scene: each.frames for each in tallies},
        answered_boxes=boxes,
        answered_grids=grids,
        detections={cut: detection_result(total, options.detection) for cut, total in detections.items()},
        curves=_curves(detections[options.cuts[0]], options) if detections else {},
        segmentations=cells,
        grid_classes=tuple(name for name in BEV_CLASSES if name in classes),
        nuscenes=nuscenes_result(nuscenes_merge(nuscenes)) if nuscenes else None,
    )


@dataclass(frozen=True, slots=True)
class _Work:
    """Tallies a scene, in whatever process."""

    predictions: PredictionSet
    options: EvaluationOptions

    def __call__(self, scene: Scene) -> SceneTally:
        predicted = self.predictions.scene(scene.name, scene.stamps_ns)
        return evaluate_scene(scene, predicted, self.options, grids=self.predictions.has_grids)


def _sum(tallies: Sequence[SegmentationTally]) -> SegmentationTally:
    return sum(tallies, no_frames())


def _curves(total: DetectionTally, options: EvaluationOptions) -> dict[tuple[int, int], Curve]:
    """Of all classes that there are, thinned out evenly."""
    thresholds = len(options.detection.thresholds)
    return {
        (label, column): _thinned(precision_recall(total, label, column))
        for label in np.flatnonzero(total.truths).tolist()
        for column in range(thresholds)
    }


def _thinned(curve: Curve) -> Curve:
    kept = np.unique(np.linspace(0, len(curve.score) - 1, min(_CURVE_POINTS, len(curve.score))).astype(np.int64))
    return Curve(curve.score[kept], curve.precision[kept], curve.recall[kept])
