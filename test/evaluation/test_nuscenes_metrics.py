"""The nuScenes metrics equal nuscenes-devkit's own numbers."""

import io
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from made_up_boxes import random_predictions, random_truth, some_boxes
from rich.console import Console

from simbev_ros.cli.evaluate.tables import print_tables
from simbev_ros.evaluation.figures import _nuscenes
from simbev_ros.evaluation.metrics.boxes import Boxes, Predictions, empty_boxes
from simbev_ros.evaluation.metrics.nuscenes import (
    CLASSES,
    DISTANCES_M,
    ERRORS,
    NuscenesResult,
    nuscenes_merge,
    nuscenes_result,
    nuscenes_tally,
)
from simbev_ros.evaluation.tables import nuscenes_table
from simbev_ros.foundation.semantics import BOX_CLASSES
from tools.bench.devkit_comparison import devkit_numbers, devkit_python

DEVKIT_NAMES = ("trans_err", "orient_err", "scale_err", "vel_err", "attr_err")
ATTRIBUTES = ("vehicle.moving", "vehicle.parked", "vehicle.stopped")
FRAMES, PER_FRAME = 12, 120


def devkit_classes_only(boxes: Boxes) -> Boxes:
    """Boxes without lights and signs, which the devkit does not know."""
    return boxes.take(~np.isin(boxes.label, [BOX_CLASSES.index("traffic_light"), BOX_CLASSES.index("traffic_sign")]))


def expected_numbers(truth: Boxes, predictions: Predictions) -> dict[str, Any]:
    python = devkit_python()
    if python is None:
        pytest.skip("no environment with the devkit; test_nuscenes_devkit.py makes it")
    return devkit_numbers(python, truth, predictions, range(FRAMES), ATTRIBUTES)


def compute_metrics(truth: Boxes, predictions: Predictions) -> NuscenesResult:
    return nuscenes_result(nuscenes_tally(truth, predictions, np.arange(FRAMES)))


@pytest.mark.slow
@pytest.mark.parametrize("case", ["random", "sparse", "one class", "low scores", "without predictions"])
def test_numbers_equal_the_devkit(case: str) -> None:
    rng = np.random.default_rng(11)
    truth = devkit_classes_only(random_truth(rng, FRAMES, PER_FRAME))
    if case == "sparse":
        truth = truth.take(rng.random(len(truth)) < 0.1)
    if case == "one class":
        truth = replace(truth, label=np.full(len(truth), BOX_CLASSES.index("barrier"), np.uint8))
    predictions = random_predictions(rng, truth)
    if case == "low scores":
        predictions = Predictions(predictions.boxes, predictions.score.round(1) / 10)
    if case == "without predictions":
        predictions = predictions.take(np.zeros(len(predictions), np.bool_))
    expected, found = expected_numbers(truth, predictions), compute_metrics(truth, predictions)
    assert found.mean_ap == pytest.approx(expected["mean_ap"], abs=1e-9)
    assert found.nds == pytest.approx(expected["nd_score"], abs=1e-9)
    names = dict(zip(ERRORS, DEVKIT_NAMES, strict=True))
    assert found.mean_errors == pytest.approx({name: expected["tp_errors"][names[name]] for name in ERRORS}, abs=1e-9)
    for row, name in enumerate(CLASSES):
        assert found.ap[row].tolist() == pytest.approx([expected["label_aps"][name][str(m)] for m in DISTANCES_M])
        errors = [expected["label_tp_errors"][name][each] for each in DEVKIT_NAMES]
        assert found.errors[row].tolist() == pytest.approx(errors, abs=1e-9, nan_ok=True)


def test_merged_parts_equal_the_whole() -> None:
    rng = np.random.default_rng(12)
    truth = random_truth(rng, FRAMES, PER_FRAME)
    predictions = random_predictions(rng, truth)
    parts = [
        nuscenes_tally(truth.take(truth.frame == k), predictions.take(predictions.boxes.frame == k), np.array([k]))
        for k in range(FRAMES)
    ]
    merged, whole = nuscenes_result(nuscenes_merge(parts)), compute_metrics(truth, predictions)
    np.testing.assert_array_equal(merged.ap, whole.ap)
    np.testing.assert_allclose(merged.errors, whole.errors, rtol=1e-12)


