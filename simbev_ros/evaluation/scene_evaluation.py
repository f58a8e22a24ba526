"""Evaluating one scene: recorded truth and what is predicted of it in, tallies out, for every row of every table."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from simbev_ros.dataset import Scene
from simbev_ros.dataset.parallel import report_step
from simbev_ros.errors import InputError
from simbev_ros.evaluation.metrics.boxes import Predictions
from simbev_ros.evaluation.metrics.detection import DetectionTally
from simbev_ros.evaluation.metrics.nuscenes import NuscenesTally, nuscenes_tally
from simbev_ros.evaluation.metrics.nuscenes_truth import nuscenes_truth
from simbev_ros.evaluation.metrics.segmentation import SegmentationTally
from simbev_ros.evaluation.options import EvaluationOptions
from simbev_ros.evaluation.predictions.dataset_predictions import PredictedScene, in_map
from simbev_ros.evaluation.predictions.reference_frames import ReferenceFrames
from simbev_ros.evaluation.scene_boxes import Outcomes, SceneBoxes, TrueFrame
from simbev_ros.evaluation.scene_grids import SceneGrids
from simbev_ros.evaluation.slices import Conditions, Cut
from simbev_ros.types import Table

FRAME_DTYPE = np.dtype(
    [
        ("tick", "<i4"),
        ("boxes", "<i4"),  # of the truth that count
        ("found", "<i4"),  # of them by as many surest predictions of their classes (``ranking.surest``)
        ("iou", "<f4"),  # mean of the classes' IoU at the table's threshold; NaN: no grids, or all are empty
        ("answered_boxes", "?"),  # whether anything is said about boxes, be it that there are none
        ("answered_grid", "?"),
    ]
)
"""One evaluated frame."""


@dataclass(frozen=True, slots=True, eq=False)
class SceneTally:
    """What the tables need of one scene.

    Attributes:
        scene: Its name.
        frames: (F,) ``FRAME_DTYPE``.
        detections: By cut.
        segmentations: By cut that says something of cells; empty: grids are not evaluated.
        grid_classes: Those that some grid has scores of.
        nuscenes: None: it is not asked for.
    """

    scene: str
    frames: Table
    detections: Mapping[Cut, DetectionTally]
    segmentations: Mapping[Cut, SegmentationTally]
    grid_classes: frozenset[str]
    nuscenes: NuscenesTally | None


def evaluate_scene(scene: Scene, predicted: PredictedScene, options: EvaluationOptions, *, grids: bool) -> SceneTally:
    """Tally one scene.

    Args:
        scene: With the truth.
        predicted: What is said of it; frames of which nothing is said count as missed.
        options: What is evaluated; its first cut decides which frames are.
        grids: Whether grids are evaluated, although there may be none of this scene.

    Raises:
        InputError: What is predicted does not fit the scene, or its bag has no truth.
        BagError: The bag is damaged.
    """
    base, recorded = options.cuts[0], _ticks_with_truth(scene, grids=grids)
    ticks = [tick for tick in recorded[:: options.every] if base.has(Conditions.of(scene.spec.weather_at(tick)))]
    frames = np.zeros(len(ticks), FRAME_DTYPE)
    frames["tick"], frames["iou"] = ticks, np.nan
    frames["answered_boxes"] = [tick in predicted.ticks_with_boxes for tick in ticks]
    frames["answered_grid"] = [tick in predicted.ticks_with_grid for tick in ticks]
    cells = SceneGrids(scene.spec.annotation.bev.grid, options.cuts)
    truth: list[TrueFrame] = []
    for row, tick in enumerate(ticks):
        frame = scene[tick]
        truth.append(TrueFrame.of(frame))
        if grids:
            conditions = truth[-1].conditions
            frames["iou"][row] = cells.add(frame["bev/labels"], conditions, predicted.grid(tick), base)
        report_step()
    with_pose = np.flatnonzero(scene.has(("odom",))).tolist()
    boxes = in_map(predicted.boxes().of_ticks(with_pose), ReferenceFrames.of(scene))
    scene_boxes = SceneBoxes(scene.spec, truth, boxes, options)
    frames["boxes"], frames["found"] = scene_boxes.found()
    return SceneTally(
        scene.name,
        frames,
        {cut: scene_boxes.tally(cut) for cut in options.cuts},
        cells.tallies if grids else {},
        frozenset(cells.classes),
        _nuscenes(scene, boxes) if options.nuscenes else None,
    )


def _ticks_with_truth(scene: Scene, *, grids: bool) -> list[int]:
    """Ticks of frames that were recorded with all that is to be compared; of a live scene some may lack it."""
    keys = ("odom", "boxes", *(("bev/labels",) if grids else ()))
    missing = [key for key in keys if key not in scene.sources]
    if missing:
        raise InputError(f"{scene.path}: cannot be evaluated, as nothing was recorded of {', '.join(missing)}")
    ticks: list[int] = np.flatnonzero(scene.has(keys)).tolist()
    return ticks


def outcomes_of(scene: Scene, predicted: PredictedScene, tick: int, options: EvaluationOptions) -> Outcomes:
    """What became of each box of one frame, as in ``evaluate_scene``. Raises as that does."""
    boxes = in_map(predicted.boxes().of_ticks([tick]), ReferenceFrames.of(scene))
    return SceneBoxes(scene.spec, [TrueFrame.of(scene[tick])], boxes, options).outcomes()


def _nuscenes(scene: Scene, predictions: Predictions) -> NuscenesTally:
    truth = nuscenes_truth(scene)
    return nuscenes_tally(truth.boxes, truth.counted(predictions), truth.ticks)
