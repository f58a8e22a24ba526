"""Tables as messages of this project and of radar_msgs: a Header, and a sequence with one message per row.

CDR aligns every number with its own size. The rows of our tables have their columns in order of size, so that a
serialized row has the bytes of the row in memory, followed by padding up to the next row. All rows are written at once.
"""

import struct
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from simbev_ros.foundation.types import Table
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.schema.messages.message_rows import message_fields, row_dtype

ACTORS = "simbev_interfaces/msg/Actors"
SIGNALS = "simbev_interfaces/msg/TrafficSignals"
BOXES = "simbev_interfaces/msg/Boxes"
VIEWS = "simbev_interfaces/msg/Views"
RADAR_SCAN = "radar_msgs/msg/RadarScan"

TABLE_TYPES = (ACTORS, SIGNALS, BOXES, VIEWS, RADAR_SCAN)
"""Message types that hold a table."""

_LITTLE_ENDIAN = b"\0\1\0\0"
"""Encapsulation of plain CDR; alignment counts from behind it."""


class RowLayout(NamedTuple):
    """Layout of the rows of a table message.

    Attributes:
        sequence: Name of the field with the rows.
        fields: Names of a row's fields.
        dtype: Type of a row, with the columns of the table in the order of the fields.
        stride_bytes: Distance between two rows in a serialized message.
    """

    sequence: str
    fields: tuple[str, ...]
    dtype: np.dtype[np.void]
    stride_bytes: int


@lru_cache
def row_layout(type_name: str) -> RowLayout:
    """Layout of the rows of one of ``TABLE_TYPES``."""
    package, _, kind = type_name.split("/")
    _, sequence = message_fields(kind, package).items()
    row_type = sequence[1].removesuffix("[]").rpartition("/")[2]
    dtype = row_dtype(row_type, package)
    fields = tuple(message_fields(row_type, package))
    sizes = [dtype[index].itemsize for index in range(len(fields))]
    assert sizes == sorted(sizes, reverse=True), f"{row_type}: its fields must be in order of size"
    return RowLayout(sequence[0], fields, dtype, -(-dtype.itemsize // sizes[0]) * sizes[0])


def serialize_table(type_name: str, table: Table, stamp_ns: int, frame: str) -> bytes:
    """Serialize a table, as little-endian CDR with zeros as padding.

    Args:
        type_name: One of ``TABLE_TYPES``.
        table: (N,) rows with the columns of ``row_layout``, packed.
        stamp_ns: Stamp of the header.
        frame: Frame of the header.

    Raises:
        ValueError: The table has other columns.
    """
    _, _, dtype, stride_bytes = row_layout(type_name)
    if table.dtype != dtype:
        raise ValueError(f"no table of {type_name}: its columns are {', '.join(table.dtype.names or ())}")
    name = frame.encode() + b"\0"
    head = struct.pack("<iII", *divmod(stamp_ns, NS_PER_S), len(name)) + name
    head = _padded(head, 4) + struct.pack("<I", len(table))
    if not len(table):
        return _LITTLE_ENDIAN + head
    rows = np.zeros((len(table), stride_bytes), np.uint8)
    rows[:, : dtype.itemsize] = np.ascontiguousarray(table).view(np.uint8).reshape(len(table), dtype.itemsize)
    padding = stride_bytes - dtype.itemsize
    return _LITTLE_ENDIAN + _padded(head, dtype[0].itemsize) + rows.tobytes()[: rows.size - padding]


def table_of(type_name: str, message: Any) -> Table:
    """(N,) rows of a message of one of ``TABLE_TYPES``, as rosbags decodes it."""
    sequence, fields, dtype, _ = row_layout(type_name)
    return np.array([tuple(getattr(row, name) for name in fields) for row in getattr(message, sequence)], dtype)


def _padded(data: bytes, alignment: int) -> bytes:
    return data + bytes(-len(data) % alignment)
