"""Compressed clouds, as of point_cloud_transport: equal to the PointCloud2 that they were made of, to the byte."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import zstandard

from simbev_ros.foundation.errors import BagError, LimitError
from simbev_ros.foundation.types import Table
from simbev_ros.recording.arrays import point_array
from simbev_ros.recording.compressed_clouds import COMPRESSED_CLOUD
from simbev_ros.ros.msgs.tables import compressed_message, message_from_table, table_from_cdr
from simbev_ros.schema.messages.message_types import types_with

CLOUD = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("ring", "<u2"), ("time", "<f4")])


def cloud(count: int) -> Table:
    rng = np.random.default_rng(1)
    table = np.zeros(count, CLOUD)
    for name in CLOUD.names or ():
        table[name] = rng.integers(0, 200, count)
    return table


def decoded(table: Table) -> Any:
    data = compressed_message(table, 5_500_000_000, "ego/lidar")
    return types_with(COMPRESSED_CLOUD).deserialize_cdr(data, COMPRESSED_CLOUD)


@pytest.mark.parametrize("count", [0, 1, 5000])
def test_a_compressed_cloud_has_the_fields_and_unpacks_to_the_data_of_the_other_form(count: int) -> None:
    message, plain = decoded(cloud(count)), message_from_table(cloud(count), 5_500_000_000, "ego/lidar")
    unpacked = zstandard.ZstdDecompressor().decompress(bytes(message.compressed_data))  # as subscribers do
    assert unpacked == bytes(plain.data)
    same = ("height", "width", "is_bigendian", "point_step", "row_step", "is_dense")
    assert [getattr(message, name) for name in same] == [getattr(plain, name) for name in same]
    for one, two in zip(message.fields, plain.fields, strict=True):
        assert (one.name, one.offset, one.datatype, one.count) == (two.name, two.offset, two.datatype, two.count)
    assert (message.format, message.header.frame_id, message.header.stamp.nanosec) == ("zstd", "ego/lidar", 500_000_000)
    assert np.array_equal(point_array(message), cloud(count))


def test_equal_clouds_are_equal_bytes_and_smaller_ones() -> None:
    made = compressed_message(cloud(5000), 5, "ego/lidar")
    assert made == compressed_message(cloud(5000), 5, "ego/lidar")
    assert len(made) < cloud(5000).nbytes / 2


def test_the_annotator_reads_points_of_both_forms() -> None:
    table = table_from_cdr(compressed_message(cloud(7), 5, "ego/lidar"), ("x", "y", "z"), COMPRESSED_CLOUD)
    assert np.array_equal(table, cloud(7))
    with pytest.raises(ValueError, match="has no column a"):
        table_from_cdr(compressed_message(cloud(7), 5, "ego/lidar"), ("a",), COMPRESSED_CLOUD)


@pytest.mark.parametrize(
    ("changes", "problem"),
    [
        ({"format": "draco"}, "its format is 'draco'; only zstd can be read"),
        ({"height": 2}, "180 bytes unpacked, in place of 360"),
        ({"compressed_data": b"no frame"}, "point cloud: "),
        ({"compressed_data": b""}, "point cloud: "),
    ],
    ids=["format", "size", "no frame", "empty"],
)
def test_damaged_clouds_are_refused(changes: dict[str, Any], problem: str) -> None:
    fields = {name: getattr(decoded(cloud(10)), name) for name in vars(decoded(cloud(10)))}
    with pytest.raises(BagError, match=problem):
        point_array(SimpleNamespace(**{**fields, **changes}))


def test_a_cut_off_frame_is_refused() -> None:
    message = decoded(cloud(100))
    message.compressed_data = message.compressed_data[:-5]
    with pytest.raises(BagError, match="point cloud: "):
        point_array(message)


def test_a_cloud_that_unpacks_to_too_much_is_refused() -> None:
    message, size = decoded(cloud(1)), 1 << 32
    frame = zstandard.ZstdCompressor().compressobj(size=size)
    begun = frame.compress(bytes(1 << 20)) + frame.flush(zstandard.COMPRESSOBJ_FLUSH_BLOCK)
    message.compressed_data, message.row_step = np.frombuffer(begun, np.uint8), size
    with pytest.raises(LimitError):
        point_array(message)
