"""An intact bag has no faults; every truncation, flipped bit and change is found."""

import json
import os
import random
from bz2 import compress
from pathlib import Path

import numpy as np
import pytest
import yaml
from damage import TICK_NS, intact_bag
from made_up_scene import SENSORS, made_up_spec
from mcap.writer import Writer
from ros_messages import odometry, string
from several_agents import made_up_agents

from simbev_ros.recording.accounting import Accounting, Schedule
from simbev_ros.recording.bag_writer import SceneBagWriter
from simbev_ros.recording.qos import QosProfile
from simbev_ros.recording.reader import SceneBag
from simbev_ros.recording.verify import verify_bag


def problems(path: Path) -> list[str]:
    return [f"{fault.place}: {fault.problem}" for fault in verify_bag(path)]


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    path = intact_bag(tmp_path / "a")
    assert verify_bag(path) == []
    return path


def test_every_truncation_is_found(bag: Path) -> None:
    file = bag / "a_0.mcap"
    data = file.read_bytes()
    for size in random.Random(1).sample(range(len(data)), 80):
        file.write_bytes(data[:size])
        assert problems(bag), size


def test_every_flipped_bit_is_found(bag: Path) -> None:
    file = bag / "a_0.mcap"
    data = file.read_bytes()
    choice = random.Random(2)
    for offset in choice.sample(range(len(data)), 80):
        damaged = bytearray(data)
        damaged[offset] ^= 1 << choice.randrange(8)
        file.write_bytes(damaged)
        assert problems(bag), offset


def test_a_damaged_chunk_is_one_fault_and_not_one_per_topic(bag: Path) -> None:
    file = bag / "a_0.mcap"
    with SceneBag(bag) as opened:
        offset = opened._parts[0].index.chunks[3].offset
    damaged = bytearray(file.read_bytes())
    damaged[offset + 80] ^= 1
    file.write_bytes(damaged)
    chunk, whole = problems(bag)
    assert f"chunk at byte {offset:,}: " in chunk and "the CRC of the data section is wrong" in whole


def test_a_damaged_attachment_is_named_once(bag: Path) -> None:
    file = bag / "a_0.mcap"
    file.write_bytes(file.read_bytes().replace(b"scene.json", b"scene.jsoN", 1))
    assert [problem.partition(": ")[2] for problem in problems(bag)] == [
        "attachment at byte 45: the CRC of attachment scene.jsoN is wrong",
        "the CRC of the data section is wrong",
    ]


def test_missing_damaged_and_foreign_metadata_is_found(bag: Path) -> None:
    description = bag / "metadata.yaml"
    text = description.read_text()
    description.write_text("{")
    assert "metadata.yaml: it cannot be read" in problems(bag)[0]
    facts = yaml.safe_load(text)
    facts["rosbag2_bagfile_information"]["message_count"] += 1
    description.write_text(yaml.safe_dump(facts))
    assert problems(bag) == ["metadata.yaml: it differs from its copy in the file"]
    description.unlink()
    assert problems(bag) == ["metadata.yaml: it is missing"]


def test_a_pipe_in_place_of_the_metadata_is_found_and_not_waited_for(bag: Path) -> None:
    (bag / "metadata.yaml").unlink()
    os.mkfifo(bag / "metadata.yaml")
    assert any("it is not a file" in problem for problem in problems(bag))


def test_a_foreign_file_with_foreign_metadata_is_not_a_bag(tmp_path: Path) -> None:
    with (tmp_path / "a.mcap").open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        writer.finish()
    (tmp_path / "metadata.yaml").write_text("a: 1")
    assert "metadata.yaml: neither it nor the file describes a bag" in problems(tmp_path)


def test_an_unfinished_scene_is_found(bag: Path) -> None:
    unfinished = bag.rename(bag.with_name("a.partial"))
    assert problems(unfinished) == [": the scene was not finished; simbev repair saves what is in it"]


def write(path: Path, messages: list[tuple[str, int, bytes]], **facts: str) -> Path:
    with SceneBagWriter(path) as writer:
        writer.add_attachment("scene.json", "application/json", made_up_spec(SENSORS).model_dump_json().encode())
        for topic in sorted({topic for topic, _, _ in messages}):
            writer.add_topic(topic, "std_msgs/msg/String", QosProfile())
        for topic, stamp_ns, payload in messages:
            writer.write(topic, stamp_ns, payload)
        return writer.finish({"complete": "true", "expected": json.dumps({"/a": 2}), **facts})


def stamped(stamp_ns: int) -> bytes:
    return string(json.dumps({"stamp_ns": stamp_ns}))


