import random
import re
from pathlib import Path

import numpy as np
import pytest
from damage import intact_bag
from ros_messages import image, message, point_cloud, serialize, string

from simbev_ros.foundation.errors import BagError
from simbev_ros.recording.arrays import image_array, point_array
from simbev_ros.recording.bag_writer import SceneBagWriter
from simbev_ros.recording.indexed_bag import IndexedBag
from simbev_ros.recording.mcap.chunk_cache import ChunkCache
from simbev_ros.recording.qos import QosProfile
from simbev_ros.recording.reader import SceneBag


def write_stamps(path: Path, stamps: list[tuple[str, int]]) -> Path:
    with SceneBagWriter(path, chunk_bytes=200) as writer:
        for topic in sorted({topic for topic, _ in stamps}):
            writer.add_topic(topic, "std_msgs/msg/String", QosProfile())
        for topic, stamp_ns in stamps:
            writer.write(topic, stamp_ns, string(f"{topic} {stamp_ns}" * 5))
        return writer.finish({"scene": "a"})


def test_messages_of_overlapping_chunks_come_in_order_of_stamp(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    stamps = [("/b", int(t)) for t in rng.permutation(200)] + [("/a", int(t)) for t in rng.permutation(200)]
    with SceneBag(write_stamps(tmp_path / "a", stamps)) as bag:
        read = [(m.stamp_ns, m.topic) for m in bag.messages()]
    assert len(read) == 400
    assert [stamp for stamp, _ in read] == sorted(stamp for _, stamp in stamps)
    assert read[:2] == [(0, "/b"), (0, "/a")]  # equal stamps come in the order of the file


def test_topics_and_a_span_of_time_can_be_chosen(tmp_path: Path) -> None:
    stamps = [(topic, t) for t in range(50) for topic in ("/a", "/b")]
    with SceneBag(write_stamps(tmp_path / "a", stamps)) as bag:
        read = [(m.topic, m.stamp_ns) for m in bag.messages(["/b"], from_ns=7, to_ns=9)]
        assert read == [("/b", 7), ("/b", 8), ("/b", 9)]
        assert bag.span_ns == (0, 49)
        assert list(bag.topics) == ["/a", "/b"]
        assert bag.topics["/a"].stamps_ns.tolist() == list(range(50))
        assert bag.payload_bytes["/a"] == sum(len(m.data) for m in bag.messages(["/a"]))


def test_a_flipped_bit_in_a_chunk_is_found(tmp_path: Path) -> None:
    path = write_stamps(tmp_path / "a", [("/a", t) for t in range(50)])
    data = bytearray((path / "a_0.mcap").read_bytes())
    with SceneBag(path) as bag:
        offset = bag._parts[0].index.chunks[3].offset
    data[offset + 9 + 60] ^= 1
    (path / "a_0.mcap").write_bytes(data)
    with SceneBag(path) as bag, pytest.raises(BagError, match=f"damaged chunk at byte {offset}"):
        list(bag.messages())


def test_no_flipped_bit_changes_the_contents_unnoticed(tmp_path: Path) -> None:
    path = intact_bag(tmp_path / "a")
    file, truth = path / "a_0.mcap", content(path)
    data = file.read_bytes()
    choice, found = random.Random(4), set[str]()
    for offset in choice.sample(range(8, len(data) - 8), 500):
        damaged = bytearray(data)
        damaged[offset] ^= 1 << choice.randrange(8)
        file.write_bytes(damaged)
        try:
            assert content(path) == truth, offset
        except BagError as error:
            found.update(re.findall("message index|the CRC of the summary|attachment|damaged chunk", str(error)))
    assert found == {"message index", "the CRC of the summary", "attachment", "damaged chunk"}


def content(path: Path) -> tuple[object, ...]:
    """Everything that can be read from a bag, sequentially and by the index."""
    with SceneBag(path) as bag:
        stamps = {topic.name: topic.stamps_ns.tolist() for topic in bag.topics.values()}
        read = list(bag.messages()), stamps, dict(bag.attachments)
    indexed = IndexedBag(path, ChunkCache(1 << 20))
    return *read, [
        bytes(indexed.payload(location)) for topic in indexed.topics.values() for location in topic.locations
    ]


def test_damaged_metadata_is_named(tmp_path: Path) -> None:
    path = intact_bag(tmp_path / "a")
    file = path / "a_0.mcap"
    file.write_bytes(file.read_bytes().replace(b"expected: '{\"", b"expected: '[\""))
    with SceneBag(path) as bag, pytest.raises(BagError, match="a: expected in the bag's description is damaged"):
        bag.fact("expected")


@pytest.mark.parametrize(
    ("name", "content", "problem"),
    [
        ("missing", None, "no such file or folder"),
        ("text.mcap", b"This is no bag. " * 9, "not an MCAP file"),
        ("empty.mcap", b"", "not an MCAP file"),
    ],
)
def test_a_file_that_is_not_a_bag_is_refused_with_its_name(
    tmp_path: Path, name: str, content: bytes | None, problem: str
) -> None:
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(BagError, match=f"{name}: {problem}"):
        SceneBag(tmp_path / name)


def test_a_folder_without_a_bag_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BagError, match=r"holds one \.mcap file, this folder holds 0"):
        SceneBag(tmp_path)


def test_payload_that_is_not_its_type_is_refused_with_topic_and_stamp(tmp_path: Path) -> None:
    with SceneBagWriter(tmp_path / "a") as writer:
        writer.add_topic("/words", "std_msgs/msg/String", QosProfile())
        writer.write("/words", 7, b"\0\1\0\0\xff\0\0\0")
        path = writer.finish({})
    with SceneBag(path) as bag, pytest.raises(BagError, match="/words at 7 ns"):
        bag.decode(next(bag.messages()))


