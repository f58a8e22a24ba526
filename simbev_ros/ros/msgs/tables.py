"""Converts between structured arrays and sensor_msgs/PointCloud2: one point per row, one field per column."""

from collections.abc import Sequence

import numpy as np
from rosbags.serde import SerdeError
from sensor_msgs.msg import PointCloud2, PointField

from simbev_ros.drawing.displays.messages import CLOUD, build, serialize, stamped
from simbev_ros.foundation.errors import SimbevError
from simbev_ros.foundation.types import Table
from simbev_ros.recording.arrays import point_array, point_dtype
from simbev_ros.recording.compressed_clouds import COMPRESSED_CLOUD, ZSTD, compress
from simbev_ros.ros.msgs.arrays import bytes_field
from simbev_ros.ros.msgs.stamps import header
from simbev_ros.schema.messages.message_types import types_with

_DATATYPE = {
    "i1": PointField.INT8,
    "u1": PointField.UINT8,
    "i2": PointField.INT16,
    "u2": PointField.UINT16,
    "i4": PointField.INT32,
    "u4": PointField.UINT32,
    "f4": PointField.FLOAT32,
    "f8": PointField.FLOAT64,
}


def message_from_table(table: Table, stamp_ns: int, frame: str, *, is_dense: bool = True) -> PointCloud2:
    """PointCloud2 message from (N,) rows; offsets and point_step are those of the array's dtype.

    Raises:
        KeyError: A column has a type that PointCloud2 does not support, such as a 64-bit integer.
    """
    dtype = table.dtype
    assert dtype.fields is not None and dtype.names is not None
    fields = [
        PointField(name=name, offset=int(dtype.fields[name][1]), datatype=_DATATYPE[dtype[name].str[1:]], count=1)
        for name in dtype.names
    ]
    message = PointCloud2(
        check_fields=True,
        header=header(stamp_ns, frame),
        height=1,
        width=len(table),
        fields=fields,
        is_bigendian=False,
        point_step=dtype.itemsize,
        row_step=dtype.itemsize * len(table),
        is_dense=is_dense,
    )
    message.data = bytes_field(np.ascontiguousarray(table))
    return message


def compressed_message(table: Table, stamp_ns: int, frame: str) -> bytes:
    """Serialized CompressedPointCloud2 message from (N,) rows; its data unpack to those of ``message_from_table``.

    Raises:
        KeyError: As ``message_from_table``.
    """
    dtype = table.dtype
    fields = [
        build("sensor_msgs/msg/PointField", name=name, offset=offset, datatype=_DATATYPE[kind.str[1:]], count=1)
        for name, (kind, offset, *_) in (dtype.fields or {}).items()
    ]
    sizes = {"height": 1, "width": len(table), "point_step": dtype.itemsize, "row_step": dtype.itemsize * len(table)}
    data = np.frombuffer(compress(np.ascontiguousarray(table).tobytes()), np.uint8)
    values = {"fields": fields, "compressed_data": data, "is_dense": True, "format": ZSTD}
    return serialize(build(COMPRESSED_CLOUD, header=stamped(stamp_ns, frame), **sizes, **values))


def table_from_cdr(payload: bytes, columns: Sequence[str] = (), type_name: str = CLOUD) -> Table:
    """(N,) structured array of a serialized cloud; of a PointCloud2, it shares its memory.

    Raises:
        ValueError: The message is of another kind, lacks one of ``columns``, or ``table_from_message`` fails.
    """
    try:
        message = types_with(type_name).deserialize_cdr(payload, type_name)
        table = table_from_message(message) if type_name == CLOUD else point_array(message)
    except (SerdeError, SimbevError) as error:
        raise ValueError(str(error)) from None
    if missing := [name for name in columns if name not in (table.dtype.names or ())]:
        raise ValueError(f"has no column {', '.join(missing)}")
    return table


def table_from_message(message: PointCloud2) -> Table:
    """(N,) structured array that shares the message's data.

    Raises:
        ValueError: The message contradicts itself, or has columns of an unknown type.
    """
    dtype, count = point_dtype(message), message.width * message.height
    if count * dtype.itemsize > len(message.data):
        raise ValueError(f"{len(message.data)} bytes do not hold {count} points of {dtype.itemsize} bytes")
    return np.frombuffer(message.data, dtype, count=count)


def rows_from_message(message: PointCloud2, dtype: np.dtype[np.void]) -> Table:
    """(N,) rows of a message that must have the columns of a dtype.

    Raises:
        ValueError: It has other columns, or ``table_from_message`` fails.
    """
    table = table_from_message(message)
    if table.dtype.names != dtype.names:
        raise ValueError(f"its columns are {', '.join(table.dtype.names or ())}")
    return table.astype(dtype, copy=False)
