"""Chunks of a bag, and bags with several files."""

from pathlib import Path

import pytest
from damage import TICK_NS, intact_bag
from mcap.reader import make_reader
from ros_messages import string
from rosbags.highlevel import AnyReader

from simbev_ros.foundation.errors import BagError
from simbev_ros.recording.bag_writer import SceneBagWriter
from simbev_ros.recording.digest import topic_digests
from simbev_ros.recording.indexed_bag import IndexedBag
from simbev_ros.recording.mcap.chunk_cache import ChunkCache
from simbev_ros.recording.qos import QosProfile
from simbev_ros.recording.reader import SceneBag
from simbev_ros.recording.repair import repair_bag
from simbev_ros.recording.verify import verify_bag


@pytest.mark.parametrize("split_bytes", [None, 4000])
def test_separate_topics_share_no_chunk_with_others_in_a_single_file(tmp_path: Path, split_bytes: int | None) -> None:
    with SceneBagWriter(tmp_path / "a", chunk_bytes=2000, split_bytes=split_bytes) as writer:
        for name, apart in (("/images", True), ("/words", False), ("/clouds", True)):
            writer.add_topic(name, "std_msgs/msg/String", QosProfile(), separate_chunks=apart)
        for tick in range(20):
            for name in ("/images", "/words", "/clouds"):
                writer.write(name, tick * TICK_NS, string(f"{name} {tick}" * 20))
        writer.finish({})
    with SceneBag(tmp_path / "a") as bag:
        read = [(message.topic, message.stamp_ns) for message in bag.messages()]
    assert sorted(read) == sorted((name, k * TICK_NS) for k in range(20) for name in ("/clouds", "/images", "/words"))
    assert [stamp for _, stamp in read] == sorted(stamp for _, stamp in read)
    ends_ns, groups = 0, set()
    for file in sorted((tmp_path / "a").glob("*.mcap")):
        with file.open("rb") as stream:
            summary = make_reader(stream).get_summary()
        groups |= {frozenset(chunk.message_index_offsets) for chunk in summary.chunk_indexes}
        assert min(chunk.message_start_time for chunk in summary.chunk_indexes) >= ends_ns
        ends_ns = max(chunk.message_end_time for chunk in summary.chunk_indexes)
    assert any({1, 2} <= group for group in groups) is (split_bytes is not None)


@pytest.mark.parametrize("zstd_level", [None, 1, 9])
def test_chunks_have_the_requested_compression(tmp_path: Path, zstd_level: int | None) -> None:
    with SceneBagWriter(tmp_path / "a", zstd_level=zstd_level) as writer:
        writer.add_topic("/words", "std_msgs/msg/String", QosProfile())
        for tick in range(50):
            writer.write("/words", tick, string("word " * 100))
        path = writer.finish({})
    with (path / "a_0.mcap").open("rb") as stream:
        summary = make_reader(stream, validate_crcs=True).get_summary()
    assert summary is not None
    [chunk] = summary.chunk_indexes
    assert chunk.compression == ("" if zstd_level is None else "zstd")
    assert (chunk.compressed_size == chunk.uncompressed_size) == (zstd_level is None)
    with SceneBag(path) as bag:
        assert len(list(bag.messages())) == 50


def test_compressed_images_are_not_compressed_again(tmp_path: Path) -> None:
    topics = {"/picture": "sensor_msgs/msg/CompressedImage", "/words": "std_msgs/msg/String"}
    with SceneBagWriter(tmp_path / "a") as writer:
        for name, type_name in topics.items():
            writer.add_topic(name, type_name, QosProfile())
        for tick in range(50):
            for name in topics:
                writer.write(name, tick, string("word " * 100))
        path = writer.finish({})
    with (path / "a_0.mcap").open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        names = {channel.id: channel.topic for channel in reader.get_summary().channels.values()}
        chunks = reader.get_summary().chunk_indexes
        read = [(channel.topic, message.log_time) for _, channel, message in reader.iter_messages()]
    found = {tuple(names[i] for i in chunk.message_index_offsets): chunk.compression for chunk in chunks}
    assert found == {("/picture",): "", ("/words",): "zstd"}
    assert sorted(read) == sorted((name, tick) for name in topics for tick in range(50))


