"""Tests that the CAN bus messages for nuScenes agree with the tables, the bag and each other."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_up_scene import SENSORS, made_up_scene
from nuscenes_tables import export, tables_of
from processes import run
from scipy.spatial.transform import Rotation
from typer.testing import CliRunner

from simbev_exporters.nuscenes import scene_names
from simbev_exporters.nuscenes.can_bus import can_bus_messages
from simbev_exporters.nuscenes.scene_names import SceneNames
from simbev_ros.cli.main import app
from simbev_ros.dataset import open_dataset
from simbev_ros.foundation.errors import InputError
from simbev_ros.schema.scene.state import Light

DEVKIT = Path(__file__).with_name("devkit_can_bus_checks.py")
G_MPS2 = 9.81


def messages(out: Path, message: str, scene: str = "Blocks-0000") -> Any:
    return json.loads((out / f"can_bus/{scene}_{message}.json").read_text())


def test_poses_are_those_of_the_tables_at_every_tick(nuscenes_folder: Path) -> None:
    out = nuscenes_folder / "out"
    rows = {each["timestamp"]: each for each in tables_of(out)["ego_pose"]}
    poses = messages(out, "pose")
    assert len(poses) == 23 and [pose["utime"] for pose in poses] == sorted(pose["utime"] for pose in poses)
    for pose in poses:
        np.testing.assert_allclose(pose["pos"], rows[pose["utime"]]["translation"], atol=1e-6)
        np.testing.assert_allclose(pose["orientation"], rows[pose["utime"]]["rotation"], atol=1e-6)


def test_accelerations_are_specific_forces_in_the_ego_frame(nuscenes_folder: Path) -> None:
    scene = open_dataset(nuscenes_folder / "set").scenes[0]
    for pose, frame in zip(messages(nuscenes_folder / "out", "pose"), scene, strict=True):
        ego = frame["world/actors"][0]
        force_mps2 = Rotation.from_quat(np.roll(pose["orientation"], -1)).apply(pose["accel"])
        np.testing.assert_allclose(force_mps2, [ego["ax"], ego["ay"], ego["az"] + G_MPS2], atol=1e-5)


def test_the_imu_and_the_lights_are_those_of_the_bag(nuscenes_folder: Path) -> None:
    scene = open_dataset(nuscenes_folder / "set").scenes[0]
    imu, monitor = (messages(nuscenes_folder / "out", name) for name in ("ms_imu", "vehicle_monitor"))
    assert len(imu) == len(monitor) == 23
    for row, seen, frame in zip(imu, monitor, scene, strict=True):
        measured = frame["imu/data"][-1]
        np.testing.assert_allclose(row["linear_accel"], measured["acceleration_mps2"], atol=1e-8)
        same = np.dot(np.roll(row["q"], -1), measured["orientation_xyzw"])
        assert abs(same) == pytest.approx(1), "the sign is that of the message before"
        lights = int(frame["world/actors"][0]["lights"])
        assert seen["brake_switch"] == (2 if lights & Light.BRAKE else 1)
        assert (seen["left_signal"], seen["right_signal"]) == (lights >> 2 & 1, lights >> 3 & 1)
        assert row["utime"] == seen["utime"] == frame.stamp_ns // 1000


def test_statistics_are_of_the_messages(nuscenes_folder: Path) -> None:
    out = nuscenes_folder / "out"
    meta, poses = messages(out, "meta"), messages(out, "pose")
    assert sorted(meta) == ["ms_imu", "pose", "vehicle_monitor"] and meta["pose"]["message_count"] == 23
    assert meta["pose"]["message_freq"] == pytest.approx(20) and meta["pose"]["timespan"] == pytest.approx(1.1)
    x_m = [pose["pos"][0] for pose in poses]
    figures = meta["pose"]["var_stats"]["pos"]
    assert figures["mean"][0] == pytest.approx(sum(x_m) / 23) and figures["max"][0] == max(x_m)
    assert figures["diff_min"][0] == pytest.approx(5.0) and figures["std"][2] == pytest.approx(0)


def test_scenes_can_have_names_that_the_devkit_demands_and_files_follow(tmp_path: Path) -> None:
    made_up_scene(tmp_path / "set/scenes/train/Blocks-0007", number=7)
    out = tmp_path / "out"
    export(tmp_path / "set", out)
    assert tables_of(out)["scene"][0]["name"] == "Blocks-0007"
    exported = export(tmp_path / "set", out, scene_names=SceneNames.DEVKIT)
    assert exported.made == 0 and tables_of(out)["scene"][0]["name"] == "scene-2007"
    assert json.loads((out / "v1.0-trainval/splits.json").read_text())["simbev_train"] == ["scene-2007"]
    assert {path.name.split("_")[0] for path in (out / "can_bus").iterdir()} == {"scene-2007"}
    export(tmp_path / "set", out)
    assert {path.name.split("_")[0] for path in (out / "can_bus").iterdir()} == {"Blocks-0007"}


def test_a_scene_with_a_large_number_cannot_have_such_a_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(scene_names, "_LAST_NUMBER", 2004)
    made_up_scene(tmp_path / "set/scenes/train/Blocks-0005", number=5)
    words = ["export", "nuscenes", str(tmp_path / "set"), "--out", str(tmp_path / "out"), "--scene-names", "devkit"]
    result = CliRunner().invoke(app, words)
    assert isinstance(result.exception, InputError) and result.exception.exit_code == 2
    assert "scene 5 cannot have a name of the devkit's; numbers up to 4 can" in str(result.exception)
    assert not (tmp_path / "out").exists()


def test_positions_follow_an_origin_that_has_moved(tmp_path: Path) -> None:
    made_up_scene(tmp_path / "set/scenes/train/Blocks-0000")
    export(tmp_path / "set", tmp_path / "out")
    before = messages(tmp_path / "out", "pose")[0]["pos"]
    made_up_scene(tmp_path / "set/scenes/train/Blocks-0001", number=1, ticks=40)
    export(tmp_path / "set", tmp_path / "out", keyframe_hz=20)
    tables = tables_of(tmp_path / "out")
    first = min(tables["ego_pose"], key=lambda each: math.dist(each["translation"], before))
    assert messages(tmp_path / "out", "pose")[0]["pos"] == pytest.approx(first["translation"])


def test_a_scene_without_an_imu_has_the_other_messages(tmp_path: Path) -> None:
    made_up_scene(tmp_path / "set/scenes/train/Blocks-0000", sensors=SENSORS[:3])
    words = ["export", "nuscenes", str(tmp_path / "set"), "--out", str(tmp_path / "out")]
    result = CliRunner().invoke(app, words)
    assert result.exit_code == 0, result.output
    assert "1 scene without ms_imu in the CAN bus messages: no IMU was recorded" in result.output
    names = {path.name for path in (tmp_path / "out/can_bus").iterdir()}
    assert names == {f"Blocks-0000_{message}.json" for message in ("pose", "vehicle_monitor", "meta")}
    words[-1] = str(tmp_path / "none")
    assert "IMU" not in CliRunner().invoke(app, [*words, "--no-can-bus"]).output
    assert not (tmp_path / "none/can_bus").exists()


@pytest.mark.slow
@pytest.mark.graph
def test_the_devkit_reads_the_messages_of_recorded_scenes(devkit_python: Path, recorded: Path, tmp_path: Path) -> None:
    export(recorded / "set", tmp_path / "out", scene_names=SceneNames.DEVKIT, sweeps=False, lidarseg=False)
    run(devkit_python, DEVKIT, tmp_path / "out", tmp_path / "found.json", environment={"PYTHONPATH": ""})
    found = json.loads((tmp_path / "found.json").read_text())
    assert list(found) == ["scene-2000", "scene-2001"]
    for scene in found.values():
        assert scene["poses"] == 40 and scene["offset_m"] < 1e-6 and scene["meta"] == ["pose", "vehicle_monitor"]


@pytest.mark.slow
@pytest.mark.graph
def test_velocities_and_accelerations_are_derivatives_of_positions(recorded: Path) -> None:
    poses = can_bus_messages(open_dataset(recorded / "set").scenes[0], (0.0, 0.0))["pose"]
    time_s = np.array([pose["utime"] for pose in poses]) / 1e6
    turns = Rotation.from_quat(np.roll([pose["orientation"] for pose in poses], -1, axis=1))
    position_m = np.array([pose["pos"] for pose in poses])
    velocity_mps = turns.apply([pose["vel"] for pose in poses])
    force_mps2 = turns.apply([pose["accel"] for pose in poses])
    np.testing.assert_allclose(np.gradient(position_m, time_s, axis=0)[1:-1], velocity_mps[1:-1], atol=0.1)
    derived_mps2 = np.gradient(velocity_mps, time_s, axis=0)[1:-1] + np.array([0, 0, G_MPS2])
    assert np.median(np.abs(derived_mps2 - force_mps2[1:-1])) < 0.1
