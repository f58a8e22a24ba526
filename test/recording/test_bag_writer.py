import hashlib
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml
from damage import TICK_NS
from mcap.reader import make_reader
from ros_messages import TYPES, string
from rosbags.highlevel import AnyReader
from rosbags.interfaces import QosDurability, QosHistory, QosReliability
from rosbags.rosbag2 import Reader

from simbev_ros.foundation.errors import DiskError, InputError
from simbev_ros.recording.bag_writer import SceneBagWriter
from simbev_ros.recording.digest import topic_digests
from simbev_ros.recording.qos import QosProfile
from simbev_ros.recording.reader import SceneBag

LATCHED = QosProfile(durability="transient_local", depth=1)


def write_bag(path: Path, count: int = 20, text: str = "message") -> Path:
    with SceneBagWriter(path, chunk_bytes=2000) as writer:
        writer.add_attachment("scene.json", "application/json", b"{}")
        writer.add_topic("/world/scene", "std_msgs/msg/String", LATCHED)
        writer.add_topic("/words", "std_msgs/msg/String", QosProfile(reliability="best_effort", depth=3))
        writer.write("/world/scene", 0, string("the scene"))
        for tick in range(count):
            writer.write("/words", tick * TICK_NS, string(f"{text} {tick}" * 20))
        return writer.finish({"scene": path.name})


def test_rosbags_reads_every_message_with_its_stamp(tmp_path: Path) -> None:
    with AnyReader([write_bag(tmp_path / "Town-0001")]) as reader:
        read = [(c.topic, stamp, reader.deserialize(data, c.msgtype).data) for c, stamp, data in reader.messages()]
    assert read[0] == ("/world/scene", 0, "the scene")
    assert read[1:] == [("/words", tick * TICK_NS, f"message {tick}" * 20) for tick in range(20)]


def test_mcap_finds_no_crc_error_and_ascending_sequence_numbers(tmp_path: Path) -> None:
    with (write_bag(tmp_path / "a") / "a_0.mcap").open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        words = [message for _, _, message in reader.iter_messages("/words")]
        summary = reader.get_summary()
        assert reader.get_header().profile == "ros2"
        assert [a.data for a in reader.iter_attachments()] == [b"{}"]
    assert summary is not None and summary.statistics is not None
    assert len(summary.chunk_indexes) > 2
    assert {chunk.compression for chunk in summary.chunk_indexes} == {"zstd"}
    assert [m.sequence for m in words] == list(range(20))
    assert all(m.log_time == m.publish_time for m in words)


def test_rosbags_parses_the_schema_to_the_same_type(tmp_path: Path) -> None:
    with SceneBagWriter(tmp_path / "a") as writer:
        writer.add_topic("/image", "sensor_msgs/msg/Image", QosProfile())
        path = writer.finish({})
    with (path / "a_0.mcap").open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    (schema,) = summary.schemas.values()
    assert (schema.name, schema.encoding) == ("sensor_msgs/msg/Image", "ros2msg")
    assert b"MSG: builtin_interfaces/Time" in schema.data


