"""Bags of format 1, from ``python -m tools.format_bags``, stay readable, intact, exportable and replayable."""

from pathlib import Path

import pytest
import yaml
from typer.testing import CliRunner

from simbev_ros.cli.main import app
from simbev_ros.config.load import parse_scenario
from simbev_ros.dataset import Scene, open_dataset
from simbev_ros.dataset.index import read_index
from simbev_ros.dataset.plan import Plan
from simbev_ros.maps.build import load_network
from simbev_ros.recording.layout import CONFIG_ATTACHMENT
from simbev_ros.recording.reader import SceneBag
from simbev_ros.recording.verify import verify_bag
from simbev_ros.simulation.replay.replay import Replay, build_recorded_roads, replayed_spec

FOLDER = Path(__file__).parent / "format_1"
TICKS = {"town": 2, "several_agents": 3, "rainy_night": 2, "replayed": 2, "typed": 2}
EXPECTED_KEYS = {
    "town": (
        "cam_front/rgb",
        "cam_front/flow",
        "lidar/points",
        "radar_front/points",
        "gnss/fix",
        "imu/data",
        "bev/labels",
    ),
    "several_agents": ("lidar/points", "v2x", "car/cam_front/rgb", "rsu/lidar/points", "world/boxes"),
    "rainy_night": ("cam_front/instance", "lidar/semantic_points", "occupancy/points", "vector_map"),
    "replayed": ("cam_back/rgb", "cam_back/depth", "boxes"),
    "typed": ("world/actors/typed", "boxes/typed", "cam_front/rgb", "world/weather/typed"),
}
each_bag = pytest.mark.parametrize("name", TICKS)


def bag_of(name: str) -> Path:
    (bag,) = (FOLDER / name).glob("scenes/*/*")
    return bag


def scene_of(name: str) -> Scene:
    (scene,) = open_dataset(bag_of(name)).scenes
    return scene


def test_the_folder_holds_the_datasets_that_are_tested() -> None:
    assert {path.name for path in FOLDER.iterdir()} == set(TICKS)


@each_bag
def test_every_value_of_every_frame_is_read_for_every_agent(name: str) -> None:
    scene = scene_of(name)
    assert (len(scene), scene.spec.format) == (TICKS[name], 1)
    found = {key for frame in scene for key in frame}
    assert set(EXPECTED_KEYS[name]) <= found
    for agent in scene.agents:
        for frame in scene.of_agent(agent):
            frame.load()
            assert frame.map_from_ego.shape == (4, 4)
    assert len(scene.tracks.id) and scene.constants["world/map"]


@each_bag
def test_the_bag_is_intact(name: str) -> None:
    assert verify_bag(bag_of(name)) == []


@each_bag
@pytest.mark.parametrize("layout", ["nuscenes", "simbev"])
def test_the_scene_is_exported(name: str, layout: str, tmp_path: Path) -> None:
    words = ["export", layout, str(bag_of(name)), "--out", str(tmp_path), "--workers", "1"]
    result = CliRunner().invoke(app, words)
    assert result.exit_code == 0, result.output
    assert any(path.suffix == ".json" for path in tmp_path.rglob("*"))


@each_bag
def test_the_scene_is_replayed_with_its_own_configuration(name: str) -> None:
    with SceneBag(bag_of(name)) as bag:
        chosen = build_recorded_roads(bag)
        config = yaml.safe_load(bag.attachments[CONFIG_ATTACHMENT])
        config["scenes"] = [{"map": "Blocks", "train": 1}]  # the file of the map is in the bag alone
        scenario = parse_scenario(yaml.safe_dump(config), "config.yaml")
        spec = replayed_spec(bag, scenario, load_network(chosen), chosen)
        assert bag.spec is not None
        assert spec.vehicles == bag.spec.vehicles
        assert [agent.name for agent in spec.agents] == [agent.name for agent in bag.spec.agents]
    replay = Replay(spec, bag_of(name))
    states = [replay.step() for _ in range(spec.warm_up_ticks + 1)]
    replay.close()
    assert states[-1].tick == 0 and len(states[-1].actors)


def test_index_and_plan_are_read() -> None:
    (row,) = read_index(FOLDER / "town")
    assert (row["format"], row["name"], row["recorded_ticks"]) == (1, "Blocks-0000", 2)
    assert [entry.name for entry in Plan.load(FOLDER / "town").scenes] == ["Blocks-0000"]
