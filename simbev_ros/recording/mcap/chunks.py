"""Reads the chunks of an MCAP file: unpacks them within the limits, and finds the records in them."""

import struct
from collections.abc import Iterator
from typing import BinaryIO, TypeVar

import lz4.frame
import zstandard
from mcap.opcode import Opcode
from mcap.records import Message
from zlib_ng.zlib_ng import crc32

from simbev_ros.foundation.errors import LimitError
from simbev_ros.foundation.files.limits import MAX_CHUNK_RECORDS, require_unpacked_size

RECORD_HEAD = struct.Struct("<BQ")
"""Opcode and length; the record's content follows."""

MESSAGE_HEAD = struct.Struct("<HIQQ")
"""Channel id, sequence, log time, publish time; the payload follows."""

CHUNK_HEAD = struct.Struct("<QQQII")
"""First and last log time, size and CRC before compression, length of the compression's name, which follows."""

CHUNK_DATA_LENGTH = struct.Struct("<Q")
"""Length of a chunk's records as stored; they follow."""

_Bytes = TypeVar("_Bytes", bytes, memoryview)
_ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
"""First bytes of compressed data; serialized messages begin with a zero."""

_CHUNK_MARGIN_BYTES = 1 << 20
"""Maximum size of a chunk's header, and of what compression adds to data that cannot be compressed."""


def read_chunk(stream: BinaryIO, offset: int, length: int) -> bytes:
    """Read the records of a chunk, decompressed. Raises one of ``mcap_index.DAMAGE``.

    A message outside of chunks counts as a chunk of its own; rosbag2's preset fastwrite leaves all of them there.

    Args:
        stream: The file.
        offset: Offset of the chunk in the file.
        length: Length of the chunk with its header.
    """
    require_unpacked_size(length - _CHUNK_MARGIN_BYTES)
    stream.seek(offset)
    record = stream.read(length)
    opcode, content_length = RECORD_HEAD.unpack_from(record)
    if opcode == Opcode.MESSAGE:
        return record
    if opcode != Opcode.CHUNK:
        raise ValueError("there is no chunk")
    return unpack_chunk(memoryview(record)[RECORD_HEAD.size :][:content_length])


def unpack_chunk(content: memoryview) -> bytes:
    """Decompress the records of a chunk, given as the content of its record, and check their CRC.

    Raises:
        LimitError: They unpack to more than ``max_unpacked_bytes``.
        mcap_index.DAMAGE: The chunk is damaged.
    """
    _, _, size, crc, name_length = CHUNK_HEAD.unpack_from(content)
    require_unpacked_size(size)
    start = CHUNK_HEAD.size + name_length
    compression = str(content[CHUNK_HEAD.size : start], "utf-8")
    (length,) = CHUNK_DATA_LENGTH.unpack_from(content, start)
    stored = content[start + CHUNK_DATA_LENGTH.size :][:length]
    if len(stored) != length:
        raise ValueError("its data end too early")
    data = _decompress(compression, stored, size)
    if len(data) != size:
        raise ValueError(f"its size is said to be {size:,} bytes; it is another one")
    if crc not in (0, crc32(data)):
        raise ValueError("the CRC of its records is wrong")
    return data


def _decompress(compression: str, stored: memoryview, size: int) -> bytes:
    """Decompress data that claim to have ``size`` bytes; the result is never much longer."""
    if not compression:
        return bytes(stored)
    if compression == "zstd":
        if zstandard.frame_content_size(stored) not in (-1, size):
            raise ValueError("the size of its compressed data is not that of the chunk")
        return zstandard.ZstdDecompressor().decompress(stored, max_output_size=size)
    if compression == "lz4":
        try:
            data: bytes = lz4.frame.LZ4FrameDecompressor().decompress(stored, max_length=size + 1)
        except RuntimeError as error:
            raise ValueError(str(error)) from None
        return data
    raise ValueError(f"its compression {compression!r} is unknown")


def records_in(data: bytes) -> Iterator[tuple[int, int, int]]:
    """Yield opcode, start and end of the content of each record in a sequence of records.

    Raises:
        LimitError: There are more than ``MAX_CHUNK_RECORDS``.
        ValueError: A record ends after the data.
        struct.error: A record's head ends after the data.
    """
    position, size, count = 0, len(data), 0
    while position < size:
        opcode, length = RECORD_HEAD.unpack_from(data, position)
        start = position + RECORD_HEAD.size
        position = start + length
        count += 1
        if position > size:
            raise ValueError("a record ends too late")
        if count > MAX_CHUNK_RECORDS:
            raise LimitError(f"it has more than {MAX_CHUNK_RECORDS:,} records")
        yield opcode, start, position


def message_at(data: bytes, start: int, end: int) -> Message:
    """Message whose record's content is ``data[start:end]``. Raises ValueError if it is too short."""
    if end - start < MESSAGE_HEAD.size:
        raise ValueError("a message ends too early")
    channel_id, sequence, log_time, publish_time = MESSAGE_HEAD.unpack_from(data, start)
    return Message(channel_id, log_time, plain_payload(data[start + MESSAGE_HEAD.size : end]), publish_time, sequence)


def plain_payload(payload: _Bytes) -> _Bytes | bytes:
    """The payload of a message, decompressed if rosbag2 has compressed it (compression mode ``message``).

    Raises:
        LimitError: It unpacks to more than ``max_unpacked_bytes``.
        mcap_index.DAMAGE: The compressed data are damaged.
    """
    if payload[: len(_ZSTD_MAGIC)] != _ZSTD_MAGIC:
        return payload
    size = zstandard.frame_content_size(payload)
    require_unpacked_size(size)
    if size < 0:
        raise ValueError("a compressed message does not say its size")
    return zstandard.ZstdDecompressor().decompress(payload, max_output_size=size)
