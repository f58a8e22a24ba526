"""Worst frames of made-up tables, and the outcomes of the boxes of one frame, by hand."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import evaluated_dataset as made
import numpy as np
import pytest

from simbev_ros.dataset import open_dataset
from simbev_ros.evaluation.filters import BoxFilter
from simbev_ros.evaluation.metrics.boxes import Predictions
from simbev_ros.evaluation.metrics.detection import HIT, MISS, UNCOUNTED, DetectionOptions
from simbev_ros.evaluation.options import EvaluationOptions
from simbev_ros.evaluation.predictions.dataset_predictions import open_predictions, write_predictions
from simbev_ros.evaluation.scene_boxes import found_column
from simbev_ros.evaluation.scene_evaluation import FRAME_DTYPE, outcomes_of
from simbev_ros.evaluation.slices import TableSlice
from simbev_ros.evaluation.worst_frames import worst_frames, worst_grids
from simbev_ros.foundation.types import Table

_OFF_M = np.array([[0.0, 9.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])


def frames(rows: Sequence[tuple[int, int, int, float]], answered: Sequence[bool] | bool = True) -> Table:
    """Frames from rows of tick, boxes, found and IoU."""
    table = np.zeros(len(rows), FRAME_DTYPE)
    for name, values in zip(("tick", "boxes", "found", "iou"), zip(*rows, strict=True), strict=True):
        table[name] = values
    table["answered_boxes"] = table["answered_grid"] = answered
    return table


def test_the_worst_frame_misses_most_boxes_then_finds_the_smaller_share() -> None:
    by_scene = {
        "b": frames([(0, 9, 5, 0.5), (1, 10, 3, 0.5), (2, 4, 4, 0.5)]),
        "a": frames([(0, 6, 2, 0.5), (1, 0, 0, 0.5), (2, 4, 0, 0.5), (3, 9, 5, 0.5)]),
    }
    chosen = worst_frames(by_scene, 9, lambda scene: 1)
    assert [(each.scene, each.tick) for each in chosen] == [("b", 1), ("a", 2), ("a", 0), ("a", 3), ("b", 0)]
    assert chosen[0].boxes == 10 and chosen[0].found == 3
    assert worst_frames(by_scene, 2, lambda scene: 1) == chosen[:2]


def test_neighboring_frames_of_a_scene_are_skipped() -> None:
    rows = [(tick, 100 - tick, 0, 0.01 * tick) for tick in range(8)]
    by_scene = {"a": frames(rows), "b": frames([(1, 96, 0, 0.9)])}
    assert [each[:2] for each in worst_frames(by_scene, 9, {"a": 3, "b": 5}.__getitem__)] == [
        *(("a", 0), ("a", 3), ("b", 1), ("a", 6))
    ]


def test_unanswered_frames_are_skipped() -> None:
    by_scene = {"a": frames([(0, 9, 0, 0.0), (1, 3, 1, 0.4)], [False, True])}
    assert [each.tick for each in worst_frames(by_scene, 9, lambda scene: 1)] == [1]
    assert [each.tick for each in worst_grids(by_scene, 9, lambda scene: 1)] == [1]


def test_the_worst_grids_have_the_lowest_iou() -> None:
    by_scene = {"a": frames([(0, 1, 1, np.nan), (1, 1, 1, 0.5), (2, 1, 1, 1.0)]), "b": frames([(0, 1, 0, 0.25)])}
    chosen = worst_grids(by_scene, 9, lambda scene: 1)
    assert [(each.scene, each.tick, each.iou) for each in chosen] == [("b", 0, 0.25), ("a", 1, 0.5)]


@pytest.mark.parametrize(
    ("options", "column"),
    [
        (DetectionOptions(), 9),
        (DetectionOptions(distances_m=(1.0,)), 0),
        (DetectionOptions(ious=(), distances_m=(4.0, 2.0)), 1),
    ],
)
def test_single_frames_are_judged_at_two_meters_if_available(options: DetectionOptions, column: int) -> None:
    assert found_column(options) == column


def test_outcomes_of_the_boxes_of_a_frame(tmp_path: Path) -> None:
    """The most confident guess is a false positive and displaces one of two cars, both predicted correctly."""
    scene = open_dataset(made.record(tmp_path / "set")).scenes[0]
    boxes = made.truth().take(np.array([3, 3, 4]))
    guesses = Predictions(replace(boxes, center_m=boxes.center_m + _OFF_M), np.array([0.9, 0.8, 0.5]))
    write_predictions(tmp_path / "boxes.parquet", [(scene.name, guesses)])
    predicted = open_predictions(tmp_path / "boxes.parquet").scene(scene.name, scene.stamps_ns)
    outcomes = outcomes_of(scene, predicted, 1, EvaluationOptions())
    assert outcomes.counted.all() and outcomes.found.tolist() == [True, False, False]
    assert outcomes.outcome.tolist() == [MISS, HIT, HIT] and outcomes.taken.tolist() == [True, True, False]
    near = outcomes_of(scene, predicted, 1, EvaluationOptions((TableSlice(boxes=BoxFilter(range_m=(0.0, 60.0))),)))
    assert near.counted.tolist() == [True, False, True] and not near.found.any()
    assert near.outcome.tolist() == [MISS, HIT, UNCOUNTED] and near.taken.tolist() == [True, False, False]
