"""Conversion of decoded messages to numpy arrays: images, compressed images, and point clouds (also used as tables)."""

from typing import Any

import numpy as np

from simbev_ros.foundation.errors import FOREIGN_ERRORS, BagError
from simbev_ros.foundation.types import AnyArray, Table
from simbev_ros.recording.compressed_clouds import cloud_data
from simbev_ros.recording.image_codecs import decode_image

_IMAGE_LAYOUTS: dict[str, tuple[str, int]] = {
    "rgb8": ("u1", 3),
    "bgr8": ("u1", 3),
    "mono8": ("u1", 1),
    "mono16": ("u2", 1),
    "bayer_rggb8": ("u1", 1),
    "32FC1": ("f4", 1),
    "32FC2": ("f4", 2),
}
_POINT_FIELD_TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}


def image_array(message: Any) -> AnyArray:
    """(H, W) or (H, W, C) array of a ``sensor_msgs/msg/Image`` or ``CompressedImage``, in native byte order.

    Raises:
        BagError: The encoding is unknown, or the size of the data does not match the message's fields.
    """
    if hasattr(message, "format"):
        return decode_image(message.format, message.data.tobytes())
    if message.encoding not in _IMAGE_LAYOUTS:
        raise BagError(f"image of unknown encoding {message.encoding!r}")
    kind, channels = _IMAGE_LAYOUTS[message.encoding]
    dtype = np.dtype(kind).newbyteorder(">" if message.is_bigendian else "<")
    row_bytes = message.width * channels * dtype.itemsize
    if message.step < row_bytes or message.data.size != message.step * message.height:
        size = f"{message.width}x{message.height} {message.encoding}"
        raise BagError(f"image of {size}: step {message.step}, {message.data.size} bytes")
    rows = np.ascontiguousarray(message.data.reshape(message.height, message.step)[:, :row_bytes])
    shape = (message.height, message.width, channels)[: 3 if channels > 1 else 2]
    return rows.view(dtype).reshape(shape).astype(dtype.newbyteorder("="), copy=False)


def point_array(message: Any) -> Table:
    """(N,) structured array of a cloud, compressed or not, one row per point, with the fields at their offsets.

    Raises:
        LimitError: A compressed cloud is too large.
        BagError: A field lies outside its point or has an unknown type, or the size of the data does not match the
            message's fields.
    """
    try:
        dtype = point_dtype(message)
    except FOREIGN_ERRORS as error:
        raise BagError(f"point cloud: {error}") from None
    row_bytes = message.width * message.point_step
    data = np.frombuffer(cloud_data(message), np.uint8)
    if message.row_step < row_bytes or data.size != message.row_step * message.height:
        raise BagError(
            f"point cloud of {message.width}x{message.height}: row step {message.row_step}, {data.size} bytes"
        )
    rows = data.reshape(message.height, message.row_step)[:, :row_bytes]
    return np.ascontiguousarray(rows).reshape(-1).view(dtype)


def point_dtype(message: Any) -> np.dtype[np.void]:
    """Data type of a point of a ``sensor_msgs/msg/PointCloud2``, with the fields at their offsets.

    Raises:
        ValueError: A field lies outside its point, which numpy checks in 32 bits only, or has an unknown type; a name
            occurs twice; a point has 0 bytes.
    """
    order = ">" if message.is_bigendian else "<"
    formats: list[tuple[str, tuple[int, ...]]] = []
    for field in message.fields:
        kind = _POINT_FIELD_TYPES.get(field.datatype)
        if kind is None:
            raise ValueError(f"field {field.name!r:.60} has the unknown data type {field.datatype}")
        end = field.offset + int(kind[1:]) * max(1, field.count)
        if end > message.point_step:
            raise ValueError(f"field {field.name!r:.60} ends at byte {end} of a point of {message.point_step} bytes")
        formats.append((order + kind, (field.count,) if field.count > 1 else ()))
    if not message.point_step:
        raise ValueError("a point has 0 bytes")
    names, offsets = [field.name for field in message.fields], [field.offset for field in message.fields]
    try:
        return np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": message.point_step})
    except OverflowError as error:  # a point of more than 2 GiB
        raise ValueError(str(error)) from None