def test_truth_as_prediction_is_perfect_but_for_absent_classes() -> None:
    truth = replace(random_truth(np.random.default_rng(13), 3, 40), attribute=np.zeros(120, np.uint8))
    present = [name for name in CLASSES if name in BOX_CLASSES]
    total = nuscenes_tally(truth, Predictions(truth, np.ones(120)), np.arange(3))
    assert nuscenes_result(total, present).nds == pytest.approx(1.0)
    assert nuscenes_result(total).mean_ap == pytest.approx(0.8)
    occurring = nuscenes_result(total).over_occurring
    assert occurring is not None and set(occurring.classes) == set(CLASSES) - {"trailer", "construction_vehicle"}
    assert occurring.mean_ap == pytest.approx(1.0) and occurring.nds == pytest.approx(1.0)


def test_both_means_are_among_the_figures_and_in_the_title() -> None:
    truth = some_boxes([(0, 0, 0), (30, 0, 0)])
    result = compute_metrics(truth, Predictions(truth, np.ones(2)))
    figures = _nuscenes(result)
    assert figures["mAP"] == pytest.approx(0.1) and figures["occurring"]["mAP"] == pytest.approx(1.0)
    assert {name: values["boxes"] for name, values in figures["classes"].items() if values["boxes"]} == {"car": 2}
    table = nuscenes_table(figures)
    whole, _, occurring = table.title.partition("; over the 1 of 10 classes that occur: ")
    assert whole.startswith("nuScenes: mAP 0.100, NDS ") and occurring.startswith("mAP 1.000, NDS ")
    assert [str(row[0].value) for row in table.rows[:2]] == ["all 10", "the 1 that occur"]
    nothing = _nuscenes(compute_metrics(empty_boxes(), Predictions(truth, np.ones(2))))
    assert nothing["occurring"] is None
    assert nuscenes_table(nothing).title == "nuScenes: mAP 0.000, NDS 0.000"


def test_a_table_in_a_file_is_as_wide_as_it_needs_to_be() -> None:
    truth, file = some_boxes([(0, 0, 0), (30, 0, 0)]), io.StringIO()
    frames = {"evaluated": 1, "scenes": 1, "answered_boxes": 1, "answered_grids": 0}
    figures = {"frames": frames, "nuscenes": _nuscenes(compute_metrics(truth, Predictions(truth, np.ones(2))))}
    print_tables(figures, Console(file=file, width=80))
    assert "construction_vehicle" in file.getvalue() and "…" not in file.getvalue()
    row = next(line.split() for line in file.getvalue().splitlines() if "the 1 that occur" in line)
    assert row[4:7] == ["2", "1.000", "0.000"]


def test_metrics_by_hand() -> None:
    """One of two cars found, 1 m off and 9 m too low: precision is 1 up to a recall of 0.5, 40 of 90 bins."""
    truth = some_boxes([(0, 0, 0), (30, 0, 0)])
    found = Predictions(some_boxes([(1, 0, -9)], yaw_rad=0.2, size_m=(2, 2, 2)), np.array([0.7]))
    result = nuscenes_result(nuscenes_tally(truth, found, np.array([0])), ["car"])
    np.testing.assert_allclose(result.ap, [[0, 0, 40 / 90, 40 / 90]])
    np.testing.assert_allclose(result.errors, [[1.0, 0.2, 0.5, 0.0, 1.0]])
    assert result.nds == pytest.approx((5 * 20 / 90 + 0 + 0.8 + 0.5 + 1 + 0) / 10)


def test_without_truth_all_is_zero() -> None:
    found = Predictions(some_boxes([(1, 0, 0)]), np.array([0.7]))
    assert compute_metrics(empty_boxes(), found).nds == 0.0
