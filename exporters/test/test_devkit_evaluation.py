"""Tests that our nuScenes metrics equal those of the nuscenes-devkit on the dataset's export."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from nuscenes_tables import Tables, tables_of
from processes import run

from simbev_ros.dataset import Scene, open_dataset
from simbev_ros.evaluation.metrics.boxes import NO_ATTRIBUTE, Boxes, Predictions, boxes_from_tables
from simbev_ros.evaluation.metrics.nuscenes import (
    CLASSES,
    DISTANCES_M,
    ERRORS,
    nuscenes_merge,
    nuscenes_result,
    nuscenes_tally,
)
from simbev_ros.evaluation.metrics.nuscenes_truth import ATTRIBUTES, NuscenesTruth, nuscenes_truth
from simbev_ros.foundation.semantics import BOX_CLASSES
from tools.bench.devkit_comparison import devkit_records

DETECTION = Path(__file__).with_name("devkit_detection.py")
DEVKIT_ERRORS = ("trans_err", "orient_err", "scale_err", "vel_err", "attr_err")
ATTRIBUTED = {
    "pedestrian": "pedestrian.",
    "motorcycle": "cycle.",
    "bicycle": "cycle.",
    "traffic_cone": "",
    "barrier": "",
}
"""Prefix of the names of a class's attributes; those of other classes begin like those of vehicles."""
NO_CLASSES = [BOX_CLASSES.index(name) for name in ("traffic_light", "traffic_sign")]

pytestmark = [pytest.mark.slow]


def noisy(scene: Scene, truth: NuscenesTruth, rng: np.random.Generator) -> Predictions:
    """Noisy predictions of keyframes: boxes drawn with replacement, some of another class, some far off."""
    boxes = boxes_from_tables({tick: scene[tick]["boxes"] for tick in truth.ticks.tolist()})
    boxes = boxes.take(~np.isin(boxes.label, NO_CLASSES))
    boxes = boxes.take(np.sort(rng.choice(len(boxes), len(boxes))))
    count = len(boxes)
    spread_m = rng.choice([0.1, 0.5, 2.0, 20.0], (count, 1), p=[0.4, 0.3, 0.2, 0.1])
    velocity_mps = boxes.velocity_mps + rng.normal(0, 0.5, (count, 3))
    velocity_mps[rng.random(count) < 0.05] = np.nan
    is_other = rng.random(count) < 0.1
    others = np.setdiff1d(np.arange(len(BOX_CLASSES)), NO_CLASSES)
    predicted = replace(
        boxes,
        label=np.where(is_other, rng.choice(others, count), boxes.label).astype(np.uint8),
        center_m=boxes.center_m + rng.normal(0, 1, (count, 3)) * spread_m,
        size_m=boxes.size_m * rng.uniform(0.8, 1.3, (count, 3)),
        yaw_rad=boxes.yaw_rad + rng.normal(0, 0.5, count),
        velocity_mps=velocity_mps,
    )
    score = rng.random(count).round(2)
    return Predictions(replace(predicted, attribute=_attributes(predicted, rng)), score)


def _attributes(boxes: Boxes, rng: np.random.Generator) -> np.ndarray:
    """(N,) random attributes that the devkit allows for the class."""
    chosen = []
    for label in boxes.label.tolist():
        prefix = ATTRIBUTED.get(BOX_CLASSES[label], "vehicle.")
        known = [k for k, name in enumerate(ATTRIBUTES) if prefix and name.startswith(prefix)]
        chosen.append(rng.choice([NO_ATTRIBUTE, *known]))
    return np.array(chosen, np.uint8)


def results(scene: Scene, predictions: Predictions, truth: NuscenesTruth, tables: Tables) -> dict[str, list[Any]]:
    """Predictions in the devkit's format and global frame, by token of the sample."""
    token = next(each["token"] for each in tables["scene"] if each["name"] == scene.name)
    log = next(each["token"] for each in tables["log"] if each["logfile"] == scene.name)
    origin_m = next([*each["origin_m"], 0.0] for each in tables["map"] if log in each["log_tokens"])
    samples = sorted((each["timestamp"], each["token"]) for each in tables["sample"] if each["scene_token"] == token)
    boxes = replace(predictions.boxes, center_m=predictions.boxes.center_m - origin_m)
    records = devkit_records(boxes, predictions.score, truth.ticks.tolist(), ATTRIBUTES)
    found = zip(samples, records.values(), strict=True)
    return {sample: [{**each, "sample_token": sample} for each in of_frame] for (_, sample), of_frame in found}


@pytest.mark.graph
def test_figures_are_the_devkits(recorded: Path, devkit_python: Path, tmp_path: Path) -> None:
    rng, tables = np.random.default_rng(3), tables_of(recorded / "out")
    tallies, content, counts = [], {}, {"truths": 0, "predictions": 0}
    for scene in open_dataset(recorded / "set", threads=1).scenes:
        truth = nuscenes_truth(scene)
        predictions = noisy(scene, truth, rng)
        content |= results(scene, predictions, truth, tables)
        counted = truth.counted(predictions)
        tallies.append(nuscenes_tally(truth.boxes, counted, truth.ticks))
        counts = {"truths": counts["truths"] + len(truth.boxes), "predictions": counts["predictions"] + len(counted)}
    found = nuscenes_result(nuscenes_merge(tallies))
    meta = dict.fromkeys(["use_camera", "use_lidar", "use_radar", "use_map", "use_external"], False)
    (tmp_path / "results.json").write_text(json.dumps({"meta": meta, "results": content}))
    arguments = (recorded / "out", "simbev_train", tmp_path / "results.json", tmp_path)
    run(devkit_python, DETECTION, *arguments, environment={"PYTHONPATH": ""})
    expected = json.loads((tmp_path / "figures.json").read_text())

    assert {name: expected[name] for name in counts} == counts
    assert counts["truths"] > 100 and 0.05 < found.mean_ap < 0.9
    assert found.mean_ap == pytest.approx(expected["mean_ap"], abs=1e-6)
    assert found.nds == pytest.approx(expected["nd_score"], abs=1e-6)
    for row, name in enumerate(CLASSES):
        aps = [expected["label_aps"][name][str(distance_m)] for distance_m in DISTANCES_M]
        assert found.ap[row].tolist() == pytest.approx(aps, abs=1e-6), name
        errors = [expected["label_tp_errors"][name][each] for each in DEVKIT_ERRORS]
        assert found.errors[row].tolist() == pytest.approx(errors, abs=1e-6, nan_ok=True), name
    means = [expected["tp_errors"][each] for each in DEVKIT_ERRORS]
    assert list(found.mean_errors) == list(ERRORS)
    assert [*found.mean_errors.values()] == pytest.approx(means, abs=1e-6)
