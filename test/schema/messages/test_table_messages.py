"""Tables as messages: rosbags' own serializer writes the same bytes, and reads the same rows, to the bit."""

import numpy as np
import pytest

from simbev_ros.foundation.types import Table
from simbev_ros.recording.canonical import canonical_cdr
from simbev_ros.ros.msgs.message_types import message_class
from simbev_ros.schema.boxes import BOX_DTYPE
from simbev_ros.schema.messages.message_types import types_with
from simbev_ros.schema.messages.table_messages import (
    ACTORS,
    BOXES,
    SIGNALS,
    VIEWS,
    row_layout,
    serialize_table,
    table_of,
)
from simbev_ros.schema.scene.state import ACTOR_DTYPE, SIGNAL_DTYPE
from simbev_ros.schema.views import VIEW_DTYPE

DTYPES = {ACTORS: ACTOR_DTYPE, SIGNALS: SIGNAL_DTYPE, BOXES: BOX_DTYPE, VIEWS: VIEW_DTYPE}
STAMP_NS = 3_604_000_000_007


def noise(dtype: np.dtype[np.void], count: int) -> Table:
    """Rows of any bits; numbers that are not finite included, but no signaling NaN, which no reader keeps."""
    rng = np.random.default_rng(count)
    table = rng.integers(0, 256, (count, dtype.itemsize), dtype=np.uint8).view(dtype)[:, 0]
    for name in dtype.names or ():
        if dtype[name].kind == "f":
            table[name] = np.where(np.isnan(table[name]), np.nan, table[name])
            table[name][:2] = [np.inf, -0.0][:count]
    return table


@pytest.mark.parametrize("type_name", DTYPES)
def test_the_columns_of_the_table_are_the_fields_that_rosbags_reads(type_name: str) -> None:
    definitions = types_with(type_name).fielddefs
    _, (_, (_, ((_, row_type), _))) = definitions[type_name][1]
    fields = [(name.replace("class_id", "class"), kind) for name, (_, (kind, _)) in definitions[row_type][1]]
    assert row_layout(type_name).dtype == DTYPES[type_name] == np.dtype(fields)


@pytest.mark.parametrize("type_name", DTYPES)
@pytest.mark.parametrize("count", [0, 1, 2, 7, 300])
@pytest.mark.parametrize("frame", ["", "map", "ego/cam_front_optical"])
def test_rosbags_reads_the_same_rows_and_writes_the_same_bytes(type_name: str, count: int, frame: str) -> None:
    table, types = noise(DTYPES[type_name], count), types_with(type_name)
    payload = serialize_table(type_name, table, STAMP_NS, frame)
    message = types.deserialize_cdr(payload, type_name)
    assert (message.header.stamp.sec, message.header.stamp.nanosec) == (3604, 7)
    assert message.header.frame_id == frame
    assert table_of(type_name, message).tobytes() == table.tobytes()
    assert bytes(types.serialize_cdr(message, type_name)) == payload


@pytest.mark.parametrize("type_name", DTYPES)
def test_generated_code_reads_the_same_rows_and_writes_the_same_bytes(type_name: str) -> None:
    pytest.importorskip("simbev_interfaces.msg", reason="simbev_interfaces has not been made: simbev doctor --fix")
    serialization = pytest.importorskip("rclpy.serialization")
    table = noise(DTYPES[type_name], 5)
    payload = serialize_table(type_name, table, STAMP_NS, "map")
    message = serialization.deserialize_message(payload, message_class(type_name))
    assert table_of(type_name, message).tobytes() == table.tobytes()
    assert bytes(canonical_cdr(serialization.serialize_message(message), type_name)) == payload


def test_rows_that_are_not_adjacent_in_memory_are_written_alike() -> None:
    table = noise(SIGNAL_DTYPE, 8)
    assert serialize_table(SIGNALS, table[::2], 1, "map") == serialize_table(SIGNALS, table[::2].copy(), 1, "map")


@pytest.mark.parametrize("dtype", [SIGNAL_DTYPE, np.dtype(ACTOR_DTYPE.descr[::-1]), np.dtype(ACTOR_DTYPE.descr[:-1])])
def test_a_table_with_other_columns_is_refused(dtype: np.dtype[np.void]) -> None:
    with pytest.raises(ValueError, match=r"no table of simbev_interfaces/msg/Actors: its columns are "):
        serialize_table(ACTORS, np.zeros(2, dtype), STAMP_NS, "map")