def split_bag(path: Path) -> Path:
    """An intact bag with several files."""
    return intact_bag(path, split_bytes=1500)


def test_a_split_bag_is_the_same_bag_in_several_files(tmp_path: Path) -> None:
    one, several = intact_bag(tmp_path / "one" / "a"), split_bag(tmp_path / "several" / "a")
    files = sorted(several.glob("*.mcap"), key=lambda file: int(file.stem.rpartition("_")[2]))
    assert [file.name for file in files] == [f"a_{number}.mcap" for number in range(len(files))] and len(files) > 3
    assert all(file.stat().st_size >= 1500 for file in files[:-1])
    with SceneBag(one) as first, SceneBag(several) as second:
        assert list(first.messages()) == list(second.messages())
        assert topic_digests(first) == topic_digests(second)
        assert first.custom_data == second.custom_data and first.attachments == dict(second.attachments)
        assert [t.stamps_ns.tolist() for t in first.topics.values()] == [
            t.stamps_ns.tolist() for t in second.topics.values()
        ]
        assert list(second.messages(["/world/weather"], from_ns=7 * TICK_NS, to_ns=9 * TICK_NS)) == [
            message for message in first.messages(["/world/weather"]) if 7 * TICK_NS <= message.stamp_ns <= 9 * TICK_NS
        ]
        assert second.span_ns == first.span_ns and second.finished
    with AnyReader([one]) as first_reader, AnyReader([several]) as second_reader:
        read = [
            sorted((c.topic, stamp, data) for c, stamp, data in reader.messages())
            for reader in (first_reader, second_reader)
        ]
    assert read[0] == read[1]


def test_every_message_of_a_split_bag_is_found_by_its_location(tmp_path: Path) -> None:
    payloads = [string(f"{tick}" * 90) for tick in range(60)]
    with SceneBagWriter(tmp_path / "a", chunk_bytes=400, split_bytes=900) as writer:
        writer.add_topic("/words", "std_msgs/msg/String", QosProfile())
        for tick, payload in enumerate(payloads):
            writer.write("/words", tick, payload)
        path = writer.finish({})
    bag = IndexedBag(path, ChunkCache(1 << 20))
    topic = bag.topics["/words"]
    assert len(bag.files) > 3 and topic.stamps_ns.tolist() == list(range(60))
    assert [bytes(bag.payload(location)) for location in topic.between(9, 49)] == payloads[10:50]
    elsewhere = topic.locations[7] + [0, 0, 1, 0]
    with pytest.raises(BagError, match=r"the index of the chunk at byte .* is damaged"):
        bag.payload(elsewhere)


def test_files_of_a_split_bag_that_are_missing_or_damaged_are_found(tmp_path: Path) -> None:
    path = split_bag(tmp_path / "a")
    assert verify_bag(path) == []
    middle, count = path / "a_1.mcap", len(list(path.glob("*.mcap")))
    content = middle.read_bytes()
    middle.write_bytes(content[: len(content) // 2])
    assert {fault.place for fault in verify_bag(path)} == {"a_1.mcap"}
    repaired = repair_bag(path, tmp_path / "b")
    assert verify_bag(repaired.path) and repaired.lost[0].startswith("a_1.mcap: ")
    middle.unlink()
    assert [fault.problem for fault in verify_bag(path)] == ["a_1.mcap is missing"]
    rest = repair_bag(path, tmp_path / "c")
    assert "file 1, which is missing" in rest.lost and sum(rest.counts.values()) > 0
    middle.write_bytes(content)
    (path / f"a_{count - 1}.mcap").unlink()
    assert {fault.place for fault in verify_bag(path)} == {f"a_{count - 2}.mcap", "metadata.yaml"}
