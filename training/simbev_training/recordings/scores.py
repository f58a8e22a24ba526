"""Scores boxes against the labels of a recording: average precision by distance, with bootstrap intervals.

Predictions and labels match within 2 m on the ground, as in nuScenes at that threshold; the area under the curve is
that of its envelope. Only labels within a distance and with enough points of the newest sweep count.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from simbev_ros.baselines.boxes import DETECTED_CLASSES
from simbev_ros.baselines.recordings.model_inputs import FrameView
from simbev_ros.baselines.recordings.recording import OTHER_CLASS, Labels, boxes_in_frame
from simbev_ros.evaluation.metrics.boxes import Predictions
from simbev_ros.evaluation.metrics.detection import (
    HIT,
    DetectionOptions,
    DetectionTally,
    detection_result,
    merge_tallies,
)
from simbev_ros.evaluation.metrics.scene_matching import CountedBoxes, Matching
from simbev_ros.foundation.geometry.transforms import apply
from simbev_ros.foundation.random import stream
from simbev_ros.foundation.semantics import BOX_CLASSES
from simbev_ros.foundation.types import AnyArray, BoolArray, Int64Array, Table
from simbev_training.predict import metric_boxes

RANGE_M = 50.0
DISTANCE_M = 2.0
_MARGIN_M = 0.1
_OPTIONS = DetectionOptions(ious=(), distances_m=(DISTANCE_M,), planar=True, area="envelope")
_CAR, _VEHICLES = BOX_CLASSES.index("car"), [BOX_CLASSES.index(name) for name in ("car", "truck", "bus")]
_DRAWS, _SPAN = 200, (2.5, 97.5)

FrameTallies = tuple[DetectionTally, DetectionTally]
"""What a frame counts by class, and with cars, trucks and buses as one class."""


@dataclass(frozen=True)
class Score:
    """Scores of a class.

    Attributes:
        name: Its name.
        boxes: Number of labels that count.
        precision: Average precision.
        interval: Limits of 95 % of it if other frames had been recorded: bootstrap; None: there is one frame.
        recall: Share of the labels that have a prediction, however low its score.
    """

    name: str
    boxes: int
    precision: float
    interval: tuple[float, float] | None
    recall: float


def frame_tallies(boxes: Table, labels: Labels, view: FrameView, min_points: int) -> FrameTallies | None:
    """Match a frame's boxes with its labels; None if what is labeled cannot be told, as the image is missing.

    Args:
        boxes: (M,) ``baselines.boxes.BOX_DTYPE``, ego frame.
        labels: Its labels.
        view: What the frame shows.
        min_points: Number of points of the newest sweep from which on a label counts.
    """
    if labels.only_in_image and not view.photos:
        return None
    truth = boxes_in_frame(labels.boxes, view.ego_from_lidar)
    is_known = truth["class"] != OTHER_CLASS
    counts = is_known & _is_labeled(truth, labels, view) & (points_inside(truth, view.points) >= min_points)
    judged = _is_labeled(boxes, labels, view)
    # An object of another class excuses a prediction of any class.
    others = np.repeat(truth[~is_known], len(DETECTED_CLASSES))
    others["class"] = np.tile(np.arange(len(DETECTED_CLASSES)), np.count_nonzero(~is_known))
    truth = np.concatenate([truth[is_known], others])
    counting = CountedBoxes(np.concatenate([counts[is_known], np.zeros(len(others), np.bool_)]), judged)
    by_class = _tally(truth, boxes, counting)
    return by_class, _tally(_with_one_class(truth), _with_one_class(boxes), counting)


def scores(frames: Sequence[FrameTallies]) -> list[Score]:
    """Scores of all classes with labels that count, and of cars, trucks and buses as one class."""
    if not frames:
        return []
    chosen = stream(0, "recordings.bootstrap").integers(0, len(frames), (_DRAWS if len(frames) > 1 else 0, len(frames)))
    found = []
    for index, labels in ((0, range(len(DETECTED_CLASSES))), (1, [_CAR])):
        tallies = [frame[index] for frame in frames]
        total = merge_tallies(tallies)
        precision = detection_result(total, _OPTIONS).ap[:, 0]
        drawn = [
            detection_result(merge_tallies([tallies[i] for i in row]), _OPTIONS).ap[:, 0] for row in chosen.tolist()
        ]
        for label in labels:
            if truths := int(total.truths[label]):
                name = BOX_CLASSES[label] if index == 0 else "car, truck, bus as one"
                hits = np.count_nonzero(total.outcome[total.label == label, 0] == HIT)
                interval = _interval([each[label] for each in drawn])
                found.append(Score(name, truths, float(precision[label]), interval, hits / truths))
    return found


def points_inside(boxes: Table, points: AnyArray) -> Int64Array:
    """(N,) number of points of the newest sweep in (N,) boxes, with a margin of 10 cm, because labels are coarse."""
    newest, counts = points[points[:, 3] == 0, :3].astype(np.float64), np.zeros(len(boxes), np.int64)
    for index, box in enumerate(boxes):
        offset = newest - [box["x"], box["y"], box["z"]]
        cosine, sine = np.cos(box["yaw"]), np.sin(box["yaw"])
        along = np.stack([offset @ [cosine, sine, 0.0], offset @ [-sine, cosine, 0.0], offset[:, 2]], axis=1)
        half_m = np.array([box["length"], box["width"], box["height"]]) / 2.0 + _MARGIN_M
        counts[index] = np.count_nonzero((np.abs(along) < half_m).all(1))
    return counts


def _tally(truth: Table, boxes: Table, counting: CountedBoxes) -> DetectionTally:
    frame = np.zeros(1, np.int64)
    predictions = Predictions(metric_boxes(boxes, 0), boxes["score"].astype(np.float64))
    return Matching(metric_boxes(truth, 0), predictions, frame, _OPTIONS).tally(counting)


def _with_one_class(boxes: Table) -> Table:
    """The boxes, with trucks and buses as cars."""
    result = boxes.copy()
    result["class"][np.isin(boxes["class"], _VEHICLES)] = _CAR
    return result


def _is_labeled(boxes: Table, labels: Labels, view: FrameView) -> BoolArray:
    """(N,) whether boxes are where the frame is labeled."""
    near: BoolArray = np.hypot(boxes["x"], boxes["y"]) < RANGE_M
    if not labels.only_in_image:
        return near
    photo = next(iter(view.photos.values()))
    center = apply(photo.optical_from_ego, np.stack([boxes["x"], boxes["y"], boxes["z"]], 1))
    near &= center[:, 2] > 1.0
    pixels = photo.camera.project(np.where(near[:, None], center, 1.0))
    near &= ((pixels > 0) & (pixels < [photo.camera.width_px, photo.camera.height_px])).all(1)
    left, top, right, bottom = labels.unlabeled_px.T[..., None]
    column, row = pixels.T
    return near & ~((left < column) & (column < right) & (top < row) & (row < bottom)).any(0)


def _interval(drawn: Sequence[float]) -> tuple[float, float] | None:
    known = [value for value in drawn if not np.isnan(value)]
    if not known:
        return None
    low, high = np.percentile(known, _SPAN)
    return float(low), float(high)
