"""Tests that scenes and channels can have the names that code for nuScenes expects."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_up_scene import SENSORS, made_up_scene
from nuscenes_tables import export, tables_of
from typer.testing import CliRunner

from simbev_exporters.nuscenes import scene_names
from simbev_exporters.nuscenes.scene_names import SceneNames, nuscenes_scenes
from simbev_exporters.nuscenes.sensor_files import in_sector
from simbev_ros.cli.main import app
from simbev_ros.foundation.errors import InputError
from simbev_ros.schema.points import RADAR_POINT_DTYPE

LIDAR = SENSORS[2]
PLAIN = {"map_expansion": False, "lidarseg": False, "sweeps": False}
SPLITS = """
import json, sys
from nuscenes.utils.splits import train, val, test
from nuscenes.can_bus.can_bus_api import NuScenesCanBus
api = NuScenesCanBus(sys.argv[1])
print(json.dumps({"splits": {"train": train, "val": val, "test": test}, "refused": api.can_blacklist}))
"""


def radar(name: str, yaw_deg: float) -> dict[str, Any]:
    return {"type": "radar", "name": name, "pose": {"z_m": 0.6, "yaw_deg": yaw_deg}}


PAPER = [radar("radar_left", 90), radar("radar_front", 0), radar("radar_right", -90), radar("radar_back", 180)]
"""The paper's four radars."""
FIVE = {f"RADAR_{place}" for place in ("FRONT", "FRONT_LEFT", "FRONT_RIGHT", "BACK_LEFT", "BACK_RIGHT")}


def test_scenes_can_have_names_of_nuscenes_splits(tmp_path: Path) -> None:
    for number, split in enumerate(("train", "val", "test", "val")):
        made_up_scene(tmp_path / f"set/scenes/{split}/Blocks-{number:04d}", number=number, split=split, ticks=2)
    out = tmp_path / "out"
    export(tmp_path / "set", out, scene_names=SceneNames.NUSCENES, **{**PLAIN, "lidarseg": True})
    names = [scene["name"] for scene in tables_of(out)["scene"]]
    known = nuscenes_scenes()
    assert names == [known["train"][0], *known["val"][:2]] == ["scene-0001", "scene-0003", "scene-0012"]
    [test] = json.loads((out / "v1.0-test/scene.json").read_text())
    assert test["name"] == "scene-0077" in known["test"], "converters put what is not in a list into val"
    splits = json.loads((out / "v1.0-trainval/splits.json").read_text())
    assert splits == {"simbev_train": names[:1], "simbev_val": names[1:], "simbev_test": []}
    labels = json.loads((out / "v1.0-test/lidarseg.json").read_text())
    assert len(labels) == 1 and (out / labels[0]["filename"]).is_file()
    assert {path.name.split("_")[0] for path in (out / "can_bus").iterdir()} == {*names, "scene-0077"}
    export(tmp_path / "set", out, **PLAIN)
    assert {path.name.split("_")[0] for path in (out / "can_bus").iterdir()} == {f"Blocks-{n:04d}" for n in range(4)}


def test_more_scenes_than_names_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(scene_names, "nuscenes_scenes", lambda: {"train": ["scene-0001"], "val": [], "test": []})
    for number in range(2):
        made_up_scene(tmp_path / f"set/scenes/train/Blocks-{number:04d}", number=number, ticks=1)
    with pytest.raises(InputError, match="nuscenes has 1 names for the split train, which has 2 scenes"):
        export(tmp_path / "set", tmp_path / "out", scene_names=SceneNames.NUSCENES)
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_the_names_are_in_the_devkits_lists(devkit_python: Path, tmp_path: Path) -> None:
    import subprocess

    (tmp_path / "can_bus").mkdir()
    words = [devkit_python, "-c", SPLITS, tmp_path]
    known = json.loads(subprocess.run(words, check=True, capture_output=True, cwd=tmp_path).stdout.splitlines()[-1])
    refused = {f"scene-{number:04d}" for number in known["refused"]}
    assert nuscenes_scenes() == {split: sorted({*names} - refused) for split, names in known["splits"].items()}


