"""Bags that cannot be replayed, or not merged, are refused with one message before any process starts."""

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ros_messages import point_cloud

from simbev_ros.config.load import load_scenario
from simbev_ros.maps.build import load_network
from simbev_ros.recording.bag_writer import SceneBagWriter
from simbev_ros.recording.qos import QosProfile
from simbev_ros.scene.drawing.draw_scene import draw_scene, planned_scenes
from simbev_ros.scene.state import ACTOR_DTYPE, SIGNAL_DTYPE

pytestmark = pytest.mark.usefixtures("no_graph")

Refused = Callable[..., str]
CLOUD = "sensor_msgs/msg/PointCloud2"


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One scene of three ticks in which little moves, and a second one on other roads."""
    folder = tmp_path_factory.mktemp("dataset")
    scenario = load_scenario("demo")
    planned = next(planned_scenes(scenario))
    network = load_network(planned.map)
    spec = draw_scene(scenario, planned, network).model_copy(update={"ticks": 3})
    for number, roads in ((0, network.opendrive), (1, "other roads")):
        one = spec.model_copy(update={"number": number})
        with SceneBagWriter(folder / "scenes/train" / one.name) as writer:
            writer.add_attachment("scene.json", "application/json", one.model_dump_json().encode())
            writer.add_attachment("map.xodr", "application/xml", roads.encode())
            for name in ("/world/actors", "/world/signals"):
                writer.add_topic(name, CLOUD, QosProfile())
            for stamp_ns in map(spec.stamp_ns, range(3)):
                writer.write("/world/actors", stamp_ns, point_cloud(stamp_ns, np.zeros(2, ACTOR_DTYPE)))
                writer.write("/world/signals", stamp_ns, point_cloud(stamp_ns, np.zeros(1, SIGNAL_DTYPE)))
            writer.finish({"complete": "true"})
    return folder


@pytest.fixture
def bag(dataset: Path, tmp_path: Path) -> Path:
    shutil.copytree(dataset, tmp_path / "dataset")
    return tmp_path / "dataset/scenes/train/Blocks-0000"


def test_a_bag_of_other_roads_is_refused(refused: Refused, bag: Path) -> None:
    error = refused("replay", bag, bag.with_name("Blocks-0001"), "demo")
    assert error == f"error: {bag.with_name('Blocks-0001')}: was recorded on other roads than map Blocks has now\n"


def test_a_damaged_bag_is_refused(refused: Refused, bag: Path) -> None:
    file = bag / "Blocks-0000_0.mcap"
    data = bytearray(file.read_bytes())
    place = data.index(b"zstd") + 60
    data[place] ^= 1
    file.write_bytes(data)
    error = refused("replay", bag, "demo")
    assert error.startswith(f"error: {file}: damaged chunk at byte ") and error.count("\n") == 1


def test_two_bags_of_a_scene_do_not_fit_into_one_dataset(refused: Refused, bag: Path, tmp_path: Path) -> None:
    assert "Blocks-0000: two of the bags are of this scene" in refused(
        "replay", bag, bag, "demo", "--out", tmp_path / "x"
    )
    assert not (tmp_path / "x").exists()


@pytest.mark.parametrize("label", ["", "a.b", "x-0001", "partial", "replaced", "../up", "1st"])
def test_labels_that_could_be_mistaken_are_refused(refused: Refused, bag: Path, label: str) -> None:
    assert f"label {label!r}: allowed are a letter, then" in refused("replay", bag, "demo", "--merge", label)


def test_only_finished_scenes_of_a_dataset_get_additional_bags(refused: Refused, bag: Path, tmp_path: Path) -> None:
    outside = shutil.copytree(bag, tmp_path / "Blocks-0000")
    unfinished = shutil.copytree(bag, bag.with_name("Blocks-0002.partial"))
    for folder in (outside, unfinished):
        error = refused("replay", bag, folder, "demo", "--merge", "rear")
        assert f"{folder}: is not a finished scene of the dataset" in error
    bag.with_name("Blocks-0000.rear").mkdir()
    error = refused("replay", bag, "demo", "--merge", "rear")
    assert "Blocks-0000.rear: exists already; nothing was overwritten" in error
    assert "neither --out nor --live" in refused("replay", bag, "demo", "--merge", "rear", "--out", tmp_path / "x")
    assert sorted(each.name for each in bag.parents[2].iterdir()) == ["scenes"]


def test_of_a_dataset_only_what_is_not_recorded_yet_is_replayed(
    simbev: Callable[..., Any], refused: Refused, bag: Path, tmp_path: Path
) -> None:
    dataset, elsewhere = bag.parents[2], tmp_path / "x/scenes/train"
    for folder in (bag.with_name("Blocks-0001.rear"), elsewhere / "Blocks-0001"):
        folder.mkdir(parents=True)
    shutil.rmtree(bag)  # the other one could not be replayed: it is of other roads
    for place in (("--merge", "rear"), ("--out", tmp_path / "x")):
        answer = simbev("replay", dataset, "demo", *place)
        assert (answer.code, answer.out.strip()) == (0, "1 scene recorded before")
    assert "Blocks-0001: was recorded on other roads" in refused("replay", dataset, "demo", "--merge", "front")
    shutil.rmtree(dataset / "scenes/train/Blocks-0001")
    assert "there is no finished scene to replay" in refused("replay", dataset, "demo", "--out", tmp_path / "y")
