"""Bags that demand far more memory or time than their size are refused by every reader, and losses are named."""

import io
import struct
from collections.abc import Callable
from pathlib import Path

import lz4.frame
import pytest
import zstandard
from damage import intact_bag
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import Chunk
from mcap.writer import MCAP0_MAGIC, CompressionType, Writer
from peak_memory import MIB, at_most
from ros_messages import TYPES

from simbev_ros.foundation.errors import BagError
from simbev_ros.foundation.files.limits import MAX_UNPACKED_VARIABLE
from simbev_ros.recording.bag_writer import SceneBagWriter
from simbev_ros.recording.indexed_bag import IndexedBag
from simbev_ros.recording.mcap.chunk_cache import ChunkCache
from simbev_ros.recording.mcap.chunks import unpack_chunk
from simbev_ros.recording.qos import QosProfile
from simbev_ros.recording.reader import SceneBag
from simbev_ros.recording.repair import repair_bag
from simbev_ros.recording.verify import verify_bag

LIMIT_MIB = 4


@pytest.fixture(autouse=True)
def limit(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(MAX_UNPACKED_VARIABLE, str(LIMIT_MIB))


def read_all(path: Path) -> str:
    with pytest.raises(BagError) as raised, SceneBag(path) as bag:
        list(bag.messages())
    return str(raised.value)


def read_by_index(path: Path) -> str:
    with pytest.raises(BagError) as raised:
        bag = IndexedBag(path, ChunkCache(1 << 30))
        for topic in bag.topics.values():
            for location in topic.locations:
                bag.payload(location)
    return str(raised.value)


def verify(path: Path) -> str:
    return "; ".join(fault.problem for fault in verify_bag(path))


def repair(path: Path) -> str:
    try:
        return "; ".join(repair_bag(path, path.parent / "repaired").lost)
    except BagError as error:
        return str(error)


READERS = pytest.mark.parametrize("read", [read_all, read_by_index, verify, repair])


def bag_of_zeros(path: Path, compression: CompressionType, mib: int = 64) -> Path:
    """A closed bag with one small message and one of zeros, each in a chunk of its own."""
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=1, compression=compression)
        writer.start()
        schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data")
        channel = writer.register_channel("/words", "cdr", schema)
        writer.add_message(channel, 1, b"\0\1\0\0\2\0\0\0a\0", 1)
        writer.add_message(channel, 2, bytes(mib * MIB), 2)
        writer.finish()
    return path


@pytest.mark.parametrize("compression", [CompressionType.ZSTD, CompressionType.LZ4])
@pytest.mark.parametrize("closed", [True, False], ids=["closed", "cut off"])
@READERS
def test_a_chunk_of_zeros_is_refused(
    tmp_path: Path, read: Callable[[Path], str], closed: bool, compression: CompressionType
) -> None:
    file = bag_of_zeros(tmp_path / "a.mcap", compression)
    data = file.read_bytes()
    if not closed:
        file.write_bytes(data[:-20])
    with at_most(LIMIT_MIB):
        said = read(file)
    assert "unpacks to 65 MiB; at most 4 MiB are unpacked; SIMBEV_MAX_UNPACKED_MIB=65" in said
    assert file.stat().st_size < MIB


@READERS
def test_a_higher_limit_reads_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, read: Callable[[Path], str]) -> None:
    monkeypatch.setenv(MAX_UNPACKED_VARIABLE, "9")
    file = bag_of_zeros(tmp_path / "a.mcap", CompressionType.ZSTD, mib=8)
    with SceneBag(file) as bag:
        assert [len(message.data) for message in bag.messages()] == [10, 8 * MIB]
    if read in (verify, repair):
        assert "unpacks" not in read(file)


def content(compression: str, data: bytes, size: int, crc: int = 0) -> memoryview:
    name = compression.encode()
    head = struct.pack("<QQQII", 0, 0, size, crc, len(name))
    return memoryview(head + name + struct.pack("<Q", len(data)) + data)


def zstd(data: bytes, **options: bool) -> bytes:
    return zstandard.ZstdCompressor(write_content_size=options.get("sized", True)).compress(data)


@pytest.mark.parametrize(
    ("compression", "data"),
    [
        ("zstd", zstd(bytes(64 * MIB))),
        ("zstd", zstd(bytes(64 * MIB), sized=False)),
        ("lz4", lz4.frame.compress(bytes(64 * MIB))),
        ("", bytes(100)),
        ("brotli", bytes(100)),
    ],
    ids=["zstd", "zstd without a size", "lz4", "none", "unknown"],
)
def test_a_chunk_that_lies_about_its_size_is_refused(compression: str, data: bytes) -> None:
    with at_most(LIMIT_MIB), pytest.raises((ValueError, zstandard.ZstdError)):
        unpack_chunk(content(compression, data, 1000))


def test_a_chunk_without_a_declared_size_inside_is_read() -> None:
    assert unpack_chunk(content("zstd", zstd(bytes(1000), sized=False), 1000)) == bytes(1000)
    assert unpack_chunk(content("zstd", zstd(b""), 0)) == b""


def unclosed(path: Path, records: bytes) -> Path:
    """A file of one chunk, which ends without a summary."""
    builder = RecordBuilder()
    Chunk("zstd", zstd(records), 1, 0, 0, len(records)).write(builder)
    path.write_bytes(MCAP0_MAGIC + builder.end())
    return path


@READERS
def test_a_chunk_of_millions_of_records_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, read: Callable[[Path], str]
) -> None:
    monkeypatch.setattr("simbev_ros.recording.mcap.chunks.MAX_CHUNK_RECORDS", 1000)
    assert "it has more than 1,000 records" in read(unclosed(tmp_path / "a.mcap", bytes(9 * 1001)))


