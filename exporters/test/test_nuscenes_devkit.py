"""Tests that the nuscenes-devkit opens the export of a recorded scene and finds everything at its position."""

import json
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from made_up_scene import made_up_scene
from nuscenes_tables import digest, export
from processes import run

from simbev_exporters.nuscenes.export import export_nuscenes
from simbev_ros.dataset import open_dataset
from simbev_ros.schema.nuscenes import detection_ranges_m

CHECKS, MAP_CHECKS = (Path(__file__).with_name(name) for name in ("devkit_checks.py", "devkit_map_checks.py"))

pytestmark = [pytest.mark.slow]


@pytest.fixture(scope="module")
def found(devkit_python: Path, recorded: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Results of the devkit's checks of recorded scenes."""
    folder = tmp_path_factory.mktemp("devkit")
    run(devkit_python, CHECKS, recorded / "out", folder, environment={"PYTHONPATH": ""})
    found: dict[str, Any] = json.loads((folder / "found.json").read_text())
    return {**found, "folder": folder}


@pytest.mark.graph
def test_the_devkit_opens_the_export(found: dict[str, Any]) -> None:
    assert found["scenes"] == ["Blocks-0000", "Blocks-0001"]
    assert found["samples"] == 8
    assert found["on_mask"] and 0.01 < found["mask_share"] < 0.6


@pytest.mark.graph
@pytest.mark.parametrize("modality", ["lidar", "radar"])
def test_the_devkit_counts_the_same_points_in_boxes(found: dict[str, Any], modality: str) -> None:
    assert found[modality]["inside"] > 100
    assert found[modality]["wrong"] == []


@pytest.mark.graph
def test_the_ground_truth_as_prediction_is_perfect_over_the_classes_that_occur(found: dict[str, Any]) -> None:
    assert {"car", "pedestrian"} <= set(found["detection"]["classes"])
    assert found["detection"]["mean_ap"] == pytest.approx(1.0)
    assert found["detection"]["nd_score"] == pytest.approx(1.0)


@pytest.mark.graph
def test_points_in_boxes_have_the_categories_of_boxes(found: dict[str, Any]) -> None:
    assert found["lidarseg"]["files"] == found["samples"]
    right, total = (found["lidarseg"]["boxes"][name] for name in ("right", "total"))
    assert sum(total.values()) > 500
    for name, count in total.items():
        assert right[name] >= 0.98 * count - 5, f"{name}: besides ground that noise lifts into the box"


@pytest.mark.graph
def test_classes_that_do_not_occur_count_0_as_the_export_says(found: dict[str, Any], recorded: Path) -> None:
    exported = export(recorded / "set", recorded / "out")
    assert exported.made == 0 and sorted(exported.classes["simbev_train"]) == found["detection"]["classes"]
    share = len(found["detection"]["classes"]) / len(detection_ranges_m())
    assert 0.2 <= share <= 0.8, "nuScenes' trailers and construction vehicles never occur"
    assert found["detection"]["mean_ap_of_all"] == pytest.approx(share)


@pytest.mark.graph
@pytest.mark.parametrize(
    "name", ["CAM_FRONT", "CAM_BACK", "LIDAR_TOP", "RADAR_FRONT", "map", "points_in_image", "lidarseg"]
)
def test_the_devkit_draws_the_export(found: dict[str, Any], name: str) -> None:
    picture = cv2.imread(str(found["folder"] / f"{name}.png"))
    assert len(np.unique(picture.reshape(-1, 3)[::7], axis=0)) > 20


@pytest.mark.graph
def test_the_devkit_opens_the_map_expansion(devkit_python: Path, recorded: Path, tmp_path: Path) -> None:
    run(devkit_python, MAP_CHECKS, recorded / "out", tmp_path, environment={"PYTHONPATH": ""})
    found = json.loads((tmp_path / "found.json").read_text())
    assert found["invalid"] == [] and found["ego_on_road"] > 0.95
    assert found["lanes"] > 10 and found["found_at_their_middle"] == found["lanes"] and found["closest"] == 20
    assert found["path_error_m"] < 0.01
    assert found["connectors"] > 10
    for layer in ("lane", "road_segment", "road_block", "walkway", "road_divider"):
        assert found["near"][layer], layer
    assert all(0.01 < share < 0.5 for share in found["mask_share"])
    assert len(np.unique(cv2.imread(str(tmp_path / "expansion.png")).reshape(-1, 3)[::7], axis=0)) > 20


def test_a_killed_export_resumes_to_the_same_bytes(tmp_path: Path) -> None:
    for number in range(4):
        made_up_scene(tmp_path / f"set/scenes/train/Blocks-{number:04d}", number=number, ticks=60)
    export_nuscenes(open_dataset(tmp_path / "set", threads=1), tmp_path / "whole")
    words = [sys.executable, "-m", "simbev_ros.cli.main", "export", "nuscenes", tmp_path / "set", "--out"]
    for after_s in np.random.default_rng(1).uniform(0.5, 4.0, 6):
        process = subprocess.Popen([*words, tmp_path / "killed"], start_new_session=True, stdout=subprocess.DEVNULL)
        time.sleep(after_s)
        os.killpg(process.pid, 9)
        process.wait()
    run(*words, tmp_path / "killed")
    assert digest(tmp_path / "killed") == digest(tmp_path / "whole")
