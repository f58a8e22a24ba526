"""Exports of further agents have their own sensors, labels and poses, and lie in folders of their own."""

import json
from pathlib import Path

import numpy as np
import pytest
from made_up_scene import MadeUp, made_up_spec, record_made_up
from nuscenes_tables import digest, tables_of
from several_agents import MAST_SENSORS, car, made_up_agents, roadside_unit, with_agents
from typer.testing import CliRunner

from simbev_ros.cli.main import app
from simbev_ros.dataset import open_dataset
from simbev_ros.dataset.parallel import map_in_processes
from simbev_ros.export.simbev.export import make_part, parts_of
from simbev_ros.foundation.errors import InputError

MAST = [*MAST_SENSORS, {"type": "imu", "name": "imu"}]


def simbev(*words: object) -> str:
    """Run a command in this process; return its output."""
    return CliRunner().invoke(app, list(map(str, words)), catch_exceptions=False).output


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, MadeUp]:
    """A dataset with two scenes: one with the agents ego, car and rsu, whose content is returned, and one of ego."""
    folder = tmp_path_factory.mktemp("agents") / "set"
    spec = with_agents(made_up_agents(), car("car", 2), roadside_unit(sensors=MAST))
    content = record_made_up(folder / f"scenes/train/{spec.name}", spec)
    record_made_up(folder / "scenes/train/Blocks-0003", made_up_spec(MAST_SENSORS, number=3))
    return folder, content


@pytest.mark.parametrize("layout", [pytest.param("nuscenes", marks=pytest.mark.slow), "simbev"])
def test_all_agents_are_exported_to_folders_as_one_by_one(
    made: tuple[Path, MadeUp], tmp_path: Path, layout: str
) -> None:
    folder = made[0] if layout == "nuscenes" else made[0] / "scenes/train/Blocks-0002"
    export = ("export", layout, folder, "--workers", 1, "--out")
    simbev(*export, tmp_path / "all", "--agent", "all")
    assert {path.name for path in (tmp_path / "all").iterdir()} == {"ego", "car", "rsu"}
    for agent in ("ego", "car", "rsu"):
        simbev(*export, tmp_path / agent, "--agent", agent)
        assert digest(tmp_path / agent) == digest(tmp_path / "all" / agent)
    simbev(*export, tmp_path / "first")
    assert digest(tmp_path / "first") == digest(tmp_path / "ego"), "the first agent is the default"


def test_a_nuscenes_export_of_a_car_has_its_data(made: tuple[Path, MadeUp], tmp_path: Path) -> None:
    simbev("export", "nuscenes", made[0], "--out", tmp_path, "--agent", "car", "--all-frames", "--all-boxes")
    tables, ticks = tables_of(tmp_path), made[1].others["car"]
    assert [scene["name"] for scene in tables["scene"]] == ["Blocks-0002"], "the other scene has no car"
    places = np.array([pose["translation"] for pose in tables["ego_pose"]])
    np.testing.assert_allclose(np.diff(places, axis=0), np.diff([each["odom"][0] for each in ticks], axis=0), atol=1e-8)
    assert len(tables["sample_annotation"]) == sum(len(each["boxes"]) for each in ticks)
    clouds = [np.fromfile(file, np.float32) for file in sorted(tmp_path.glob("samples/LIDAR_TOP/*"))]
    for cloud, tick in zip(clouds, ticks, strict=True):
        np.testing.assert_array_equal(cloud.reshape(-1, 5)[:, 2], tick["lidar/points"]["z"])


def test_a_nuscenes_export_of_a_roadside_unit_stands_still(made: tuple[Path, MadeUp], tmp_path: Path) -> None:
    simbev("export", "nuscenes", made[0], "--out", tmp_path, "--agent", "rsu", "--all-frames")
    tables = tables_of(tmp_path)
    assert len({str(pose["translation"]) for pose in tables["ego_pose"]}) == 1
    assert {sensor["channel"] for sensor in tables["sensor"]} == {"CAM", "LIDAR_TOP"}
    messages = {file.stem.partition("_")[2]: json.loads(file.read_text()) for file in tmp_path.glob("can_bus/*")}
    assert sorted(messages) == ["meta", "ms_imu", "pose"], "a mast has no brakes and no lamps"
    assert len(messages["pose"]) == len(messages["ms_imu"]) == 3


def test_a_simbev_export_of_a_car_has_its_data(made: tuple[Path, MadeUp], tmp_path: Path) -> None:
    dataset = open_dataset(made[0] / "scenes/train/Blocks-0002").of_agent("car")
    (part,) = parts_of(dataset, tmp_path)
    assert list(map_in_processes(make_part, [part], 2)) == [3], "a part is sent to another process"
    for tick, values in enumerate(made[1].others["car"]):
        (file,) = tmp_path.glob(f"ground-truth/seg/*-frame-{tick:04d}-*")
        with np.load(file) as archive:
            assert (archive["data"][3] == (values["bev/labels"] >> 3 & 1)).all()
    info = part.finished_record()["frames"][1]
    assert info["ego2global_translation"] == pytest.approx(made[1].others["car"][1]["odom"][0].tolist())


def test_infos_of_a_simbev_export_leave_out_other_agents(made: tuple[Path, MadeUp], tmp_path: Path) -> None:
    bag = made[0] / "scenes/train/Blocks-0002"
    simbev("export", "simbev", bag, "--out", tmp_path, "--agent", "rsu", "--workers", 1)
    infos = json.loads((tmp_path / "simbev/infos/simbev_infos_train.json").read_text())
    settings = infos["data"]["scene_0002"]["scene_info"]
    assert "agents" not in settings and settings["annotation"]["bev"]["rows"] != 20, "its own, not the first agent's"
    assert infos["metadata"]["LIDAR"]["sensor2ego_translation"] == [0.0, 0.0, 6.2]


@pytest.mark.slow
@pytest.mark.parametrize("layout", ["nuscenes", "simbev"])
def test_another_agent_in_the_same_folder_replaces_the_earlier_one(
    made: tuple[Path, MadeUp], tmp_path: Path, layout: str
) -> None:
    bag = made[0] / "scenes/train/Blocks-0002"
    for out, agents in ((tmp_path / "one", ["ego", "rsu"]), (tmp_path / "other", ["rsu"])):
        for agent in agents:
            simbev("export", layout, bag, "--out", out, "--agent", agent, "--workers", 1)
    files = digest(tmp_path / "one")
    assert files == digest(tmp_path / "other")


def test_an_unknown_agent_is_named_with_those_that_there_are(made: tuple[Path, MadeUp], tmp_path: Path) -> None:
    (tmp_path / "empty/scenes").mkdir(parents=True)
    for layout in ("nuscenes", "simbev"):
        with pytest.raises(InputError, match=f"^--agent 'bus': {made[0]} has ego, car, rsu$"):
            simbev("export", layout, made[0], "--out", tmp_path / "out", "--agent", "bus")
        assert not (tmp_path / "out").exists()
        with pytest.raises(InputError, match="no finished scene to export"):
            simbev("export", layout, tmp_path / "empty", "--out", tmp_path / "none", "--agent", "all")
