"""Evaluates one recorded scene offline.

The result is a ``SceneTally`` with the scene's counts for every row of every table, computed from the recorded ground
truth and the predictions. The metrics of a dataset are computed from the tallies of all scenes.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from simbev_ros.config.evaluation import Truth
from simbev_ros.dataset import Scene
from simbev_ros.dataset.parallel import report_step
from simbev_ros.evaluation.joint_truth import truth_key
from simbev_ros.evaluation.metrics.boxes import Predictions
from simbev_ros.evaluation.metrics.detection import DetectionTally
from simbev_ros.evaluation.metrics.nuscenes import NuscenesTally, nuscenes_tally
from simbev_ros.evaluation.metrics.nuscenes_truth import nuscenes_truth
from simbev_ros.evaluation.metrics.segmentation import SegmentationTally
from simbev_ros.evaluation.metrics.tracks import SceneTracks
from simbev_ros.evaluation.options import EvaluationOptions
from simbev_ros.evaluation.predictions.dataset_predictions import PredictedScene, boxes_in_map
from simbev_ros.evaluation.predictions.reference_frames import ReferenceFrames
from simbev_ros.evaluation.scene_boxes import GroundTruthFrame, LeftOut, Outcomes, SceneBoxes
from simbev_ros.evaluation.scene_grids import SceneGrids
from simbev_ros.evaluation.slices import Conditions, TableSlice
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.types import Table

FRAME_DTYPE = np.dtype(
    [
        ("tick", "<i4"),
        ("boxes", "<i4"),  # number of ground-truth boxes that count
        ("found", "<i4"),  # how many of them the top predictions of their classes find (``ranking.top_predictions``)
        ("iou", "<f4"),  # mean IoU of the classes at the table's threshold; NaN: no grids, or all are empty
        ("answered_boxes", "?"),  # whether the stack answered about boxes, possibly that there are none
        ("answered_grid", "?"),
    ]
)
"""Result of one evaluated frame."""


@dataclass(frozen=True, slots=True, eq=False)
class SceneTally:
    """Counts of one scene that the tables need.

    Attributes:
        scene: Name of the scene.
        frames: (F,) ``FRAME_DTYPE``.
        detections: Detection counts by table slice.
        segmentations: Segmentation counts by table slice that includes cells; empty if grids are not evaluated.
        grid_classes: Classes for which at least one grid has scores.
        nuscenes: Counts of the nuScenes metrics, or None if they were not requested.
        left_out: Numbers of boxes that do not count.
        tracks: Tracked boxes by table slice that includes tracks.
    """

    scene: str
    frames: Table
    detections: Mapping[TableSlice, DetectionTally]
    segmentations: Mapping[TableSlice, SegmentationTally]
    grid_classes: frozenset[str]
    nuscenes: NuscenesTally | None
    left_out: LeftOut
    tracks: Mapping[TableSlice, SceneTracks]


def evaluate_scene(scene: Scene, predicted: PredictedScene, options: EvaluationOptions, *, grids: bool) -> SceneTally:
    """Tally one scene.

    Args:
        scene: The scene, with ground truth.
        predicted: Predictions for the scene; frames without an answer count as missed.
        options: What to evaluate; the first table slice decides which frames are evaluated.
        grids: Whether to evaluate grids, even if this scene has none.

    Raises:
        InputError: The predictions do not fit the scene, or its bag has no ground truth.
        BagError: The bag is damaged.
    """
    base, recorded = options.slices[0], _ticks_with_truth(scene, options.truth, grids=grids)
    ticks = [tick for tick in recorded[:: options.every] if base.has(Conditions.of_tick(scene.spec, tick))]
    frames = np.zeros(len(ticks), FRAME_DTYPE)
    frames["tick"], frames["iou"] = ticks, np.nan
    frames["answered_boxes"] = [tick in predicted.ticks_with_boxes for tick in ticks]
    frames["answered_grid"] = [tick in predicted.ticks_with_grid for tick in ticks]
    cells = SceneGrids(scene.view.annotation.bev.grid, options.slices)
    truth: list[GroundTruthFrame] = []
    for row, tick in enumerate(ticks):
        frame = scene[tick]
        truth.append(GroundTruthFrame.from_frame(frame, options.truth))
        if grids:
            conditions = truth[-1].conditions
            frames["iou"][row] = cells.add_frame(frame["bev/labels"], conditions, predicted.grid(tick), base)
        report_step()
    boxes = _boxes_in_map(scene, predicted)
    scene_boxes = SceneBoxes(scene.view, truth, boxes, options)
    frames["boxes"], frames["found"] = scene_boxes.count_found()
    return SceneTally(
        scene.name,
        frames,
        {table_slice: scene_boxes.tally(table_slice) for table_slice in options.slices},
        cells.tallies if grids else {},
        frozenset(cells.classes),
        _nuscenes(scene, boxes) if options.nuscenes else None,
        scene_boxes.count_left_out(),
        _tracks(scene, scene_boxes),
    )


def _tracks(scene: Scene, boxes: SceneBoxes) -> dict[TableSlice, SceneTracks]:
    try:
        return boxes.tracks()
    except InputError as error:
        raise InputError(f"predictions of {scene.name}: {error}; files may not share ids") from None


def _boxes_in_map(scene: Scene, predicted: PredictedScene) -> Predictions:
    """Predicted boxes at the ticks with the poses of the agents of their frames."""
    boxes, frames = predicted.boxes(), ReferenceFrames.from_scene(scene)
    others = frames.agents_of(each.frame_id for each in boxes.references) - {scene.agent}
    with_poses = _ticks_with(scene, ("odom", *(f"{name}/odom" for name in sorted(others))))
    return boxes_in_map(boxes.at_ticks(with_poses), frames)


def _ticks_with_truth(scene: Scene, truth: Truth, *, grids: bool) -> list[int]:
    """Ticks of the frames that have all required ground truth; live recordings may lack some of it."""
    return _ticks_with(scene, ("odom", truth_key(truth), *(("bev/labels",) if grids else ())))


def _ticks_with(scene: Scene, keys: Sequence[str]) -> list[int]:
    """Ticks of the frames that have all of the keys. Raises InputError for a key that no frame has."""
    missing = [key for key in keys if key not in scene.sources]
    if missing:
        raise InputError(f"{scene.path}: cannot be evaluated, because the bag lacks {', '.join(missing)}")
    return np.flatnonzero(scene.has(keys)).tolist()


def outcomes_of(scene: Scene, predicted: PredictedScene, tick: int, options: EvaluationOptions) -> Outcomes:
    """Outcome of every box of one frame, matched as in ``evaluate_scene``.

    Raises:
        InputError: As ``evaluate_scene``.
        BagError: As ``evaluate_scene``.
    """
    boxes = boxes_in_map(predicted.boxes().at_ticks([tick]), ReferenceFrames.from_scene(scene))
    return SceneBoxes(scene.view, [GroundTruthFrame.from_frame(scene[tick], options.truth)], boxes, options).outcomes()


def _nuscenes(scene: Scene, predictions: Predictions) -> NuscenesTally:
    truth = nuscenes_truth(scene)
    return nuscenes_tally(truth.boxes, truth.counted(predictions), truth.ticks)
