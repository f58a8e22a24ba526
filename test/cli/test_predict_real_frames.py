"""``simbev predict`` with recordings of real sensors: what it refuses, what it says, and what it writes."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_up_recording import ground_cloud, write_nuscenes

pytestmark = pytest.mark.usefixtures("training")
pytest.importorskip("onnxruntime", reason="baselines need it: ./simbev setup baselines")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--format", "folder"], "has no clouds; files that are read end in .bin, .npy, .pcd, .ply"),
        (["--format", "kitti"], "has no velodyne/*.bin; give KITTI's folder training or testing"),
        (["--format", "nuscenes"], "has no v1.0-mini; --version can be a folder with tables"),
        (["--format", "kitti", "--split", "val"], "--split: is val; recordings with --format kitti have none"),
        (["--format", "kitti", "--track"], "--track: is True; recordings with --format kitti have none"),
        (["--format", "kitti", "--workers", "2"], "--workers: is 2; recordings with --format kitti have none"),
    ],
)
def test_recordings_that_are_none_are_refused(
    refused: Callable[..., str], tmp_path: Path, options: list[str], message: str
) -> None:
    (tmp_path / "a").mkdir()
    assert message in refused("predict", "lidar", tmp_path / "a", "--out", tmp_path / "p", *options)
    assert not (tmp_path / "p").exists()


def test_a_folder_that_holds_something_is_not_written_to(refused: Callable[..., str], tmp_path: Path) -> None:
    (tmp_path / "p").mkdir()
    (tmp_path / "p/mine").write_text("mine")
    error = refused("predict", "lidar", tmp_path, "--format", "folder", "--out", tmp_path / "p")
    assert "p: exists already; nothing was overwritten" in error


def test_a_model_that_needs_images_says_that_there_are_none(refused: Callable[..., str], tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", ground_cloud())
    error = refused("predict", "camera", tmp_path, "--format", "folder", "--out", tmp_path / "p")
    assert "has no frame with an image, which the camera model needs" in error


def test_a_recording_is_predicted_with_pictures_results_and_scores(simbev: Callable[..., Any], tmp_path: Path) -> None:
    write_nuscenes(tmp_path / "n", keys=1)
    out = tmp_path / "p"
    answer = simbev("predict", "lidar", tmp_path / "n", "--format", "nuscenes", "--out", out, "--grids", "--track")
    assert answer.code == 0, answer.err
    assert "the recording says where the lidar is above the ground" in answer.err
    assert "1 frame predicted in" in answer.out and "average precision" in answer.out
    names = {str(path.relative_to(out)) for path in out.rglob("*") if path.is_file()}
    assert names == {
        *("boxes.csv", "results_nusc.json", "tracking_nusc.json"),
        *("pictures/1.jpg", "grids/recording/000000.npz"),
    }
    rows = (out / "boxes.csv").read_text().splitlines()
    results = json.loads((out / "results_nusc.json").read_text())["results"]["sample0"]
    assert len(results) == len(rows) - 1
    tracks = json.loads((out / "tracking_nusc.json").read_text())["results"]["sample0"]
    assert {json.dumps(each["translation"]) for each in tracks} <= {json.dumps(each["translation"]) for each in results}
    assert rows[0] == "frame,class,x,y,z,length,width,height,yaw,vx,vy,score"
