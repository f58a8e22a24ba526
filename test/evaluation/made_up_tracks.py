"""Tracks for tests of the tracking metrics: hand-made ones, and random ones with misses, switches and ghosts."""

import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from made_up_boxes import some_boxes

from simbev_ros.evaluation.metrics.boxes import Boxes, Predictions
from simbev_ros.evaluation.metrics.scene_matching import CountedBoxes
from simbev_ros.evaluation.metrics.tracks import SceneTracks, scene_tracks
from simbev_ros.foundation.semantics import BOX_CLASSES

CLASSES = ("car", "pedestrian")
FRAMES, OBJECTS, GHOSTS, SIDE_M = 25, 16, 5, 16.0
Scene = tuple[Boxes, Predictions]


def tracked(rows: Sequence[tuple[int, int, float, float]], label: str = "car") -> Boxes:
    """Boxes from rows of frame, track, x and y."""
    table = np.array(rows, np.float64).reshape(-1, 4)
    centers_m = np.column_stack([table[:, 2:], np.zeros(len(table))])
    columns = {"frame": table[:, 0], "label": BOX_CLASSES.index(label)}
    boxes = some_boxes(centers_m.tolist(), **columns)
    boxes.track[:] = table[:, 1]
    return boxes


def all_count(truth: Boxes, predictions: Predictions) -> SceneTracks:
    """Tracks of a scene of which every box counts."""
    counting = CountedBoxes(np.ones(len(truth), np.bool_), np.ones(len(predictions), np.bool_))
    return scene_tracks(truth, predictions, counting)


def random_scenes(seed: int, scenes: int = 2) -> list[Scene]:
    """Crowded scenes, with random gaps, switches of tracks, ghosts, and scores that differ by track and box."""
    rng = np.random.default_rng(seed)
    return [_random_scene(rng) for _ in range(scenes)]


def _random_scene(rng: np.random.Generator) -> Scene:
    truth, found, score = list[Boxes](), list[Boxes](), list[Any]()
    for number, name in enumerate(CLASSES):
        first = 1000 * number
        start_m, step_m = rng.uniform(0, SIDE_M, (OBJECTS, 2)), rng.normal(0, 0.4, (OBJECTS, 2))
        track, quality = first + np.arange(OBJECTS), rng.uniform(0.2, 0.9, OBJECTS)
        new_track, rows, predicted = first + 100, [], []
        ghosts_m, ghost_score = rng.uniform(0, SIDE_M, (GHOSTS, 2)), rng.uniform(0.05, 0.6, GHOSTS)
        for frame in range(FRAMES):
            for index in range(OBJECTS):
                x, y = start_m[index] + frame * step_m[index]
                if rng.random() < 0.9:
                    rows.append((frame, first + index, x, y))
                if rng.random() < 0.05:
                    track[index], new_track = new_track, new_track + 1
                if rng.random() < 0.8:
                    predicted.append((frame, int(track[index]), *(rng.normal(0, 0.5, 2) + np.array([x, y]))))
                    score.append(quality[index] + rng.normal(0, 0.1))
            for index in np.flatnonzero(rng.random(GHOSTS) < 0.6).tolist():
                predicted.append((frame, first + 500 + index, *(ghosts_m[index] + rng.normal(0, 0.2, 2))))
                score.append(ghost_score[index])
        truth.append(tracked(rows, name))
        found.append(tracked(predicted, name))
    return _joined(truth), Predictions(_joined(found), np.array(score))


def _joined(parts: Sequence[Boxes]) -> Boxes:
    names = Boxes.__dataclass_fields__
    boxes = Boxes(*(np.concatenate([getattr(each, name) for each in parts]) for name in names))
    return boxes.take(np.argsort(boxes.frame, kind="stable"))


def as_json(scenes: Sequence[Scene]) -> str:
    """Scenes for programs that know nothing of this project: rows of class, frame, track, x, y and score."""
    return json.dumps(
        [
            {"frames": FRAMES, "truth": _rows(truth, {}), "predictions": _rows(each.boxes, {"score": each.score})}
            for truth, each in scenes
        ]
    )


def _rows(boxes: Boxes, more: Mapping[str, Any]) -> list[list[Any]]:
    names = [BOX_CLASSES[label] for label in boxes.label]
    columns = [boxes.frame, boxes.track, boxes.center_m[:, 0], boxes.center_m[:, 1], *more.values()]
    return [[name, *row] for name, *row in zip(names, *(column.tolist() for column in columns), strict=True)]
