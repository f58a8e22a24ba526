"""The nuscenes-devkit opens what we export of a recorded scene, and finds everything in its place."""

import hashlib
import json
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from made_up_scene import made_up_scene

from simbev_ros.dataset import open_dataset
from simbev_ros.export.nuscenes.export import export_nuscenes
from simbev_ros.maps.cache import default_cache_dir

DEVKIT = "nuscenes-devkit==1.2.0"
CHECKS = Path(__file__).with_name("devkit_checks.py")
CAMERA = """{type: camera, name: NAME, pose: {x_m: X, z_m: 1.6, yaw_deg: YAW},
       width_px: 320, height_px: 180, modalities: [rgb, instance]}"""
CONFIG = f"""
seed: 3
scenes: [{{map: Blocks, train: 1}}]
time: {{warm_up_s: 2, duration_s: 2}}
rig:
  sensors:
    - {CAMERA.replace("NAME", "cam_front").replace("X", "0.6").replace("YAW", "0")}
    - {CAMERA.replace("NAME", "cam_back").replace("X", "-1.0").replace("YAW", "180")}
    - {{type: lidar, name: lidar, pose: {{z_m: 1.8, yaw_deg: 10}}, channels: 32, columns: 512}}
    - {{type: radar, name: radar_front, pose: {{x_m: 2.4, z_m: 0.6}}, points_per_second: 20000}}
weather: {{cloudiness: 20, precipitation: 0, sun_altitude_deg: 45, fog_density: 0}}
traffic: {{vehicles: 20, pedestrians: 60, spawn_radius_m: 120}}
"""

pytestmark = [pytest.mark.slow]


def run(*words: object, environment: dict[str, str] | None = None, timeout_s: float = 600) -> str:
    done = subprocess.run(
        [str(word) for word in words],
        env={**os.environ, **(environment or {})},
        capture_output=True,
        text=True,
        timeout=timeout_s,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="session")
def devkit_python() -> Path:
    """The Python of an environment with the devkit, made once for the user."""
    folder = default_cache_dir() / DEVKIT.replace("==", "-")
    python, ready = folder / "bin/python", folder / "ready"
    if not ready.exists():
        shutil.rmtree(folder, ignore_errors=True)
        try:
            subprocess.run([sys.executable, "-m", "venv", folder], check=True, capture_output=True)
            subprocess.run([python, "-m", "pip", "install", "-q", DEVKIT], check=True, capture_output=True)
        except subprocess.CalledProcessError as error:
            pytest.skip(f"{DEVKIT} cannot be installed: {error.stderr.decode()[-300:]}")
        ready.touch()
    return python


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory, devkit_python: Path) -> dict[str, Any]:
    """What the devkit's checks say of a recorded scene."""
    folder = tmp_path_factory.mktemp("devkit")
    (folder / "config.yaml").write_text(CONFIG)
    domain = {"ROS_DOMAIN_ID": str(60 + os.getpid() % 38)}
    run(
        sys.executable,
        "-m",
        "simbev_ros.cli.main",
        "run",
        folder / "config.yaml",
        "--record",
        folder / "set",
        environment=domain,
    )
    run(sys.executable, "-m", "simbev_ros.cli.main", "export", "nuscenes", folder / "set", "--out", folder / "out")
    run(devkit_python, CHECKS, folder / "out", folder, environment={"PYTHONPATH": ""})
    found: dict[str, Any] = json.loads((folder / "found.json").read_text())
    return {**found, "folder": folder}


@pytest.mark.graph
def test_the_devkit_opens_it(found: dict[str, Any]) -> None:
    assert found["scenes"] == ["Blocks-0000"]
    assert found["samples"] == 4
    assert found["on_mask"] and 0.01 < found["mask_share"] < 0.6


@pytest.mark.graph
@pytest.mark.parametrize("modality", ["lidar", "radar"])
def test_the_devkit_counts_as_many_points_in_boxes_as_we(found: dict[str, Any], modality: str) -> None:
    assert found[modality]["inside"] > 100
    assert found[modality]["wrong"] == []


@pytest.mark.graph
def test_the_truth_as_prediction_is_perfect(found: dict[str, Any]) -> None:
    assert {"car", "pedestrian"} <= set(found["detection"]["classes"])
    assert found["detection"]["mean_ap"] == pytest.approx(1.0)
    assert found["detection"]["nd_score"] == pytest.approx(1.0)


@pytest.mark.graph
@pytest.mark.parametrize("name", ["CAM_FRONT", "CAM_BACK", "LIDAR_TOP", "RADAR_FRONT", "map", "points_in_image"])
def test_the_devkit_draws_it(found: dict[str, Any], name: str) -> None:
    picture = cv2.imread(str(found["folder"] / f"{name}.png"))
    assert len(np.unique(picture.reshape(-1, 3)[::7], axis=0)) > 20


def digest(out: Path) -> dict[str, str]:
    files = [path for path in out.rglob("*") if path.is_file() and path.name != ".lock"]
    return {str(path.relative_to(out)): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


def test_killed_at_any_moment_it_goes_on_to_the_same_bytes(tmp_path: Path) -> None:
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