def test_the_papers_radars_have_nuscenes_five_channels(tmp_path: Path) -> None:
    made_up_scene(tmp_path / "set/scenes/train/Blocks-0000", sensors=[LIDAR, *PAPER], ticks=1)
    export(tmp_path / "set", tmp_path / "out", **PLAIN)
    tables = tables_of(tmp_path / "out")
    assert {each["channel"] for each in tables["sensor"]} == {"LIDAR_TOP", *FIVE}
    assert {each["filename"].split("/")[1] for each in tables["sample_data"]} == {"LIDAR_TOP", *FIVE}


def test_a_field_of_view_is_divided_from_the_left() -> None:
    cloud = np.zeros(5, RADAR_POINT_DTYPE)
    azimuth_rad = np.radians([51, 20, 1, -1, -49.9])
    cloud["x"], cloud["y"] = 30 * np.cos(azimuth_rad), 30 * np.sin(azimuth_rad)
    halves = [in_sector(cloud, (k, 2), 100.0) for k in range(2)]
    assert [len(half) for half in halves] == [3, 2] and (halves[0]["y"] > 0).all() and (halves[1]["y"] < 0).all()
    assert [len(in_sector(cloud, (k, 5), 100.0)) for k in range(5)] == [1, 1, 2, 0, 1]


def test_names_that_a_rig_has_itself_stay(tmp_path: Path) -> None:
    rig = [LIDAR, *PAPER, radar("radar_back_left", 150), radar("radar_front_left", 40)]
    made_up_scene(tmp_path / "set/scenes/train/Blocks-0000", sensors=rig, ticks=1)
    export(tmp_path / "set", tmp_path / "out", **PLAIN)
    names = {each["channel"] for each in tables_of(tmp_path / "out")["sensor"]}
    assert names == {"LIDAR_TOP", "RADAR_LEFT", "RADAR_FRONT", "RADAR_FRONT_RIGHT", "RADAR_BACK"} | {
        "RADAR_BACK_LEFT",
        "RADAR_FRONT_LEFT",
    }


def simbev(*words: object) -> Any:
    return CliRunner().invoke(app, list(map(str, words)))


def test_sensors_can_be_given_channels(tmp_path: Path) -> None:
    made_up_scene(tmp_path / "set/scenes/train/Blocks-0000", ticks=2)
    words = ["export", "nuscenes", tmp_path / "set", "--out", tmp_path / "out", "--no-map-expansion"]
    chosen = ["--channel", "radar_front=RADAR_FRONT_LEFT,RADAR_FRONT", "--channel", "cam_back_left=CAM_BACK"]
    assert simbev(*words).exit_code == 0
    assert "0 scenes were" not in (result := simbev(*words, *chosen)).output and result.exit_code == 0, result.output
    names = {each["channel"] for each in tables_of(tmp_path / "out")["sensor"]}
    assert names == {"CAM_FRONT", "CAM_BACK", "LIDAR_TOP", "RADAR_FRONT_LEFT", "RADAR_FRONT"}
    assert not list((tmp_path / "out").glob("*/CAM_BACK_LEFT/*"))


@pytest.mark.parametrize(
    ("option", "why"),
    [
        ("radar_front", "'radar_front' must be SENSOR=CHANNEL, as in radar_rear=RADAR_BACK_LEFT"),
        (
            "radar=RADAR_FRONT",
            r"'radar' is not a camera or radar of .*; allowed: cam_front, cam_back_left, radar_front",
        ),
        ("lidar=LIDAR_SIDE", "'lidar' is not a camera or radar"),
        ("radar_front=radar", "radar_front: 'radar' must be capital letters, digits and '_', as in CAM_FRONT"),
        ("cam_front=CAM_A,CAM_B", "cam_front: a camera has one channel, not 2"),
        ("cam_front=CAM_BACK_LEFT", "CAM_BACK_LEFT would be the channel of cam_front and of cam_back_left"),
    ],
)
def test_wrong_channels_are_explained(nuscenes_folder: Path, tmp_path: Path, option: str, why: str) -> None:
    result = simbev("export", "nuscenes", nuscenes_folder / "set", "--out", tmp_path / "out", "--channel", option)
    assert isinstance(result.exception, InputError) and result.exception.exit_code == 2
    with pytest.raises(InputError, match=rf"^channel: .*{why}"):
        raise result.exception
    assert not (tmp_path / "out").exists()
