"""Tables become clouds that RViz draws: float32 throughout, positions and values as in the table."""

import struct

import numpy as np
import pytest
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import PointCloud2, PointField

from simbev_ros.drawing.displays.table_points import table_points
from simbev_ros.foundation.semantics import BOX_CLASSES
from simbev_ros.foundation.types import Table
from simbev_ros.ros.msgs.stamps import stamp_of
from simbev_ros.schema.boxes import BOX_DTYPE
from simbev_ros.schema.palette import class_color, signal_color
from simbev_ros.schema.scene.lights import STREET_LIGHT_DTYPE
from simbev_ros.schema.scene.state import ACTOR_DTYPE, SIGNAL_DTYPE, SignalState

STAMP_NS = 7_204_050_000_001
TABLES = [BOX_DTYPE, ACTOR_DTYPE, SIGNAL_DTYPE, STREET_LIGHT_DTYPE]
LIMITS = {"class": len(BOX_CLASSES), "state": len(SignalState), "color": 1 << 24, "id": 1 << 18}
"""First values beyond those that columns have."""


def rows(dtype: "np.dtype[np.void]", count: int = 7) -> Table:
    rng = np.random.default_rng(3)
    table = np.zeros(count, dtype)
    for name in dtype.names or ():
        whole = dtype[name].kind in "iu"
        table[name] = rng.integers(0, LIMITS.get(name, 200), count) if whole else rng.normal(0.0, 300.0, count)
    return table


def read(table: Table) -> tuple[PointCloud2, list[dict[str, float]]]:
    """The message, and its points, taken apart field by field as sensor_msgs/PointCloud2 describes it."""
    message = deserialize_message(table_points(table, STAMP_NS), PointCloud2)
    data = bytes(message.data)
    points = [
        {
            field.name: struct.unpack_from("<f", data, row * message.point_step + field.offset)[0]
            for field in message.fields
        }
        for row in range(message.width)
    ]
    return message, points


@pytest.mark.parametrize("dtype", TABLES)
def test_every_column_is_float32_and_has_the_values_of_the_table(dtype: "np.dtype[np.void]") -> None:
    table = rows(dtype)
    message, points = read(table)
    assert {field.datatype for field in message.fields} == {PointField.FLOAT32}
    assert (message.header.frame_id, stamp_of(message.header.stamp)) == ("map", STAMP_NS)
    assert message.row_step == message.point_step * message.width == len(message.data)
    assert (message.height, message.width, message.is_bigendian, message.is_dense) == (1, len(table), False, True)
    for name in dtype.names or ():
        assert [point[name] for point in points] == pytest.approx(table[name].astype(float), rel=1e-7), name


def packed(point: dict[str, float]) -> tuple[int, int, int]:
    """Color of a point, packed as in PCL."""
    (code,) = struct.unpack("<I", struct.pack("<f", point["rgb"]))
    return code >> 16, code >> 8 & 255, code & 255


def test_boxes_have_the_color_of_their_class_and_actors_their_own() -> None:
    boxes, actors = rows(BOX_DTYPE), rows(ACTOR_DTYPE)
    assert [packed(point) for point in read(boxes)[1]] == [class_color(BOX_CLASSES[each]) for each in boxes["class"]]
    own = [(code >> 16, code >> 8 & 255, code & 255) for code in actors["color"].tolist()]
    assert [packed(point) for point in read(actors)[1]] == own


def test_traffic_lights_have_the_color_of_their_state() -> None:
    signals = rows(SIGNAL_DTYPE)
    states = [SignalState(each).name for each in signals["state"].tolist()]
    assert [packed(point) for point in read(signals)[1]] == [signal_color(state) for state in states]


def test_a_state_that_means_nothing_is_gray() -> None:
    signals = rows(SIGNAL_DTYPE, 1)
    signals["state"] = 77
    assert packed(read(signals)[1][0]) == (128, 128, 128)


def test_speed_is_the_length_of_the_velocity() -> None:
    actors = rows(ACTOR_DTYPE, 1)
    actors["vx"], actors["vy"], actors["vz"] = 2.0, -3.0, 6.0
    assert read(actors)[1][0]["speed"] == 7.0


def test_no_rows_are_a_cloud_without_points() -> None:
    message, points = read(rows(BOX_DTYPE, 0))
    assert (message.width, len(message.data), points) == (0, 0, [])
    assert {"x", "y", "z", "visibility", "speed", "rgb"} <= {field.name for field in message.fields}


def test_ids_up_to_those_of_signs_are_exact() -> None:
    boxes = rows(BOX_DTYPE, 1)
    boxes["id"] = 0x3FFFF
    assert read(boxes)[1][0]["id"] == 0x3FFFF
