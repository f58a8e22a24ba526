"""Tests that the ground truth of the nuScenes metrics equals that of nuScenes' rules applied to the exported tables."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from nuscenes_tables import Tables, tables_of

from simbev_ros.dataset import open_dataset
from simbev_ros.evaluation.metrics.boxes import NO_ATTRIBUTE, Predictions
from simbev_ros.evaluation.metrics.nuscenes_truth import ATTRIBUTES, NuscenesTruth, nuscenes_truth
from simbev_ros.foundation.semantics import BOX_CLASSES

RANGES_M = {"car": 50, "truck": 50, "bus": 50, "pedestrian": 40, "motorcycle": 40, "bicycle": 40}
RANGES_M |= {"traffic_cone": 30, "barrier": 30}
NAMES = {"vehicle.bus.rigid": "bus", "movable_object.trafficcone": "traffic_cone", "movable_object.barrier": "barrier"}
NAMES |= {f"vehicle.{name}": name for name in ("car", "truck", "motorcycle", "bicycle")}
NAMES |= {f"human.pedestrian.{name}": "pedestrian" for name in ("adult", "child", "construction_worker")}


@pytest.fixture(scope="module")
def tables(nuscenes_folder: Path) -> Tables:
    return tables_of(nuscenes_folder / "out")


@pytest.fixture(scope="module")
def truth(nuscenes_folder: Path) -> NuscenesTruth:
    return nuscenes_truth(open_dataset(nuscenes_folder / "set").scenes[0])


def velocity_mps(annotation: dict[str, Any], tables: Tables) -> list[float]:
    by_token = {each["token"]: each for each in tables["sample_annotation"]}
    stamps_s = {each["token"]: each["timestamp"] * 1e-6 for each in tables["sample"]}
    first, last = (by_token.get(annotation[name], annotation) for name in ("prev", "next"))
    time_s = stamps_s[last["sample_token"]] - stamps_s[first["sample_token"]]
    moved_m = np.subtract(last["translation"], first["translation"])
    return (moved_m / time_s if time_s else np.full(3, np.nan)).tolist()


def expected(tables: Tables, scene: str) -> list[tuple[Any, ...]]:
    """Timestamp, class, position, velocity and attribute of all boxes that count, from the tables alone."""
    token = next(each["token"] for each in tables["scene"] if each["name"] == scene)
    samples = {each["token"]: each["timestamp"] for each in tables["sample"] if each["scene_token"] == token}
    position_m = {each["token"]: each["translation"] for each in tables["ego_pose"]}
    clouds = [each for each in tables["sample_data"] if each["filename"].startswith("samples/LIDAR_TOP")]
    ego_m = {each["sample_token"]: position_m[each["ego_pose_token"]] for each in clouds}
    category = {each["token"]: each["name"] for each in tables["category"]}
    kind = {each["token"]: category[each["category_token"]] for each in tables["instance"]}
    attribute = {each["token"]: each["name"] for each in tables["attribute"]}
    rows = []
    for each in tables["sample_annotation"]:
        name = NAMES.get(kind[each["instance_token"]])
        if name is None or each["sample_token"] not in samples or each["num_lidar_pts"] + each["num_radar_pts"] == 0:
            continue
        if np.hypot(*np.subtract(each["translation"], ego_m[each["sample_token"]])[:2]) < RANGES_M[name]:
            words = [attribute[token] for token in each["attribute_tokens"]]
            rows.append(
                (samples[each["sample_token"]], name, *each["translation"], *velocity_mps(each, tables), *words)
            )
    return sorted(rows)


def test_the_ground_truth_equals_the_tables(truth: NuscenesTruth, tables: Tables, nuscenes_folder: Path) -> None:
    scene, boxes = open_dataset(nuscenes_folder / "set").scenes[0], truth.boxes
    origin_m = [*tables["map"][0]["origin_m"], 0]
    found = []
    for row in range(len(boxes)):
        words = [ATTRIBUTES[boxes.attribute[row]]] if boxes.attribute[row] != NO_ATTRIBUTE else []
        head = int(scene.stamps_ns[boxes.frame[row]]) // 1000, BOX_CLASSES[boxes.label[row]]
        found.append((*head, *(boxes.center_m[row] - origin_m), *boxes.velocity_mps[row], *words))
    wanted = expected(tables, scene.name)
    assert 10 < len(wanted) < sum(len(scene[tick]["boxes"]) for tick in truth.ticks.tolist())
    for row, other in zip(sorted(found), wanted, strict=True):
        assert row[:2] == other[:2] and row[8:] == other[8:]
        np.testing.assert_allclose(row[2:8], other[2:8], atol=1e-6)


def test_predictions_count_at_keyframes_and_within_the_range_of_their_class(truth: NuscenesTruth) -> None:
    truth_boxes = truth.boxes.take(np.zeros(6, np.int64))
    frame = np.array([0, 0, 0, 0, 1, 10])  # keyframes are 0, 10 and 20
    label = [BOX_CLASSES.index(name) for name in ("car", "car", "traffic_cone", "traffic_light", "car", "car")]
    away_m = np.array([49.9, 50.1, 30.1, 1.0, 1.0, 49.9])
    keyframe = np.searchsorted(truth.ticks, frame)
    center_m = np.column_stack([truth.ego_m[np.minimum(keyframe, 2)], np.full(6, 100.0)])
    center_m[:, 1] += away_m
    boxes = type(truth_boxes)(
        frame,
        np.array(label, np.uint8),
        center_m,
        truth_boxes.size_m,
        truth_boxes.yaw_rad,
        truth_boxes.velocity_mps,
        truth_boxes.attribute,
    )
    counted = truth.counted(Predictions(boxes, np.arange(6.0)))
    assert truth.ticks.tolist() == [0, 10, 20]
    assert counted.score.tolist() == [0, 5]


def test_every_frame_can_be_a_keyframe(nuscenes_folder: Path) -> None:
    scene = open_dataset(nuscenes_folder / "set").scenes[1]
    assert nuscenes_truth(scene, None).ticks.tolist() == list(range(12))
