"""Evaluates predictions on a whole dataset offline, optionally in several processes.

``evaluate`` takes recorded scenes and the predictions of a perception stack, and returns one ``Evaluation`` with the
metrics of all scenes. ``figures`` converts it to plain values, and ``tables`` makes tables from those.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce

import numpy as np

from simbev_ros.dataset import Scene
from simbev_ros.dataset.parallel import OWN_PROCESS, Pool
from simbev_ros.evaluation.metrics.curves import Curve
from simbev_ros.evaluation.metrics.detection import (
    DetectionResult,
    DetectionTally,
    detection_result,
    merge_tallies,
    precision_recall,
)
from simbev_ros.evaluation.metrics.nuscenes import NuscenesResult, nuscenes_merge, nuscenes_result
from simbev_ros.evaluation.metrics.segmentation import SegmentationTally, empty_tally
from simbev_ros.evaluation.metrics.tracking import TrackingResult, tracking_result
from simbev_ros.evaluation.options import EvaluationOptions
from simbev_ros.evaluation.predictions.dataset_predictions import PredictionSet
from simbev_ros.evaluation.scene_boxes import LeftOut
from simbev_ros.evaluation.scene_evaluation import SceneTally, evaluate_scene
from simbev_ros.evaluation.slices import TableSlice
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.semantics import BEV_CLASSES
from simbev_ros.foundation.types import Table

_CURVE_POINTS = 200


@dataclass(frozen=True, slots=True, eq=False)
class Evaluation:
    """All metrics of one set of predictions.

    Attributes:
        options: The options of the evaluation.
        frames: The evaluated frames of each scene (``scene_evaluation.FRAME_DTYPE``), by scene name.
        answered_boxes: Number of frames with an answer about boxes, by scene name.
        answered_grids: Number of frames with an answer about grids, by scene name.
        detections: Detection metrics by table slice; empty if there are no predicted boxes.
        curves: Precision-recall curves of the first table slice, by class (index into ``BOX_CLASSES``) and threshold
            (index into ``DetectionOptions.thresholds``); each has at most ``200`` points.
        segmentations: Segmentation counts by table slice; empty if there are no predicted grids.
        grid_classes: The classes of ``BEV_CLASSES`` for which at least one grid has scores; metrics omit the others.
        nuscenes: The nuScenes metrics, or None if they were not requested.
        left_out: Numbers of boxes that do not count.
        trackings: Tracking metrics by table slice that includes tracks; empty if no prediction has a track.
    """

    options: EvaluationOptions
    frames: Mapping[str, Table]
    answered_boxes: Mapping[str, int]
    answered_grids: Mapping[str, int]
    detections: Mapping[TableSlice, DetectionResult]
    curves: Mapping[tuple[int, int], Curve]
    segmentations: Mapping[TableSlice, SegmentationTally]
    grid_classes: tuple[str, ...]
    nuscenes: NuscenesResult | None
    left_out: LeftOut
    trackings: Mapping[TableSlice, TrackingResult]

    @property
    def frame_count(self) -> int:
        """Number of evaluated frames."""
        return sum(map(len, self.frames.values()))


def evaluate(
    scenes: Sequence[Scene],
    predictions: PredictionSet,
    options: EvaluationOptions | None = None,
    pool: Pool = OWN_PROCESS,
    report: Callable[[int], None] = lambda frames: None,
) -> Evaluation:
    """Evaluate predictions on recorded scenes.

    Args:
        scenes: Scenes with ground truth; a scene without predictions counts as missed.
        predictions: Predictions for these scenes; predictions for other scenes are ignored.
        options: What to evaluate; None selects the settings of the paper.
        pool: Workers that share the scenes.
        report: Callback that receives the number of finished frames.

    Raises:
        InputError: The predictions do not fit the scenes, a bag has no ground truth, or there is no frame to evaluate.
        BagError: A bag is damaged.
    """
    options = options or EvaluationOptions()
    task = _SceneTask(predictions, options)
    tallies = list(pool.map(task, scenes, report))
    if not any(len(each.frames) for each in tallies):
        raise InputError(f"{predictions.path}: no frame of {len(tallies)} scenes is left to evaluate")
    return evaluation_from_tallies(tallies, options)


def evaluation_from_tallies(tallies: Sequence[SceneTally], options: EvaluationOptions) -> Evaluation:
    """Compute the metrics from the tallies of at least one scene.

    Args:
        tallies: One tally per scene.
        options: The options with which the tallies were made.
    """
    boxes = {each.scene: int(each.frames["answered_boxes"].sum()) for each in tallies}
    grids = {each.scene: int(each.frames["answered_grid"].sum()) for each in tallies}
    detections = {
        table_slice: merge_tallies([each.detections[table_slice] for each in tallies])
        for table_slice in options.slices
        if any(boxes.values()) and options.box_classes
    }
    classes = frozenset(name for each in tallies for name in each.grid_classes).intersection(options.bev_classes)
    cells = {
        table_slice: _sum_tallies([each.segmentations[table_slice] for each in tallies])
        for table_slice in options.slices
        if table_slice.includes_cells and classes
    }
    has_tracks = any(len(each.tracks[options.slices[0]].predictions) for each in tallies)
    nuscenes = [each.nuscenes for each in tallies if each.nuscenes is not None]
    return Evaluation(
        options=options,
        frames={each.scene: each.frames for each in tallies},
        answered_boxes=boxes,
        answered_grids=grids,
        detections={
            table_slice: detection_result(total, options.detection) for table_slice, total in detections.items()
        },
        curves=_curves(detections[options.slices[0]], options) if detections else {},
        segmentations=cells,
        grid_classes=tuple(name for name in BEV_CLASSES if name in classes),
        nuscenes=nuscenes_result(nuscenes_merge(nuscenes)) if nuscenes else None,
        left_out=reduce(LeftOut.plus, (each.left_out for each in tallies)),
        trackings={
            table_slice: tracking_result([each.tracks[table_slice] for each in tallies])
            for table_slice in options.slices
            if table_slice.includes_tracks and has_tracks
        },
    )


@dataclass(frozen=True, slots=True)
class _SceneTask:
    """Tallies one scene in any process."""

    predictions: PredictionSet
    options: EvaluationOptions

    def __call__(self, scene: Scene) -> SceneTally:
        predicted = self.predictions.scene(scene.name, scene.stamps_ns)
        return evaluate_scene(scene, predicted, self.options, grids=self.predictions.has_grids)


def _sum_tallies(tallies: Sequence[SegmentationTally]) -> SegmentationTally:
    return sum(tallies, empty_tally())


def _curves(total: DetectionTally, options: EvaluationOptions) -> dict[tuple[int, int], Curve]:
    """Precision-recall curves of all classes that occur, thinned out evenly."""
    thresholds = len(options.detection.thresholds)
    return {
        (label, column): _thin_curve(precision_recall(total, label, column))
        for label in np.flatnonzero(total.truths).tolist()
        for column in range(thresholds)
    }


def _thin_curve(curve: Curve) -> Curve:
    kept = np.unique(np.linspace(0, len(curve.score) - 1, min(_CURVE_POINTS, len(curve.score))).astype(np.int64))
    return Curve(curve.score[kept], curve.precision[kept], curve.recall[kept])
