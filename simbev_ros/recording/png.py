"""Writes and reads PNG images of 8 or 16 bits, several times faster than image libraries do.

Rows are filtered by NumPy, compressed by ISA-L and decompressed by zlib-ng. Every PNG decoder reads what is written;
what other encoders wrote is read too, more slowly if its rows are filtered otherwise, but for interlaced images.
Format: https://www.w3.org/TR/png-3/
"""

import struct
from collections.abc import Iterator
from enum import IntEnum

import numpy as np
from zlib_ng import zlib_ng

from simbev_ros.foundation.errors import LimitError
from simbev_ros.foundation.files.limits import MAX_IMAGE_SIDE_PX
from simbev_ros.foundation.types import AnyArray, Int16Array, UInt8Array
from simbev_ros.recording.deflate import deflate

_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_HEADER = struct.Struct(">IIBBBBB")
"""Width, height, bits of a channel, color type, compression, filter method, interlacing."""
_CHUNK_HEAD = struct.Struct(">I4s")
"""Length of the content, and kind."""
_CRC = struct.Struct(">I")
_COLOR_TYPES = {1: 0, 3: 2}
"""Color type by number of channels: gray and RGB."""
_MAX_DEFLATE_RATIO = 1032  # of zlib's format, https://zlib.net/zlib_tech.html
_ISAL_LEVEL = 1


class RowFilter(IntEnum):
    """The stored form of a row: its bytes, or their differences from the row above (modulo 256)."""

    NONE = 0
    UP = 2


_LEFT, _MEAN, _PAETH = 1, 3, 4
"""Filters that only other encoders use: differences from neighbors in the same row too."""


def encode_png(image: AnyArray, row_filter: RowFilter) -> bytes:
    """PNG of an image, lossless.

    Args:
        image: (H, W) gray or (H, W, 3) RGB, uint8 or uint16.
        row_filter: NONE compresses flat areas best, UP smooth ones.
    """
    height_px, width_px = image.shape[:2]
    channels = 1 if image.ndim == 2 else image.shape[2]
    pixels = _big_endian(np.ascontiguousarray(image)).view(np.uint8).reshape(height_px, -1)
    rows = np.empty((height_px, 1 + pixels.shape[1]), np.uint8)
    rows[:, 0] = row_filter
    if row_filter is RowFilter.UP:
        rows[0, 1:] = pixels[0]
        np.subtract(pixels[1:], pixels[:-1], out=rows[1:, 1:])
    else:
        rows[:, 1:] = pixels
    header = _HEADER.pack(width_px, height_px, 8 * image.itemsize, _COLOR_TYPES[channels], 0, 0, 0)
    chunks = ((b"IHDR", header), (b"IDAT", deflate(rows.data, _ISAL_LEVEL)), (b"IEND", b""))
    return b"".join([_SIGNATURE, *(part for kind, content in chunks for part in _chunk(kind, content))])


