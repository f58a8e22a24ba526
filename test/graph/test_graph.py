"""The whole graph with real processes: complete bags, repeatable bytes, and orderly ends."""

import json
import os
import signal
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from commands import SMALL, Command
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader

from simbev_ros.recording.digest import topic_digests
from simbev_ros.recording.reader import SceneBag

pytestmark = pytest.mark.graph

Simbev = Callable[..., Command]
Config = Callable[..., Path]
SCENE = Path("scenes/train/Blocks-0000")


def digests(folder: Path) -> dict[str, str]:
    with SceneBag(folder) as bag:
        return topic_digests(bag)


def record(simbev: Simbev, config: Path, dataset: Path) -> Path:
    code, output = simbev("run", config, "--record", dataset, "--domain", 39).finish()
    assert code == 0, output
    return dataset / SCENE


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("recorded")
    (folder / "small.yaml").write_text(SMALL.replace("DURATION", "1"))
    return record(Command, folder / "small.yaml", folder / "dataset")


def test_every_topic_has_exactly_its_messages(recorded: Path) -> None:
    with AnyReader([recorded]) as reader:
        counts = {name: topic.msgcount for name, topic in reader.topics.items()}
    once = {"/world/scene", "/world/map", "/tf_static"}
    camera = {name for name in counts if name.startswith("/ego/cam_front/")}
    assert len(camera) == 10
    for name, count in counts.items():
        assert count == (1 if name in once else 10 if name in camera else 20), name
    assert {"/tf", "/clock", "/ego/odom", "/ego/lidar/points", "/ego/bev/labels", "/ego/boxes"} <= counts.keys()


def test_chunks_and_attachments_pass_their_checksums(recorded: Path) -> None:
    with (recorded / "Blocks-0000_0.mcap").open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        assert sum(1 for _ in reader.iter_messages()) > 300
        assert {attachment.name for attachment in reader.iter_attachments()} == {
            "scene.json",
            "config.yaml",
            "map.xodr",
        }


def test_metadata_holds_the_type_hashes_that_rclpy_offers(recorded: Path, ros_type_hashes: dict[str, str]) -> None:
    with AnyReader([recorded]) as reader:
        hashes = {connection.msgtype: connection.digest for connection in reader.connections}
    shared = ros_type_hashes.keys() & hashes.keys()
    assert len(shared) > 5
    assert {name: hashes[name] for name in shared} == {name: ros_type_hashes[name] for name in shared}


def test_books_say_complete(recorded: Path) -> None:
    with SceneBag(recorded) as bag:
        assert bag.custom_data["complete"] == "true"
        assert json.loads(bag.custom_data["expected"]) == json.loads(bag.custom_data["recorded"])


def test_all_frames_hang_on_one_tree(recorded: Path) -> None:
    parents = {}
    with AnyReader([recorded]) as reader:
        for connection, _, payload in reader.messages([c for c in reader.connections if c.topic.startswith("/tf")]):
            for transform in reader.deserialize(payload, connection.msgtype).transforms:  # type: ignore[attr-defined]
                parents[transform.child_frame_id] = transform.header.frame_id
        frames = set()
        for connection, _, payload in reader.messages([c for c in reader.connections if c.topic.startswith("/ego/")]):
            message: Any = reader.deserialize(payload, connection.msgtype)
            if hasattr(message, "header"):
                frames.add(message.header.frame_id)
    for frame in frames:
        while frame in parents:
            frame = parents[frame]
        assert frame == "map"


def test_same_seed_gives_the_same_bytes_and_another_seed_others(
    recorded: Path, simbev: Simbev, small_config: Config, tmp_path: Path
) -> None:
    again = record(simbev, small_config(), tmp_path / "again")
    assert digests(again) == digests(recorded)
    seed_12 = tmp_path / "other.yaml"
    seed_12.write_text(small_config().read_text().replace("seed: 11", "seed: 12"))
    other = digests(record(simbev, seed_12, tmp_path / "other"))
    same = {name for name, digest in digests(recorded).items() if digest == other[name]}
    static = {"/clock", "/world/map", "/tf_static", *(name for name in other if name.endswith("camera_info"))}
    assert same == static


def test_killed_node_is_named_and_what_was_recorded_stays_readable(
    simbev: Simbev, small_config: Config, tmp_path: Path
) -> None:
    command = simbev("run", small_config(60), "--record", tmp_path / "out")
    bag = tmp_path / "out" / f"{SCENE}.partial"
    command.wait_for(lambda: any(file.stat().st_size > 800_000 for file in bag.glob("*.mcap")))
    os.kill(command.nodes()["lidar"], signal.SIGKILL)
    killed_s = time.monotonic()
    code, output = command.finish(timeout_s=10)
    assert time.monotonic() - killed_s < 10
    assert code == 1
    assert "node lidar died after tick" in output
    assert "SIGKILL" in output
    assert "Traceback" not in output
    with SceneBag(bag) as partial:
        assert sum(1 for _ in partial.messages(["/clock"])) > 5
    assert not (tmp_path / "out" / SCENE).exists()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_interrupt_closes_the_bag_and_exits_130(
    simbev: Simbev, small_config: Config, tmp_path: Path, number: signal.Signals
) -> None:
    command = simbev("run", small_config(60), "--record", tmp_path / "out")
    bag = tmp_path / "out" / f"{SCENE}.partial"
    command.wait_for(lambda: any(file.stat().st_size > 800_000 for file in bag.glob("*.mcap")))
    os.kill(command.process.pid, number)
    code, output = command.finish(timeout_s=20)
    assert code == 130
    assert "Traceback" not in output
    assert (bag / "metadata.yaml").is_file()
    with AnyReader([bag]) as reader:
        assert reader.message_count > 100


def test_nodes_end_when_the_command_is_killed(simbev: Simbev, small_config: Config) -> None:
    command = simbev("run", small_config(60))
    command.wait_for(lambda: len(command.nodes()) == 5)
    command.process.kill()
    command.process.wait()
