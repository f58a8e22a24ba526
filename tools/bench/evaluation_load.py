"""Synthetic scenes to evaluate: as many boxes as in the paper, along two crossing streets, with predictions."""

from dataclasses import replace

import numpy as np

from simbev_ros.evaluation.metrics.boxes import NO_ATTRIBUTE, Boxes, Predictions
from simbev_ros.foundation.random import stream
from simbev_ros.foundation.semantics import BOX_CLASSES
from simbev_ros.foundation.types import Float64Array, Int64Array

SCENES, FRAMES, BOXES = 320, 320, 81
"""Numbers of the paper: scenes, frames per scene, boxes per frame."""

_REACH_M, _STREET_M = 120.0, 12.0
_PEOPLE = 0.45
_FOUND, _STRAY = 0.8, 0.3
"""Shares relative to the number of boxes: boxes that are predicted, and false positives."""
_OFF = 0.3
"""Standard deviations of predictions: positions in m, yaws in rad, velocities in m/s."""


def synthetic_scene(seed: int, frames: int = FRAMES, per_frame: int = BOXES) -> tuple[Boxes, Predictions]:
    """Ground truth and predictions of a scene whose frames are numbered from 0."""
    rng = stream(seed, "evaluation_load")
    truth = _boxes(rng, np.repeat(np.arange(frames), per_frame))
    found = _predicted(rng, truth.take(rng.random(len(truth)) < _FOUND))
    stray = _boxes(rng, np.sort(rng.integers(0, frames, round(_STRAY * len(truth)))))
    predicted = Boxes(*(np.concatenate(columns) for columns in zip(_columns(found), _columns(stray), strict=True)))
    score = np.concatenate([rng.beta(4, 2, len(found)), rng.beta(2, 4, len(stray))])
    order = np.argsort(predicted.frame, kind="stable")
    return truth, Predictions(predicted.take(order), score[order])


def _boxes(rng: np.random.Generator, frame: Int64Array) -> Boxes:
    count = len(frame)
    place_m = np.column_stack([rng.uniform(-_REACH_M, _REACH_M, count), rng.uniform(-_STREET_M, _STREET_M, count)])
    is_across = rng.random(count) < 0.5
    center_m = np.column_stack([np.where(is_across[:, None], place_m[:, ::-1], place_m), np.full(count, 0.9)])
    is_person = rng.random(count) < _PEOPLE
    vehicles = [BOX_CLASSES.index(name) for name in ("car", "car", "car", "truck", "bus", "motorcycle", "bicycle")]
    label = np.where(is_person, BOX_CLASSES.index("pedestrian"), rng.choice(vehicles, count))
    size_m = np.where(is_person[:, None], [0.6, 0.6, 1.8], [4.6, 1.9, 1.7]) * rng.uniform(0.8, 1.4, (count, 3))
    yaw_rad = np.where(is_across, np.pi / 2, 0.0) + rng.choice(np.array([0.0, np.pi]), count)
    speed_mps = rng.uniform(0, 12, count)
    velocity_mps = np.column_stack([np.cos(yaw_rad) * speed_mps, np.sin(yaw_rad) * speed_mps, np.zeros(count)])
    attribute = np.full(count, NO_ATTRIBUTE, np.uint8)
    return Boxes(frame, label.astype(np.uint8), center_m, size_m, yaw_rad, velocity_mps, attribute)


def _predicted(rng: np.random.Generator, boxes: Boxes) -> Boxes:
    def off(*shape: int) -> Float64Array:
        return rng.normal(0.0, _OFF, shape)

    count = len(boxes)
    return replace(
        boxes,
        center_m=boxes.center_m + off(count, 3),
        size_m=boxes.size_m * np.exp(off(count, 3) / 3),
        yaw_rad=boxes.yaw_rad + off(count) / 3,
        velocity_mps=boxes.velocity_mps + off(count, 3),
    )


def _columns(boxes: Boxes) -> tuple[np.ndarray, ...]:
    return (
        boxes.frame,
        boxes.label,
        boxes.center_m,
        boxes.size_m,
        boxes.yaw_rad,
        boxes.velocity_mps,
        boxes.attribute,
    )