def decode_png(data: bytes, channels: int, *bits: int) -> AnyArray:
    """Image in a PNG: (H, W) gray or (H, W, 3) RGB, uint8 or uint16.

    Args:
        data: The PNG.
        channels: 1 or 3; no other kind of image is decoded.
        bits: Allowed numbers of bits of a channel, 8 or 16.

    Raises:
        ValueError: It is not a PNG, not of that kind, damaged, or larger than any camera's image.
    """
    header, compressed = _read_chunks(data)
    width_px, height_px, depth, color, *methods = _HEADER.unpack(header)
    if min(width_px, height_px) < 1:
        raise ValueError("it has no pixels")
    if max(width_px, height_px) > MAX_IMAGE_SIDE_PX:
        raise LimitError(f"it has {width_px} x {height_px} pixels; at most {MAX_IMAGE_SIDE_PX} a side are decoded")
    if color != _COLOR_TYPES[channels] or depth not in bits:
        raise ValueError(f"its pixels have {depth} bits and color type {color}")
    row_bytes = width_px * channels * depth // 8
    if row_bytes * height_px > _MAX_DEFLATE_RATIO * len(compressed):
        raise ValueError(f"{len(compressed)} bytes cannot hold {width_px} x {height_px} pixels")
    shape = (height_px, width_px) if channels == 1 else (height_px, width_px, channels)
    if any(methods):
        raise ValueError("it is interlaced, or packed by an unknown method")
    rows = np.frombuffer(_inflate(compressed, height_px * (1 + row_bytes)), np.uint8).reshape(height_px, -1)
    if rows[:, 0].max() > _PAETH:
        raise ValueError("a row has an unknown filter")
    is_simple = np.isin(rows[:, 0], list(RowFilter)).all()
    pixels = _unfiltered(rows) if is_simple else _unfiltered_by_neighbors(rows, channels * depth // 8)
    return _big_endian(pixels.view(np.uint16 if depth == 16 else np.uint8)).reshape(shape)


def _big_endian(image: AnyArray) -> AnyArray:
    """Swap the bytes of 16-bit values between PNG's big-endian and the machine's order."""
    return image.view(">u2").astype(np.uint16).view(image.dtype) if image.itemsize == 2 else image


def _chunk(kind: bytes, content: bytes) -> tuple[bytes, ...]:
    crc = zlib_ng.crc32(content, zlib_ng.crc32(kind))
    return _CHUNK_HEAD.pack(len(content), kind), content, _CRC.pack(crc)


def _read_chunks(data: bytes) -> tuple[bytes, bytes]:
    """Contents of the header and of all data chunks together."""
    if not data.startswith(_SIGNATURE):
        raise ValueError("not a PNG")
    chunks = list(_chunks(data))
    if not chunks or chunks[0][0] != b"IHDR" or len(chunks[0][1]) != _HEADER.size:
        raise ValueError("it does not start with a header")
    if chunks[-1][0] != b"IEND":
        raise ValueError("it is cut off")
    return chunks[0][1], b"".join(content for kind, content in chunks if kind == b"IDAT")


def _chunks(data: bytes) -> Iterator[tuple[bytes, bytes]]:
    """Kind and content of each chunk."""
    position = len(_SIGNATURE)
    while position < len(data):
        length, kind = _CHUNK_HEAD.unpack(data[position : position + _CHUNK_HEAD.size].ljust(_CHUNK_HEAD.size))
        start = position + _CHUNK_HEAD.size
        end, position = start + length, start + length + _CRC.size
        if position > len(data):
            raise ValueError("it is cut off, or a chunk has a wrong length")
        content = data[start:end]
        if _CRC.unpack_from(data, end)[0] != zlib_ng.crc32(content, zlib_ng.crc32(kind)):
            raise ValueError("a checksum is wrong")
        yield kind, content


def _inflate(compressed: bytes, size: int) -> bytes:
    content = _decompress(compressed, size)
    if len(content) != size:
        raise ValueError("it has too few pixels")
    return content


def _decompress(compressed: bytes, size: int) -> bytes:
    """At most ``size`` bytes, above 0, of what is compressed."""
    try:
        return zlib_ng.decompressobj().decompress(compressed, size)
    except zlib_ng.error as error:  # type: ignore[misc]  # the stubs declare an instance
        raise ValueError(str(error)) from None


def _unfiltered(rows: UInt8Array) -> UInt8Array:
    """Bytes of the pixels in rows that begin with the filter NONE or UP."""
    if not rows[:, 0].any():
        return np.ascontiguousarray(rows[:, 1:])
    pixels = np.empty((rows.shape[0], rows.shape[1] - 1), np.uint8)
    above = np.zeros(pixels.shape[1], np.uint8)
    for row, result in zip(rows, pixels, strict=True):
        if row[0]:
            np.add(above, row[1:], out=result)
        else:
            result[:] = row[1:]
        above = result
    return pixels


def _unfiltered_by_neighbors(rows: UInt8Array, pixel_bytes: int) -> UInt8Array:
    """Bytes of the pixels in rows with any filters, diagonal by diagonal: all pixels of one have their neighbors."""
    filters, stored = rows[:, 0], rows[:, 1:].reshape(len(rows), -1, pixel_bytes)
    height_px, width_px = stored.shape[:2]
    pixels = np.zeros((height_px + 1, width_px + 1, pixel_bytes), np.int16)  # with zeros above and to the left
    for diagonal in range(height_px + width_px - 1):
        row = np.arange(max(0, diagonal - width_px + 1), min(height_px, diagonal + 1))
        column = diagonal - row
        left, above, corner = pixels[row + 1, column], pixels[row, column + 1], pixels[row, column]
        kinds = [filters[row, None] == kind for kind in (_LEFT, RowFilter.UP, _MEAN, _PAETH)]
        expected = np.select(kinds, [left, above, (left + above) // 2, _paeth(left, above, corner)], 0)
        pixels[row + 1, column + 1] = (stored[row, column] + expected) & 0xFF
    return np.ascontiguousarray(pixels[1:, 1:], np.uint8).reshape(height_px, -1)


def _paeth(left: Int16Array, above: Int16Array, corner: Int16Array) -> Int16Array:
    """The neighbor that is nearest to left + above - corner; of equally near ones the first."""
    to_left, to_above, to_corner = np.abs(above - corner), np.abs(left - corner), np.abs(left + above - 2 * corner)
    is_left = (to_left <= to_above) & (to_left <= to_corner)
    return np.where(is_left, left, np.where(to_above <= to_corner, above, corner))
