"""Clouds as ``point_cloud_interfaces/CompressedPointCloud2``: the data of a PointCloud2 as one Zstandard frame.

These are the messages of the transport ``zstd`` of point_cloud_transport. Nothing is lost.
"""

from typing import Any

import zstandard

from simbev_ros.foundation.errors import BagError
from simbev_ros.foundation.files.limits import require_unpacked_size

COMPRESSED_CLOUD = "point_cloud_interfaces/msg/CompressedPointCloud2"
ZSTD = "zstd"

_LEVEL = 3
"""zstd's default; the transport's is 7, which takes twice the time to save a few percent."""


def compress(data: bytes) -> bytes:
    """The frame of the data of a cloud, which says their size; equal data give equal bytes."""
    return zstandard.ZstdCompressor(level=_LEVEL).compress(data)


def cloud_data(message: Any) -> Any:
    """The bytes of a cloud in either of both types of messages.

    Raises:
        BagError: They are damaged, compressed by another transport, or have another size than the message says.
        LimitError: They unpack to more than is allowed.
    """
    if not hasattr(message, "compressed_data"):
        return message.data
    if message.format != ZSTD:
        raise BagError(f"point cloud: its format is {message.format!r:.60}; only {ZSTD} can be read")
    packed = bytes(message.compressed_data)
    try:
        size = zstandard.frame_content_size(packed)
        if size != message.row_step * message.height:
            raise BagError(f"point cloud: {size} bytes unpacked, in place of {message.row_step * message.height}")
        require_unpacked_size(size)
        return zstandard.ZstdDecompressor().decompress(packed, max_output_size=size)
    except zstandard.ZstdError as error:
        raise BagError(f"point cloud: {error}") from None