@pytest.mark.parametrize(
    ("messages", "facts", "problem"),
    [
        ([("/a", 0, stamped(0))], {}, "/a: 1 of 2 messages"),
        ([("/a", t, stamped(t)) for t in (TICK_NS, 0)], {}, "/a: at 0 ns: it comes after a message of 50000000 ns"),
        ([("/a", t, stamped(7)) for t in (7, 8)], {}, "/a: at 8 ns: its header says 7 ns"),
        ([("/a", t, string("x")[:9]) for t in (0, 1)], {}, "/a: at 0 ns: no std_msgs/msg/String"),
        ([(name, 0, stamped(0)) for name in ("/a", "/a", "/b")], {}, "/b: a topic that the scene does not have"),
        ([("/a", t, stamped(t)) for t in (0, 1)], {"complete": "false"}, "b_0.mcap: the scene is incomplete"),
    ],
)
def test_invalid_messages_are_found(
    tmp_path: Path, messages: list[tuple[str, int, bytes]], facts: dict[str, str], problem: str
) -> None:
    assert problems(write(tmp_path / "b", messages, **facts))[0].startswith(problem)


def test_a_bag_without_message_counts_is_not_complete(tmp_path: Path) -> None:
    path = write(tmp_path / "b", [("/a", 0, stamped(0))], expected="{}")
    assert problems(path) == ["/a: a topic that the scene does not have"]
    with SceneBagWriter(tmp_path / "c") as writer:
        writer.add_topic("/a", "std_msgs/msg/String", QosProfile())
        writer.write("/a", 0, stamped(0))
        writer.finish({})
    assert problems(tmp_path / "c") == [
        "c_0.mcap: the recorder's message counts are missing, as in bags that other programs have converted",
        "scene.json: it is missing",
    ]


def bag_of_agents(path: Path, *, without: str, config: str = "rig: {}") -> Path:
    """A bag of a scene with the agents ego, car and rsu that has the odometry of all but one of them."""
    spec = made_up_agents()
    names = [f"/{agent.name}/odom" for agent in spec.agents if agent.name != without]
    books = Accounting(dict.fromkeys(names, Schedule()), start_ns=spec.start_ns, tick_ns=spec.tick_ns, ticks=spec.ticks)
    with SceneBagWriter(path) as writer:
        writer.add_attachment("scene.json", "application/json", spec.model_dump_json().encode())
        writer.add_attachment("config.yaml", "application/yaml", config.encode())
        for name in names:
            writer.add_topic(name, "nav_msgs/msg/Odometry", QosProfile())
        for tick in range(spec.ticks):
            for name in names:
                books.add_message(name, spec.stamp_ns(tick))
                writer.write(name, spec.stamp_ns(tick), odometry(spec.stamp_ns(tick), np.zeros(3), np.zeros(3)))
        return writer.finish(books.report().custom_data(path.name))


@pytest.mark.parametrize("agent", ["ego", "car", "rsu"])
def test_each_agent_of_the_scene_has_its_odometry(tmp_path: Path, agent: str) -> None:
    assert problems(bag_of_agents(tmp_path / "all", without="")) == []
    expected = [f"/{agent}/odom: the scene has an agent {agent}, but not its odometry"]
    assert problems(bag_of_agents(tmp_path / "a", without=agent)) == expected


@pytest.mark.parametrize("topics", ["{include: ['*'], exclude: ['/c?r/odom']}", "{include: ['/[er]*'], exclude: []}"])
def test_odometry_that_the_configuration_leaves_out_is_not_missing(tmp_path: Path, topics: str) -> None:
    config = f"recording: {{topics: {topics}}}"
    assert problems(bag_of_agents(tmp_path / "a", without="car", config=config)) == []
    assert len(problems(bag_of_agents(tmp_path / "b", without="ego", config=config))) == 1


@pytest.mark.parametrize("name", ["config.yaml", "lead_in.json", "map.xodr", "map_source.bz2", "trajectories.npz"])
@pytest.mark.parametrize(
    "junk", [b"", b"junk", b"\x00\xff", b"[", b"[7]", b"- a", b"<map/>", b"<OpenDRIVE>", b"BZh9", b"[" * 9999]
)
def test_attachments_that_cannot_be_read_are_named(tmp_path: Path, name: str, junk: bytes) -> None:
    with SceneBagWriter(tmp_path / "a") as writer:
        writer.add_attachment(name, "application/octet-stream", junk)
        path = writer.finish({})
    found = [fault for fault in verify_bag(path) if fault.place == name]
    assert len(found) == 1 and "\n" not in found[0].problem


def test_attachments_that_can_be_read_are_no_faults(tmp_path: Path) -> None:
    good = {
        "config.yaml": b"rig: {}",
        "lead_in.json": b"[]",
        "map.xodr": b"<OpenDRIVE/>",
        "map_source.bz2": compress(b"x"),
    }
    with SceneBagWriter(tmp_path / "a") as writer:
        for name, content in good.items():
            writer.add_attachment(name, "application/octet-stream", content)
        path = writer.finish({})
    assert not good.keys() & {fault.place for fault in verify_bag(path)}