def test_a_record_that_ends_after_its_chunk_is_damage(tmp_path: Path) -> None:
    record = struct.pack("<BQ", Opcode.MESSAGE, 1 << 40) + bytes(100)
    assert "a record ends too late" in verify(unclosed(tmp_path / "a.mcap", record))


def test_a_summary_that_lists_more_than_the_file_has_is_refused(tmp_path: Path) -> None:
    stream = io.BytesIO()
    writer = Writer(stream, enable_crcs=False, chunk_size=1)
    writer.start()
    schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data")
    channel = writer.register_channel("/words", "cdr", schema)
    writer.add_message(channel, 1, b"\0\1\0\0\2\0\0\0a\0", 1)
    chunks = vars(writer)["_Writer__chunk_indices"]
    chunks += chunks * 50
    writer.finish()
    (tmp_path / "a.mcap").write_bytes(stream.getvalue())
    assert "the summary lists more bytes than the file has" in read_all(tmp_path / "a.mcap")


def test_a_chunk_in_the_summary_is_not_unpacked(tmp_path: Path) -> None:
    bomb = RecordBuilder()
    Chunk("zstd", zstd(bytes(64 * MIB)), 1, 0, 0, 64 * MIB).write(bomb)
    section = bomb.end()
    start = len(MCAP0_MAGIC)
    footer = struct.pack("<BQQQI", Opcode.FOOTER, 20, start, 0, 0)
    (tmp_path / "a.mcap").write_bytes(MCAP0_MAGIC + section + footer + MCAP0_MAGIC)
    with at_most(LIMIT_MIB):
        assert "the summary contains a record that does not belong there" in read_all(tmp_path / "a.mcap")


def test_a_summary_starts_before_the_footer(tmp_path: Path) -> None:
    footer = struct.pack("<BQQQI", Opcode.FOOTER, 20, 1 << 63, 0, 0)
    (tmp_path / "a.mcap").write_bytes(MCAP0_MAGIC + footer + MCAP0_MAGIC)
    assert "the summary starts after the footer" in read_all(tmp_path / "a.mcap")


LAUGHS = "\n".join(["a0: &a0 [x, x]", *(f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 9)}]" for k in range(1, 12))])


@pytest.mark.parametrize(
    "text", [f"{LAUGHS}\ncustom_data: *a11", "custom_data: " + "[" * 3000], ids=["aliases", "depth"]
)
def test_a_description_that_expands_is_refused_and_its_loss_is_named(tmp_path: Path, text: str) -> None:
    bag = intact_bag(tmp_path / "a")
    (bag / "metadata.yaml").write_text(text)
    with at_most(64):
        (fault,) = verify_bag(bag)
    assert fault.place == "metadata.yaml" and fault.problem.startswith("it cannot be read: line ")
    assert repair_bag(bag, tmp_path / "b").lost == []  # its copy is intact
    file = tmp_path / "c.mcap"
    with file.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data")
        channel = writer.register_channel("/words", "cdr", schema, {"offered_qos_profiles": text})
        writer.add_message(channel, 1, b"\0\1\0\0\2\0\0\0a\0", 1)
        writer.add_metadata("rosbag2", {"serialized_metadata": text})
        writer.finish()
    with at_most(64):
        assert "the bag's description is damaged: line " in read_all(file)
        assert "the bag's description is damaged: line " in verify(file)
        (tmp_path / "metadata.yaml").write_text("rosbag2_bagfile_information: {}")
        assert "its copy in the file cannot be read: line " in verify(file)
        (tmp_path / "metadata.yaml").unlink()
        (loss,) = repair_bag(file, tmp_path / "d").lost
    assert loss.startswith("the recorder's accounts: their description is damaged: line ")


@pytest.mark.parametrize("expected", ["[", "[" * 100_000, "[1]", '{"/a": "x"}', '{"/a": -1}', '{"/a": {}}', "null"])
def test_accounts_that_are_no_counts_are_a_fault(tmp_path: Path, expected: str) -> None:
    with SceneBagWriter(tmp_path / "a") as writer:
        writer.finish({"expected": expected, "complete": "true"})
    assert any("expected in the bag's description is damaged" in fault.problem for fault in verify_bag(tmp_path / "a"))


@pytest.mark.parametrize("ticks", ["[]", "1e300", "4611686018427387904", "-1", '"7"'])
def test_ticks_that_no_scene_has_are_refused(tmp_path: Path, ticks: str) -> None:
    with SceneBagWriter(tmp_path / "a") as writer:
        writer.finish({"ticks": ticks})
    with (
        SceneBag(tmp_path / "a") as bag,
        pytest.raises(BagError, match=r"ticks in the bag's description is .*; all"),
    ):
        _ = bag.recorded_ticks


@pytest.mark.parametrize(
    "type_name",
    [
        "tf2_msgs/msg/TFMessage",
        "sensor_msgs/msg/PointCloud2",
        "sensor_msgs/msg/Image",
        "visualization_msgs/msg/MarkerArray",
        "std_msgs/msg/String",
        "std_msgs/msg/Float64MultiArray",
    ],
)
def test_sequences_that_end_after_their_message_are_refused(tmp_path: Path, type_name: str) -> None:
    with SceneBagWriter(tmp_path / "a") as writer:
        writer.add_topic("/a", type_name, QosProfile())
        for k in range(16):
            writer.write("/a", k, b"\0\1\0\0" + bytes(4 * k) + b"\xff" * 4 * (16 - k))
        writer.finish({})
    assert type_name in TYPES.types
    with at_most(16), SceneBag(tmp_path / "a") as bag:
        for message in bag.messages():
            with pytest.raises(BagError, match=r"/a at \d+ ns"):
                bag.decode(message)