def roundtrip(tmp_path: Path, type_name: str, data: bytes) -> object:
    with SceneBagWriter(tmp_path / "a") as writer:
        writer.add_topic("/topic", type_name, QosProfile())
        writer.write("/topic", 7, data)
        path = writer.finish({})
    with SceneBag(path) as bag:
        return bag.decode(next(bag.messages()))


@pytest.mark.parametrize(
    ("encoding", "dtype", "channels"),
    [("rgb8", "u1", 3), ("mono8", "u1", 1), ("mono16", "u2", 1), ("32FC1", "f4", 1), ("32FC2", "f4", 2)],
)
def test_images_are_read_back_unchanged(tmp_path: Path, encoding: str, dtype: str, channels: int) -> None:
    shape = (5, 7, channels)[: 3 if channels > 1 else 2]
    array = np.random.default_rng(0).integers(0, 256, (*shape, np.dtype(dtype).itemsize), np.uint8)
    array = array.view(dtype)[..., 0]
    read = image_array(roundtrip(tmp_path, "sensor_msgs/msg/Image", image(7, encoding, array)))
    assert read.dtype == np.dtype(dtype)
    assert read.tobytes() == array.tobytes() and read.shape == shape


def test_padded_rows_and_big_endian_pixels_are_read() -> None:
    data = np.array([1, 2, 3, 4, 99, 99, 5, 6, 7, 8, 99, 99], np.uint8)
    padded = message(
        "sensor_msgs/msg/Image",
        header=None,
        height=2,
        width=2,
        encoding="mono16",
        is_bigendian=1,
        step=6,
        data=data,
    )
    assert image_array(padded).tolist() == [[0x0102, 0x0304], [0x0506, 0x0708]]


def test_image_whose_data_are_too_short_is_refused() -> None:
    short = message(
        "sensor_msgs/msg/Image",
        header=None,
        height=2,
        width=2,
        encoding="mono8",
        is_bigendian=0,
        step=2,
        data=np.zeros(3, np.uint8),
    )
    with pytest.raises(BagError, match="image of 2x2 mono8: step 2, 3 bytes"):
        image_array(short)


def test_point_fields_are_found_at_their_offsets(tmp_path: Path) -> None:
    dtype = np.dtype(
        {"names": ["x", "ring", "time"], "formats": ["<f4", "<u2", "<f4"], "offsets": [0, 5, 8], "itemsize": 22}
    )
    table = np.zeros(3, dtype)
    table["x"], table["ring"], table["time"] = [1, 2, 3], [40, 50, 60000], [0.5, 0.25, -1]
    read = point_array(roundtrip(tmp_path, "sensor_msgs/msg/PointCloud2", point_cloud(7, table)))
    assert read.dtype.itemsize == 22
    for name in ("x", "ring", "time"):
        assert read[name].tolist() == table[name].tolist()


def test_an_organized_cloud_with_padded_rows_is_flattened() -> None:
    field = message("sensor_msgs/msg/PointField", name="v", offset=0, datatype=2, count=1)
    cloud = message(
        "sensor_msgs/msg/PointCloud2",
        header=None,
        height=2,
        width=2,
        fields=[field],
        is_bigendian=False,
        point_step=1,
        row_step=3,
        data=np.array([1, 2, 99, 3, 4, 99], np.uint8),
        is_dense=True,
    )
    assert point_array(cloud)["v"].tolist() == [1, 2, 3, 4]


def test_point_field_outside_its_point_is_refused() -> None:
    field = message("sensor_msgs/msg/PointField", name="v", offset=2, datatype=7, count=1)
    cloud = message(
        "sensor_msgs/msg/PointCloud2",
        header=None,
        height=1,
        width=1,
        fields=[field],
        is_bigendian=False,
        point_step=4,
        row_step=4,
        data=np.zeros(4, np.uint8),
        is_dense=True,
    )
    with pytest.raises(BagError, match="point cloud"):
        point_array(cloud)


@pytest.mark.parametrize(("datatype", "count", "point_step"), [(99, 1, 4), (7, 1 << 31, 4), (2, 0, 0)])
def test_point_fields_that_cannot_be_are_refused(datatype: int, count: int, point_step: int) -> None:
    field = message("sensor_msgs/msg/PointField", name="v", offset=0, datatype=datatype, count=count)
    cloud = message(
        "sensor_msgs/msg/PointCloud2",
        header=None,
        height=1,
        width=1 << 31,
        fields=[field] if point_step else [],
        is_bigendian=False,
        point_step=point_step,
        row_step=0,
        data=np.zeros(0, np.uint8),
        is_dense=True,
    )
    with pytest.raises(BagError, match="point cloud"):
        point_array(cloud)


def test_compressed_image_of_a_foreign_format_is_refused() -> None:
    foreign = message("sensor_msgs/msg/CompressedImage", header=None, format="webp", data=np.zeros(4, np.uint8))
    with pytest.raises(BagError, match="unknown format 'webp'"):
        image_array(foreign)


def test_types_are_read_from_the_file(tmp_path: Path) -> None:
    time = message("builtin_interfaces/msg/Time", sec=1, nanosec=2)
    data = serialize("rosgraph_msgs/msg/Clock", clock=time)
    clock = roundtrip(tmp_path, "rosgraph_msgs/msg/Clock", data)
    assert (clock.clock.sec, clock.clock.nanosec) == (1, 2)  # type: ignore[attr-defined]
