"""nuScenes' metrics: equal to nuscenes-devkit's own numbers."""

import json
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_up_boxes import random_predictions, random_truth, some_boxes

from simbev_ros.evaluation.boxes import NO_ATTRIBUTE, Boxes, Predictions, no_boxes
from simbev_ros.evaluation.nuscenes import (
    CLASSES,
    DISTANCES_M,
    ERRORS,
    NuscenesResult,
    nuscenes_merge,
    nuscenes_result,
    nuscenes_tally,
)
from simbev_ros.maps.cache import default_cache_dir
from simbev_ros.semantics import BOX_CLASSES

NUMBERS = Path(__file__).with_name("devkit_numbers.py")
DEVKIT_NAMES = ("trans_err", "orient_err", "scale_err", "vel_err", "attr_err")
ATTRIBUTES = {0: "vehicle.moving", 1: "vehicle.parked", 2: "vehicle.stopped", NO_ATTRIBUTE: ""}
FRAMES, PER_FRAME = 12, 120


def records(boxes: Boxes, scores: np.ndarray | None) -> dict[str, list[dict[str, Any]]]:
    """As the devkit reads them."""
    result: dict[str, list[dict[str, Any]]] = {str(frame): [] for frame in range(FRAMES)}
    for row in range(len(boxes)):
        half_rad = boxes.yaw_rad[row] / 2
        result[str(boxes.frame[row])].append(
            {
                "sample_token": str(boxes.frame[row]),
                "translation": boxes.center_m[row].tolist(),
                "size": boxes.size_m[row, [1, 0, 2]].tolist(),
                "rotation": [np.cos(half_rad), 0.0, 0.0, np.sin(half_rad)],
                "velocity": boxes.velocity_mps[row, :2].tolist(),
                "detection_name": BOX_CLASSES[boxes.label[row]],
                "detection_score": -1.0 if scores is None else float(scores[row]),
                "attribute_name": ATTRIBUTES[int(boxes.attribute[row])],
            }
        )
    return result


def of_devkit(boxes: Boxes) -> Boxes:
    """Without lights and signs, which the devkit does not know."""
    return boxes.take(~np.isin(boxes.label, [BOX_CLASSES.index("traffic_light"), BOX_CLASSES.index("traffic_sign")]))


def devkit_numbers(truth: Boxes, predictions: Predictions, folder: Path) -> dict[str, Any]:
    python = default_cache_dir() / "nuscenes-devkit-1.2.0/bin/python"
    if not (python.parents[1] / "ready").exists():
        pytest.skip("no environment with the devkit; test_nuscenes_devkit.py makes it")
    content = {"truth": records(truth, None), "predictions": records(predictions.boxes, predictions.score)}
    (folder / "boxes.json").write_text(json.dumps(content))
    words = [python, NUMBERS, folder / "boxes.json", folder / "numbers.json"]
    done = subprocess.run(words, env={"PYTHONPATH": ""}, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    numbers: dict[str, Any] = json.loads((folder / "numbers.json").read_text())
    return numbers


def measured(truth: Boxes, predictions: Predictions) -> NuscenesResult:
    return nuscenes_result(nuscenes_tally(truth, predictions, np.arange(FRAMES)))


@pytest.mark.slow
@pytest.mark.parametrize("case", ["random", "sparse", "one class", "low scores", "without predictions"])
def test_numbers_are_the_devkits(case: str, tmp_path: Path) -> None:
    rng = np.random.default_rng(11)
    truth = of_devkit(random_truth(rng, FRAMES, PER_FRAME))
    if case == "sparse":
        truth = truth.take(rng.random(len(truth)) < 0.1)
    if case == "one class":
        truth = replace(truth, label=np.full(len(truth), BOX_CLASSES.index("barrier"), np.uint8))
    predictions = random_predictions(rng, truth)
    if case == "low scores":
        predictions = Predictions(predictions.boxes, predictions.score.round(1) / 10)
    if case == "without predictions":
        predictions = predictions.take(np.zeros(len(predictions), np.bool_))
    expected, found = devkit_numbers(truth, predictions, tmp_path), measured(truth, predictions)
    assert found.mean_ap == pytest.approx(expected["mean_ap"], abs=1e-9)
    assert found.nds == pytest.approx(expected["nd_score"], abs=1e-9)
    names = dict(zip(ERRORS, DEVKIT_NAMES, strict=True))
    assert found.mean_errors == pytest.approx({name: expected["tp_errors"][names[name]] for name in ERRORS}, abs=1e-9)
    for row, name in enumerate(CLASSES):
        assert found.ap[row].tolist() == pytest.approx([expected["label_aps"][name][str(m)] for m in DISTANCES_M])
        errors = [expected["label_tp_errors"][name][each] for each in DEVKIT_NAMES]
        assert found.errors[row].tolist() == pytest.approx(errors, abs=1e-9, nan_ok=True)


def test_parts_merged_are_the_whole() -> None:
    rng = np.random.default_rng(12)
    truth = random_truth(rng, FRAMES, PER_FRAME)
    predictions = random_predictions(rng, truth)
    parts = [
        nuscenes_tally(truth.take(truth.frame == k), predictions.take(predictions.boxes.frame == k), np.array([k]))
        for k in range(FRAMES)
    ]
    merged, whole = nuscenes_result(nuscenes_merge(parts)), measured(truth, predictions)
    np.testing.assert_array_equal(merged.ap, whole.ap)
    np.testing.assert_allclose(merged.errors, whole.errors, rtol=1e-12)


def test_truth_as_prediction_is_perfect_but_for_absent_classes() -> None:
    truth = replace(random_truth(np.random.default_rng(13), 3, 40), attribute=np.zeros(120, np.uint8))
    present = [name for name in CLASSES if name in BOX_CLASSES]
    total = nuscenes_tally(truth, Predictions(truth, np.ones(120)), np.arange(3))
    assert nuscenes_result(total, present).nds == pytest.approx(1.0)
    assert nuscenes_result(total).mean_ap == pytest.approx(0.8)


def test_by_hand() -> None:
    """One of two cars found, 1 m off and 9 m too low: precision is 1 up to a recall of 0.5, 40 of 90 bins."""
    truth = some_boxes([(0, 0, 0), (30, 0, 0)])
    found = Predictions(some_boxes([(1, 0, -9)], yaw_rad=0.2, size_m=(2, 2, 2)), np.array([0.7]))
    result = nuscenes_result(nuscenes_tally(truth, found, np.array([0])), ["car"])
    np.testing.assert_allclose(result.ap, [[0, 0, 40 / 90, 40 / 90]])
    np.testing.assert_allclose(result.errors, [[1.0, 0.2, 0.5, 0.0, 1.0]])
    assert result.nds == pytest.approx((5 * 20 / 90 + 0 + 0.8 + 0.5 + 1 + 0) / 10)


def test_without_truth_all_is_zero() -> None:
    found = Predictions(some_boxes([(1, 0, 0)]), np.array([0.7]))
    assert measured(no_boxes(), found).nds == 0.0
