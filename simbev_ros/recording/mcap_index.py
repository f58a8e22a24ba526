"""What is where in an MCAP file: from its summary if it was closed, else by walking it as far as it is whole."""

import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import BinaryIO

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import Attachment, Channel, Chunk, McapRecord, Message, MessageIndex, Metadata, Schema
from mcap.stream_reader import breakup_chunk
from mcap.writer import MCAP0_MAGIC
from zstandard import ZstdError

from simbev_ros.errors import BagError

DAMAGE = (McapError, ZstdError, ValueError, KeyError, struct.error, OverflowError, MemoryError)
"""What reading damaged records raises."""

RECORD_HEAD = struct.Struct("<BQ")
"""Opcode and length."""


@dataclass(frozen=True, slots=True)
class ChunkEntry:
    """One chunk: where it starts in the file, and what it holds."""

    offset: int
    start_ns: int
    end_ns: int
    channel_ids: frozenset[int]


@dataclass(slots=True)
class McapIndex:
    """The index of one file.

    Attributes:
        closed: The file has its summary and end; otherwise its writer was interrupted.
        stamps_ns: Per channel id the log time of each message, ns, in the order of the file.
        attachments: Content by name.
        metadata: Key-value records by name.
    """

    closed: bool
    channels: dict[int, Channel] = field(default_factory=dict)
    schemas: dict[int, Schema] = field(default_factory=dict)
    chunks: list[ChunkEntry] = field(default_factory=list)
    stamps_ns: dict[int, list[int]] = field(default_factory=dict)
    attachments: dict[str, bytes] = field(default_factory=dict)
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)


def read_index(stream: BinaryIO, name: str) -> McapIndex:
    """Index an open MCAP file.

    Args:
        stream: The file, seekable.
        name: What to call it in messages.

    Raises:
        BagError: It is no MCAP file, its summary is damaged, or its messages are not in chunks.
    """
    size = stream.seek(0, 2)
    stream.seek(0)
    if stream.read(len(MCAP0_MAGIC)) != MCAP0_MAGIC:
        raise BagError(f"{name}: not an MCAP file")
    stream.seek(max(0, size - len(MCAP0_MAGIC)))
    closed = size > 2 * len(MCAP0_MAGIC) and stream.read() == MCAP0_MAGIC
    if not closed:
        return _walk(stream, size)
    try:
        return _from_summary(stream)
    except DAMAGE as error:
        raise BagError(f"{name}: damaged summary: {error}") from None


def read_chunk(stream: BinaryIO, offset: int) -> list[McapRecord]:
    """The records of the chunk at an offset, its CRC checked. Raises one of ``DAMAGE``."""
    stream.seek(offset + RECORD_HEAD.size)
    return breakup_chunk(Chunk.read(ReadDataStream(stream)), validate_crc=True)


def _from_summary(stream: BinaryIO) -> McapIndex:
    stream.seek(0)
    reader = make_reader(stream, validate_crcs=True)
    summary = reader.get_summary()
    if summary is None or summary.statistics is None:
        raise ValueError("there is none")
    if summary.statistics.message_count and not summary.chunk_indexes:
        raise ValueError("it lists no chunks")
    index = McapIndex(True, channels=summary.channels, schemas=summary.schemas)
    for chunk in summary.chunk_indexes:
        ids = frozenset(chunk.message_index_offsets)
        index.chunks.append(ChunkEntry(chunk.chunk_start_offset, chunk.message_start_time, chunk.message_end_time, ids))
        for channel_id, offset in chunk.message_index_offsets.items():
            stream.seek(offset + RECORD_HEAD.size)
            entries = MessageIndex.read(ReadDataStream(stream)).records
            index.stamps_ns.setdefault(channel_id, []).extend(stamp_ns for stamp_ns, _ in entries)
    index.attachments = {attachment.name: attachment.data for attachment in reader.iter_attachments()}
    index.metadata = {metadata.name: metadata.metadata for metadata in reader.iter_metadata()}
    return index


def _walk(stream: BinaryIO, size: int) -> McapIndex:
    """Index record by record up to the first that is cut off or damaged."""
    index = McapIndex(False)
    try:
        for opcode, offset in _records(stream, size):
            if opcode == Opcode.CHUNK:
                _enter_chunk(index, offset, read_chunk(stream, offset))
            elif opcode in _READERS:
                _enter(index, _READERS[opcode](ReadDataStream(stream)))
    except DAMAGE:
        pass  # the tail that was being written when the writer was stopped
    return index


def _records(stream: BinaryIO, size: int) -> Iterator[tuple[int, int]]:
    """Opcode and offset of each whole record, the stream standing behind the record's head."""
    offset = len(MCAP0_MAGIC)
    while offset + RECORD_HEAD.size <= size:
        stream.seek(offset)
        opcode, length = RECORD_HEAD.unpack(stream.read(RECORD_HEAD.size))
        if opcode in (0, Opcode.DATA_END) or offset + RECORD_HEAD.size + length > size:
            return
        yield opcode, offset
        offset += RECORD_HEAD.size + length


def _enter_chunk(index: McapIndex, offset: int, records: list[McapRecord]) -> None:
    messages = [record for record in records if isinstance(record, Message)]
    for record in records:
        _enter(index, record)
    stamps_ns = [message.log_time for message in messages]
    ids = frozenset(message.channel_id for message in messages)
    index.chunks.append(ChunkEntry(offset, min(stamps_ns), max(stamps_ns), ids))


def _enter(index: McapIndex, record: McapRecord) -> None:
    match record:
        case Message():
            index.stamps_ns.setdefault(record.channel_id, []).append(record.log_time)
        case Channel():
            index.channels[record.id] = record
        case Schema():
            index.schemas[record.id] = record
        case Attachment():
            index.attachments[record.name] = record.data
        case Metadata():
            index.metadata[record.name] = record.metadata


_READERS: dict[int, Callable[[ReadDataStream], McapRecord]] = {
    Opcode.SCHEMA: Schema.read,
    Opcode.CHANNEL: Channel.read,
    Opcode.ATTACHMENT: Attachment.read,
    Opcode.METADATA: Metadata.read,
}