def test_type_hashes_equal_those_shipped_with_ros(tmp_path: Path) -> None:
    share = Path(sys.prefix) / "share"
    descriptions = [share / "sensor_msgs/msg/PointCloud2.json", share / "nav_msgs/msg/Odometry.json"]
    if not all(path.exists() for path in descriptions):
        pytest.skip("the ROS message packages are not installed here")
    expected = {}
    for path in descriptions:
        for entry in json.loads(path.read_text())["type_hashes"]:
            expected[entry["type_name"]] = entry["hash_string"]
    with SceneBagWriter(tmp_path / "a") as writer:
        writer.add_topic("/points", "sensor_msgs/msg/PointCloud2", QosProfile())
        writer.add_topic("/odom", "nav_msgs/msg/Odometry", QosProfile())
        bag = writer.finish({})
    metadata = yaml.safe_load((bag / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    for topic in metadata["topics_with_message_count"]:
        entry = topic["topic_metadata"]
        assert entry["type_description_hash"] == expected[entry["type"]] == TYPES.hash_rihs01(entry["type"])


def test_metadata_equals_that_of_rosbag2_in_jazzy(tmp_path: Path) -> None:
    text = (write_bag(tmp_path / "a") / "metadata.yaml").read_text()
    information = yaml.safe_load(text)["rosbag2_bagfile_information"]
    assert (information["version"], information["storage_identifier"]) == (9, "mcap")
    assert information["duration"]["nanoseconds"] == 19 * TICK_NS
    assert information["message_count"] == 21
    assert information["ros_distro"] == "jazzy"
    assert information["custom_data"]["scene"] == "a"
    qos = information["topics_with_message_count"][1]["topic_metadata"]["offered_qos_profiles"]
    infinite = {"sec": 9223372036, "nsec": 854775807}
    assert qos == [
        {
            "history": "keep_last",
            "depth": 3,
            "reliability": "best_effort",
            "durability": "volatile",
            "deadline": infinite,
            "lifespan": infinite,
            "liveliness": "automatic",
            "liveliness_lease_duration": infinite,
            "avoid_ros_namespace_conventions": False,
        }
    ]


@pytest.mark.parametrize("form", ["folder", "file"])
def test_rosbags_reads_qos_from_the_folder_and_from_the_file_alone(tmp_path: Path, form: str) -> None:
    path = write_bag(tmp_path / "a")
    with Reader(path if form == "folder" else path / "a_0.mcap") as reader:
        (qos,) = next(c for c in reader.connections if c.topic == "/world/scene").ext.offered_qos_profiles
    assert (qos.durability, qos.reliability) == (QosDurability.TRANSIENT_LOCAL, QosReliability.RELIABLE)
    assert (qos.history, qos.depth) == (QosHistory.KEEP_LAST, 1)


def test_the_bag_has_only_its_partial_name_before_the_end_and_only_its_final_name_after(tmp_path: Path) -> None:
    path = tmp_path / "scenes" / "a"
    with SceneBagWriter(path) as writer:
        assert [entry.name for entry in path.parent.iterdir()] == ["a.partial"]
        writer.finish({})
        assert [entry.name for entry in path.parent.iterdir()] == ["a"]
    assert sorted(entry.name for entry in path.iterdir()) == ["a_0.mcap", "metadata.yaml"]


@pytest.mark.parametrize("name", ["a", "a.partial"])
def test_a_taken_name_is_refused_and_nothing_is_changed(tmp_path: Path, name: str) -> None:
    (tmp_path / name).mkdir()
    (tmp_path / name / "precious").write_text("data")
    with pytest.raises(InputError, match=f"{name}: exists already; nothing was overwritten"):
        SceneBagWriter(tmp_path / "a")
    assert [str(entry.relative_to(tmp_path)) for entry in tmp_path.rglob("*")] == [name, f"{name}/precious"]


def test_a_folder_that_cannot_be_created_is_an_input_error(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="file/a: cannot be created: Not a directory"):
        SceneBagWriter(tmp_path / "file" / "a")


def test_an_exception_leaves_a_closed_readable_partial_bag(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError, match="a node died"), SceneBagWriter(tmp_path / "a") as writer:
        writer.add_topic("/words", "std_msgs/msg/String", QosProfile())
        writer.write("/words", 5, string("last words"))
        raise RuntimeError("a node died")
    assert not (tmp_path / "a").exists()
    with AnyReader([tmp_path / "a.partial"]) as reader:
        assert [stamp for _, stamp, _ in reader.messages()] == [5]
    with SceneBag(tmp_path / "a.partial") as bag:
        assert (bag.closed, bag.finished, bag.custom_data["complete"]) == (True, False, "false")


def test_synced_messages_are_readable_wherever_the_file_is_cut_after_the_sync(tmp_path: Path) -> None:
    path = tmp_path / "a.partial" / "a_0.mcap"
    writer = SceneBagWriter(tmp_path / "a", chunk_bytes=1500)
    writer.add_topic("/words", "std_msgs/msg/String", QosProfile())
    synced: list[tuple[int, int]] = []
    for tick in range(60):
        writer.write("/words", tick, string(os.urandom(100).hex()))
        if tick % 7 == 0:
            writer.sync()
            synced.append((path.stat().st_size, tick + 1))
    writer.abandon()
    whole = path.read_bytes()
    cut = tmp_path / "cut.mcap"
    for size in range(synced[0][0], len(whole), 97):
        cut.write_bytes(whole[:size] + b"\0" * (size % 3))
        with SceneBag(cut) as bag:
            stamps = [message.stamp_ns for message in bag.messages()]
        safe = max(count for end, count in synced if end <= size)
        assert stamps == list(range(len(stamps)))
        assert len(stamps) >= safe
        assert not bag.closed


def test_kill_9_loses_nothing_that_was_synced(tmp_path: Path) -> None:
    script = f"""
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from simbev_ros.recording.bag_writer import SceneBagWriter
from simbev_ros.recording.indexed_bag import IndexedBag
from simbev_ros.recording.qos import QosProfile
writer = SceneBagWriter(Path({str(tmp_path / "a")!r}), sync_bytes=100)
writer.add_topic("/words", "std_msgs/msg/String", QosProfile())
for tick in range(600):
    writer.write("/words", tick, bytes([0, 1, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0]))
    if tick == 500:
        writer.sync()
print("halfway", flush=True)
sys.stdin.read()
"""
    with subprocess.Popen([sys.executable, "-c", script], stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == b"halfway\n"
        process.send_signal(signal.SIGKILL)
    with SceneBag(tmp_path / "a.partial") as bag:
        stamps = [message.stamp_ns for message in bag.messages()]
    assert stamps == list(range(len(stamps)))
    assert 501 <= len(stamps) <= 600


def test_written_messages_reach_the_disk_without_an_explicit_sync(tmp_path: Path) -> None:
    with SceneBagWriter(tmp_path / "a", sync_bytes=1000) as writer:
        writer.add_topic("/words", "std_msgs/msg/String", QosProfile())
        for tick in range(300):
            writer.write("/words", tick, string(f"message {tick}"))
        end_s, count = time.monotonic() + 10, 0
        while count < 250 and time.monotonic() < end_s:
            with SceneBag(tmp_path / "a.partial") as bag:
                count = len(list(bag.messages()))
    assert count >= 250


def test_digests_are_equal_exactly_for_equal_bags(tmp_path: Path) -> None:
    def digests(name: str, text: str = "message", count: int = 20) -> dict[str, str]:
        with SceneBag(write_bag(tmp_path / name, count, text)) as bag:
            return topic_digests(bag)

    first = digests("a")
    assert digests("b") == first
    other = digests("c", text="other")
    assert other["/world/scene"] == first["/world/scene"]
    assert other["/words"] != first["/words"]
    assert digests("d", count=19)["/words"] != first["/words"]


def test_digest_is_sha256_over_stamp_length_and_payload(tmp_path: Path) -> None:
    with SceneBagWriter(tmp_path / "a") as writer:
        writer.add_topic("/words", "std_msgs/msg/String", QosProfile())
        writer.write("/words", 258, b"payload")
        path = writer.finish({})
    expected = hashlib.sha256(b"\x02\x01" + bytes(6) + b"\x07" + bytes(7) + b"payload").hexdigest()
    with SceneBag(path) as bag:
        assert topic_digests(bag) == {"/words": expected}


def test_a_file_that_cannot_grow_is_a_disk_error_and_keeps_synced_messages(tmp_path: Path) -> None:
    script = f"""
import os, resource
from pathlib import Path
from simbev_ros.foundation.errors import DiskError
from simbev_ros.recording.bag_writer import SceneBagWriter
from simbev_ros.recording.indexed_bag import IndexedBag
from simbev_ros.recording.qos import QosProfile
resource.setrlimit(resource.RLIMIT_FSIZE, (30_000, resource.RLIM_INFINITY))
tick = 0
try:
    with SceneBagWriter(Path({str(tmp_path / "a")!r}), sync_bytes=1000) as writer:
        writer.add_topic("/words", "std_msgs/msg/String", QosProfile())
        while True:
            writer.write("/words", tick, os.urandom(500))
            writer.sync()
            tick += 1
except DiskError as error:
    print(tick, error)
"""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    written, reason = done.stdout.split(maxsplit=1)
    assert reason == f"{tmp_path}/a.partial: the file is larger than files may be here\n"
    assert int(written) > 40
    with SceneBag(tmp_path / "a.partial") as bag:
        assert len(list(bag.messages())) == int(written)
    assert not (tmp_path / "a").exists()


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A file system of 2 MiB."""
    disk = tmp_path / "disk"
    disk.mkdir()
    mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=2m", "tmpfs", disk], capture_output=True)
    if mounted.returncode:
        pytest.skip("no disk can be mounted here")
    yield disk
    subprocess.run(["umount", disk], check=True)


@pytest.mark.parametrize("min_free_bytes", [0, 500_000])
def test_a_full_disk_ends_the_recording_and_earlier_messages_are_intact(small_disk: Path, min_free_bytes: int) -> None:
    written = 0
    with (
        pytest.raises(DiskError, match="the disk is nearly full" if min_free_bytes else "the disk is full"),
        SceneBagWriter(
            small_disk / "a", chunk_bytes=30_000, sync_bytes=100_000, min_free_bytes=min_free_bytes
        ) as writer,
    ):
        writer.add_topic("/words", "std_msgs/msg/String", QosProfile())
        for tick in range(10_000):
            writer.write("/words", tick, os.urandom(1000))
            written += 1
    used = 2 * 2**20 - shutil.disk_usage(small_disk).free
    assert used >= 2 * 2**20 - min_free_bytes - 120_000
    with SceneBag(small_disk / "a.partial") as bag:
        stamps = [message.stamp_ns for message in bag.messages()]
        assert not bag.finished and bag.custom_data["complete"] == "false"
    assert stamps == list(range(len(stamps)))
    assert 1000 * len(stamps) > used - 120_000
    if min_free_bytes:
        with pytest.raises(DiskError, match="nearly full"):
            SceneBagWriter(small_disk / "b", min_free_bytes=min_free_bytes)
        assert not (small_disk / "b.partial").exists()
