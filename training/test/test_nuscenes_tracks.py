"""Tracks in nuScenes' form: objects keep their ids, and the nuscenes-devkit loads what is written."""

import json
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_up_recording import CAR_M, write_nuscenes

from simbev_ros.baselines.boxes import BOX_DTYPE
from simbev_ros.baselines.recordings.model_inputs import view_frame
from simbev_ros.baselines.recordings.nuscenes import nuscenes_frames
from simbev_ros.baselines.recordings.recording import boxes_in_frame
from simbev_ros.baselines.tracker import Tracker
from simbev_ros.foundation.cache.entries import default_cache_dir
from simbev_ros.foundation.geometry.transforms import inverse
from simbev_ros.foundation.semantics import BOX_CLASSES
from simbev_ros.foundation.types import Table
from simbev_training.recordings.results import nuscenes_text, nuscenes_tracks

KEYS, STEP_S, WALKER_MPS = 4, 0.5, 1.2
DEVKIT = default_cache_dir() / "nuscenes-devkit-1.2.0-tracking/bin/python"
"""Python of the environment that ``test_tracking_metrics.py`` makes."""


def found_boxes(key: int) -> Table:
    """The parked car, a pedestrian that walks along y, of unknown velocity, and something that is hardly there; map."""
    boxes = np.zeros(3, BOX_DTYPE)
    boxes["class"] = [BOX_CLASSES.index(name) for name in ("car", "pedestrian", "bicycle")]
    boxes["x"], boxes["y"], boxes["z"] = [CAR_M[0], 5.0, 8.0], [CAR_M[1], WALKER_MPS * STEP_S * key, -4.0], 0.8
    boxes["length"], boxes["width"], boxes["height"] = [4.2, 0.5, 1.8], [1.8, 0.6, 0.6], [1.6, 1.7, 1.4]
    boxes["yaw"], boxes["score"] = np.pi / 2, [0.9, 0.6, 0.02]
    boxes["vx"][1] = boxes["vy"][1] = np.nan
    return boxes


@pytest.fixture(scope="module")
def tracks(tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[dict[str, Any]]]:
    """The tracks of all key frames, whose boxes are found where they are, in the frame of the ego that drives."""
    folder = tmp_path_factory.mktemp("recording")
    write_nuscenes(folder, KEYS)
    tracker, found = Tracker(), {}
    for key, frame in enumerate(nuscenes_frames(folder, "v1.0-mini")):
        view = view_frame(frame, (0,), None)
        assert frame.sweep.map_from_lidar is not None
        ego_from_map = view.ego_from_lidar @ inverse(frame.sweep.map_from_lidar)
        found[frame.name] = nuscenes_tracks(boxes_in_frame(found_boxes(key), ego_from_map), frame, view, tracker)
    return found


def test_objects_keep_their_ids_in_the_map(tracks: dict[str, list[dict[str, Any]]]) -> None:
    assert [*tracks] == [f"sample{key}" for key in range(KEYS)]
    for key, (car, walker) in enumerate(tracks.values()):
        assert (car["tracking_id"], car["tracking_name"], walker["tracking_name"]) == ("1", "car", "pedestrian")
        assert car["translation"] == pytest.approx(CAR_M) and car["velocity"] == pytest.approx([0, 0], abs=0.01)
        assert walker["tracking_id"] == "2" and walker["translation"][1] == pytest.approx(WALKER_MPS * STEP_S * key)
    assert walker["velocity"] == pytest.approx([0.0, WALKER_MPS], abs=0.1)


@pytest.mark.skipif(not DEVKIT.exists(), reason="no environment with the devkit; test_tracking_metrics.py makes it")
def test_the_devkit_loads_the_tracks(tracks: dict[str, list[dict[str, Any]]], tmp_path: Path) -> None:
    file = tmp_path / "tracking.json"
    file.write_text(nuscenes_text(tracks, has_cameras=False, has_lidar=True))
    command = [DEVKIT, Path(__file__).with_name("devkit_tracking_results.py"), file]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert not done.returncode, done.stderr[-2000:]
    loaded = json.loads(done.stdout)
    assert [*loaded] == [*tracks]
    for sample, boxes in tracks.items():
        assert [{name: each[name] for name in boxes[0]} for each in loaded[sample]] == boxes
