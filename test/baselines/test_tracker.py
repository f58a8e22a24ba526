"""Boxes keep the ids of their tracks while they move as predicted; others get new ones."""

from typing import Any

import numpy as np
import pytest
from made_up_boxes import some_boxes

from simbev_ros.baselines.boxes import BOX_DTYPE, DETECTED_CLASSES
from simbev_ros.baselines.tracked_predictions import track_predictions
from simbev_ros.baselines.tracker import Tracker, _settings
from simbev_ros.evaluation.metrics.boxes import NO_TRACK, Predictions
from simbev_ros.foundation.semantics import BOX_CLASSES
from simbev_ros.foundation.types import Table

CAR, PEDESTRIAN = 0, 5


def boxes(*rows: tuple[float, ...]) -> Table:
    """Boxes with x, y, velocity along x, class, and score, by default 0.9."""
    table = np.zeros(len(rows), BOX_DTYPE)
    for box, (x, y, vx, label, *score) in zip(table, rows, strict=True):
        box["x"], box["y"], box["vx"], box["class"], box["score"] = x, y, vx, label, *(score or [0.9])
    return table


def ids_of(tracker: Tracker, stamp_s: float, *rows: tuple[float, ...]) -> list[int]:
    ids: list[int] = tracker.step(boxes(*rows), stamp_s).id.tolist()
    return ids


def test_a_box_that_moves_at_its_velocity_keeps_its_id() -> None:
    tracker = Tracker()
    assert ids_of(tracker, 1.0, (0, 0, 20, CAR), (0, 5, 0, CAR)) == [1, 2]
    assert ids_of(tracker, 1.5, (0.1, 5, 0, CAR), (10, 0, 20, CAR)) == [2, 1]


def test_ids_go_to_the_nearest_box_of_the_same_class() -> None:
    tracker = Tracker()
    ids_of(tracker, 1.0, (0, 0, 0, CAR))
    assert ids_of(tracker, 1.1, (0.1, 0, 0, PEDESTRIAN), (1.5, 0, 0, CAR), (-0.5, 0, 0, CAR)) == [2, 3, 1]


def test_the_gate_is_that_of_the_class() -> None:
    for label, is_same in ((CAR, True), (PEDESTRIAN, False)):
        tracker = Tracker()
        ids_of(tracker, 1.0, (0, 0, 0, label))
        assert (ids_of(tracker, 1.05, (1.8, 0, 0, label)) == [1]) is is_same


def test_an_object_keeps_its_id_when_it_is_missed_for_a_moment_only() -> None:
    tracker = Tracker()
    ids_of(tracker, 1.0, (0, 0, 0, CAR))
    assert ids_of(tracker, 1.5) == []
    assert ids_of(tracker, 2.0, (0, 0, 0, CAR)) == [1]
    ids_of(tracker, 3.0)
    assert ids_of(tracker, 3.8, (0, 0, 0, CAR)) == [2]


def test_ids_are_new_when_time_goes_back() -> None:
    tracker = Tracker()
    assert ids_of(tracker, 5.0, (0, 0, 0, CAR)) == [1]
    assert ids_of(tracker, 1.0, (0, 0, 0, CAR)) == [2]


def test_an_uncertain_box_gets_an_id_with_the_second_one_in_a_row() -> None:
    tracker = Tracker()
    assert ids_of(tracker, 1.0, (0, 0, 0, CAR, 0.12)) == [NO_TRACK]
    assert ids_of(tracker, 1.1) == []
    assert ids_of(tracker, 1.2, (0, 0, 0, CAR, 0.12)) == [NO_TRACK]
    assert ids_of(tracker, 1.3, (0, 0, 0, CAR, 0.12)) == [2]


def test_a_weak_box_continues_a_track_but_starts_none_and_gives_way_to_a_strong_one() -> None:
    tracker = Tracker()
    ids_of(tracker, 1.0, (0, 0, 0, CAR))
    assert ids_of(tracker, 1.1, (0, 0, 0, CAR, 0.07), (9, 0, 0, CAR, 0.07)) == [1, NO_TRACK]
    assert ids_of(tracker, 1.2, (0, 0, 0, CAR, 0.07), (0.8, 0, 0, CAR, 0.5)) == [NO_TRACK, 1]
    assert ids_of(tracker, 1.3, (9, 0, 0, CAR, 0.07)) == [NO_TRACK]


def test_velocity_comes_from_motion_where_the_detector_knows_none() -> None:
    tracker, unknown = Tracker(), boxes((0, 0, np.nan, CAR))
    for tick in range(20):
        unknown["x"], unknown["vy"] = 0.5 * tick, np.nan
        tracked = tracker.step(unknown, 1.0 + 0.1 * tick)
    assert tracked.id.tolist() == [1]
    assert tracked.velocity_mps == pytest.approx(np.array([[5.0, 0.0]]), abs=0.2)


def test_the_filter_lessens_the_noise_of_detected_velocities() -> None:
    rng, tracker, errors = np.random.default_rng(1), Tracker(), list[tuple[float, float]]()
    for tick in range(60):
        box = boxes((8.0 * 0.1 * tick + rng.normal(0, 0.2), rng.normal(0, 0.2), 8 + rng.normal(0, 1.5), CAR))
        tracked = tracker.step(box, 0.1 * tick)
        errors.append((abs(float(box["vx"][0]) - 8), abs(float(tracked.velocity_mps[0, 0]) - 8)))
    detected, filtered = np.mean(errors[10:], axis=0)
    assert filtered < 0.5 * detected


def test_whole_scenes_are_tracked_frame_by_frame() -> None:
    columns: dict[str, Any] = {"frame": [0, 2, 2, 4], "velocity_mps": [[10, 0, 1]] * 4}
    found = some_boxes([(0, 0, 0), (50, 0, 0), (10, 0, 0), (20, 0, 0)], **columns)
    tracked = track_predictions(Predictions(found, np.full(4, 0.8)), {0: 1.0, 2: 2.0, 4: 3.0})
    assert tracked.boxes.track.tolist() == [1, 2, 1, 1]
    assert tracked.boxes.velocity_mps[:, 2].tolist() == [1] * 4
    again = track_predictions(Predictions(found, np.full(4, 0.8)), {0: 1.0, 2: 2.0, 4: 3.0})
    assert again.boxes.velocity_mps.tobytes() == tracked.boxes.velocity_mps.tobytes()


def test_settings_are_those_of_the_detected_classes() -> None:
    known = np.flatnonzero(np.isfinite(_settings()["birth_score"]))
    assert [BOX_CLASSES[label] for label in known] == list(DETECTED_CLASSES)
