"""Index of an MCAP file: from its summary if the file was closed, else by scanning all records that are complete."""

import io
import struct
from collections import defaultdict
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, field
from typing import BinaryIO, assert_never

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.reader import SeekingReader
from mcap.records import Attachment, Channel, ChunkIndex, Footer, Metadata, Schema, Statistics
from mcap.summary import Summary
from mcap.writer import MCAP0_MAGIC
from zlib_ng.zlib_ng import crc32
from zstandard import ZstdError

from simbev_ros.foundation.errors import FOREIGN_ERRORS, BagError, LimitError
from simbev_ros.foundation.files.limits import require_unpacked_size
from simbev_ros.foundation.object_store.object_reader import ObjectReader, prefetched
from simbev_ros.foundation.types import Int64Array
from simbev_ros.recording.mcap.chunks import MESSAGE_HEAD, RECORD_HEAD, read_chunk, records_in

DAMAGE = (McapError, ZstdError, *FOREIGN_ERRORS)
"""Exceptions that reading damaged records can raise."""

_INDEX_HEAD = struct.Struct("<BQHI")
"""Opcode and length of the record, channel id, size of the entries in bytes."""

_ENTRY = struct.Struct("<QQ")
"""Log time and offset of a message in its chunk."""

END_BYTES = 256 << 10
"""Bytes at the end of an object that are read with one request; they contain the summary of most files."""

CRC = struct.Struct("<I")
FOOTER_BYTES = RECORD_HEAD.size + 20

_Description = Channel | Schema | Attachment | Metadata
"""Records that describe messages or accompany them."""


@dataclass(frozen=True, slots=True)
class ChunkEntry:
    """Index entry of a chunk: its offset in the file, length with its header, time span and channels."""

    offset: int
    length: int
    start_ns: int
    end_ns: int
    channel_ids: frozenset[int]


@dataclass(slots=True)
class MessageLocations:
    """Locations of the messages of a channel, in the order of the file."""

    _entries: bytearray = field(default_factory=bytearray)
    _chunks: list[tuple[int, int]] = field(default_factory=list)

    def __len__(self) -> int:
        return len(self._entries) // _ENTRY.size

    def add_chunk(self, chunk_offset: int, entries: bytes) -> None:
        """Add messages of a chunk: for each its log time and its offset in the chunk, both uint64, little-endian."""
        self._entries += entries
        self._chunks.append((chunk_offset, len(entries) // _ENTRY.size))

    def table(self) -> Int64Array:
        """(N, 3) int64: log time in ns, offset of the chunk in the file, offset of the message in the chunk."""
        stamps_ns, offsets = np.frombuffer(self._entries, "<i8").reshape(-1, 2).T
        chunks, counts = np.array(self._chunks, np.int64).reshape(-1, 2).T
        return np.stack([stamps_ns, np.repeat(chunks, counts), offsets], axis=1)


@dataclass(slots=True)
class McapIndex:
    """Index of an MCAP file.

    Attributes:
        closed: Whether the file has its summary and end; if not, its writer was interrupted.
        locations: Locations of the messages by channel id, for channels that have any.
        attachments: Contents of the attachments by name.
        metadata: Metadata records by name.
    """

    closed: bool
    channels: dict[int, Channel] = field(default_factory=dict)
    schemas: dict[int, Schema] = field(default_factory=dict)
    chunks: list[ChunkEntry] = field(default_factory=list)
    locations: defaultdict[int, MessageLocations] = field(default_factory=lambda: defaultdict(MessageLocations))
    attachments: dict[str, bytes] = field(default_factory=dict)
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)


def read_mcap_index(stream: BinaryIO, name: str, attachments: Collection[str] | None = None) -> McapIndex:
    """Index an open MCAP file.

    Of an object in a store, only the end and what the summary lists are read; a truncated one is refused, since
    it would have to be read as a whole.

    Args:
        stream: The file, seekable.
        name: Name of the file in error messages.
        attachments: Names of the attachments to read from a closed file; None: all.

    Raises:
        BagError: The file is not an MCAP file, or its summary, a message index or an attachment is damaged.
    """
    size = stream.seek(0, 2)
    with prefetched(stream, [(max(0, size - END_BYTES), size)]):
        return _read_mcap_index(stream, size, name, attachments)


def _read_mcap_index(stream: BinaryIO, size: int, name: str, attachments: Collection[str] | None) -> McapIndex:
    is_object = isinstance(stream, ObjectReader)
    stream.seek(0)
    if not is_object and stream.read(len(MCAP0_MAGIC)) != MCAP0_MAGIC:
        raise BagError(f"{name}: not an MCAP file")
    stream.seek(max(0, size - len(MCAP0_MAGIC)))
    closed = size > 2 * len(MCAP0_MAGIC) and stream.read() == MCAP0_MAGIC
    if not closed and is_object:
        raise BagError(f"{name}: not an MCAP file, or cut off: its last bytes are wrong")
    if not closed:
        return _scan(stream, size, name)
    try:
        index = _from_summary(stream, name, attachments)
        if index is None and is_object:
            raise BagError(f"{name}: its messages are not in chunks, so a copy on a disk is needed to read it")
        return index or _scan(stream, size, name, closed=True)
    except DAMAGE as error:
        problem = str(error) or "a record ends too early"
        raise BagError(f"{name}: damaged: {problem}; simbev repair saves what is in it") from None


def read_summary(stream: BinaryIO) -> Summary | None:
    """Read the summary of a closed file and check its CRC; None if there is none. Raises one of ``DAMAGE``."""
    footer_offset = stream.seek(-(FOOTER_BYTES + len(MCAP0_MAGIC)), io.SEEK_END)
    end = stream.read(FOOTER_BYTES)
    footer = Footer.read(ReadDataStream(io.BytesIO(end[RECORD_HEAD.size :])))
    if footer.summary_start > footer_offset:
        raise ValueError("the summary starts after the footer")
    start = stream.seek(footer.summary_start or footer_offset)
    require_unpacked_size(footer_offset - start, "the summary")
    with prefetched(stream, [(start, stream.seek(0, io.SEEK_END))]):
        stream.seek(start)
        section = stream.read(footer_offset - start)
        if footer.summary_crc not in (0, crc32(section + end[: -CRC.size])):
            raise ValueError("the CRC of the summary is wrong")
        if not _SUMMARY_OPCODES.issuperset(opcode for opcode, _, _ in records_in(section)):
            raise ValueError("the summary contains a record that does not belong there")
        stream.seek(-len(MCAP0_MAGIC), io.SEEK_END)  # the reader looks for the magic bytes, which are there too
        summary = SeekingReader(stream).get_summary()
    if summary is not None and _listed_bytes(summary) > footer_offset:
        raise ValueError("the summary lists more bytes than the file has")
    return summary


_SUMMARY_OPCODES = frozenset(
    {
        *(Opcode.SCHEMA, Opcode.CHANNEL, Opcode.STATISTICS, Opcode.CHUNK_INDEX, Opcode.ATTACHMENT_INDEX),
        *(Opcode.METADATA_INDEX, Opcode.SUMMARY_OFFSET),
    }
)


def _listed_bytes(summary: Summary) -> int:
    """Size of all records that a summary lists."""
    chunks = sum(chunk.chunk_length + chunk.message_index_length for chunk in summary.chunk_indexes)
    attachments = sum(entry.length for entry in summary.attachment_indexes)
    return chunks + attachments + sum(entry.length for entry in summary.metadata_indexes)


def attachment_of(record: bytes) -> Attachment:
    """Parse the record of an attachment, given with its header, and check its CRC. Raises one of ``DAMAGE``."""
    attachment: Attachment = Attachment.read(ReadDataStream(io.BytesIO(record[RECORD_HEAD.size :])))
    if CRC.unpack(record[-CRC.size :])[0] not in (0, crc32(record[RECORD_HEAD.size : -CRC.size])):
        raise ValueError(f"the CRC of attachment {attachment.name} is wrong")
    return attachment


def _from_summary(stream: BinaryIO, name: str, attachments: Collection[str] | None) -> McapIndex | None:
    """Index a closed file from its summary; None: its messages are not in chunks, and no index lists them."""
    summary = read_summary(stream)
    if summary is None or summary.statistics is None:
        raise BagError(f"{name}: it has no summary")
    if summary.statistics.message_count and not summary.chunk_indexes:
        return None
    index = McapIndex(True, channels=summary.channels, schemas=summary.schemas)
    for chunk in summary.chunk_indexes:
        index.chunks.append(
            ChunkEntry(
                chunk.chunk_start_offset,
                chunk.chunk_length,
                chunk.message_start_time,
                chunk.message_end_time,
                frozenset(chunk.message_index_offsets),
            )
        )
    attached = [each for each in summary.attachment_indexes if attachments is None or each.name in attachments]
    spans = [_message_index_span(chunk) for chunk in summary.chunk_indexes]
    spans += [(each.offset, each.offset + each.length) for each in attached]
    spans += [(entry.offset, entry.offset + entry.length) for entry in summary.metadata_indexes]
    with prefetched(stream, spans):
        for chunk in summary.chunk_indexes:
            _enter_message_indexes(index, stream, chunk)
        _check_locations(index, summary.statistics)
        for each in attached:
            stream.seek(each.offset)
            index.attachments[each.name] = attachment_of(stream.read(each.length)).data
        for entry in summary.metadata_indexes:
            stream.seek(entry.offset)
            index.metadata[entry.name] = Metadata.read(_body(stream.read(entry.length))).metadata
    return index


def _message_index_span(chunk: ChunkIndex) -> tuple[int, int]:
    """First byte of the message indexes after a chunk, and the byte after their last one."""
    start = chunk.chunk_start_offset + chunk.chunk_length
    return start, start + chunk.message_index_length


def _body(record: bytes) -> ReadDataStream:
    return ReadDataStream(io.BytesIO(record[RECORD_HEAD.size :]))


def _enter_message_indexes(index: McapIndex, stream: BinaryIO, chunk: ChunkIndex) -> None:
    """Enter the message indexes after a chunk. They have no CRC, so each must be where the checked summary says."""
    start, end = _message_index_span(chunk)
    stream.seek(start)
    data = stream.read(end - start)
    for channel_id, offset in chunk.message_index_offsets.items():
        *head, size = _INDEX_HEAD.unpack_from(data, offset - start)
        entries = data[offset - start + _INDEX_HEAD.size :][:size]
        length = _INDEX_HEAD.size - RECORD_HEAD.size + len(entries)
        if head != [Opcode.MESSAGE_INDEX, length, channel_id] or len(entries) != size:
            raise ValueError(f"message index at byte {offset:,}")
        index.locations[channel_id].add_chunk(chunk.chunk_start_offset, entries)


def _check_locations(index: McapIndex, statistics: Statistics) -> None:
    """Check that all messages are listed, with times within the file's span; raises ValueError otherwise."""
    count = sum(len(locations) for locations in index.locations.values())
    if count != statistics.message_count:
        raise ValueError(f"{count} of {statistics.message_count} messages are listed")
    for channel_id, locations in index.locations.items():
        stamps_ns = locations.table()[:, 0]
        if np.any((stamps_ns < statistics.message_start_time) | (stamps_ns > statistics.message_end_time)):
            raise ValueError(f"a message index of {index.channels[channel_id].topic}")


def _scan(stream: BinaryIO, size: int, name: str, *, closed: bool = False) -> McapIndex:
    """Index a file record by record, up to its end or the first truncated or damaged record."""
    index = McapIndex(closed)
    try:
        for opcode, offset, length in _records(stream, size):
            if opcode == Opcode.CHUNK:
                record_length = RECORD_HEAD.size + length
                _enter_chunk(index, offset, record_length, read_chunk(stream, offset, record_length))
            elif opcode == Opcode.MESSAGE:
                channel_id, _, stamp_ns, _ = MESSAGE_HEAD.unpack(stream.read(MESSAGE_HEAD.size))
                index.locations[channel_id].add_chunk(offset, _ENTRY.pack(stamp_ns, 0))
                index.chunks.append(
                    ChunkEntry(offset, RECORD_HEAD.size + length, stamp_ns, stamp_ns, frozenset([channel_id]))
                )
            elif opcode in _READERS:
                _enter(index, _READERS[opcode](ReadDataStream(io.BytesIO(stream.read(length)))))
    except LimitError as error:
        raise BagError(f"{name}: record at byte {offset:,}: {error}") from None
    except DAMAGE:
        pass  # the tail that was being written when the writer was stopped
    return index


def _records(stream: BinaryIO, size: int) -> Iterator[tuple[int, int, int]]:
    """Yield opcode, offset and content's length of each complete record; the stream is then at its content."""
    offset = len(MCAP0_MAGIC)
    while offset + RECORD_HEAD.size <= size:
        stream.seek(offset)
        opcode, length = RECORD_HEAD.unpack(stream.read(RECORD_HEAD.size))
        if opcode in (0, Opcode.DATA_END) or offset + RECORD_HEAD.size + length > size:
            return
        yield opcode, offset, length
        offset += RECORD_HEAD.size + length


def _enter_chunk(index: McapIndex, offset: int, length: int, data: bytes) -> None:
    """Enter a chunk, given by its offset, its length with its header, and its decompressed records."""
    stamps_ns: dict[int, list[int]] = {}
    for opcode, start, end in records_in(data):
        if opcode == Opcode.MESSAGE:
            channel_id, _, stamp_ns, _ = MESSAGE_HEAD.unpack_from(data, start)
            stamps_ns.setdefault(channel_id, []).append(stamp_ns)
            index.locations[channel_id].add_chunk(offset, _ENTRY.pack(stamp_ns, start - RECORD_HEAD.size))
        elif opcode in _READERS:
            _enter(index, _READERS[opcode](ReadDataStream(io.BytesIO(data[start:end]))))
    all_stamps_ns = [stamp_ns for stamps in stamps_ns.values() for stamp_ns in stamps]
    index.chunks.append(ChunkEntry(offset, length, min(all_stamps_ns), max(all_stamps_ns), frozenset(stamps_ns)))


def _enter(index: McapIndex, record: _Description) -> None:
    match record:
        case Channel():
            index.channels[record.id] = record
        case Schema():
            index.schemas[record.id] = record
        case Attachment():
            index.attachments[record.name] = record.data
        case Metadata():
            index.metadata[record.name] = record.metadata
        case _:
            assert_never(record)


_READERS: dict[int, Callable[[ReadDataStream], _Description]] = {
    Opcode.SCHEMA: Schema.read,
    Opcode.CHANNEL: Channel.read,
    Opcode.ATTACHMENT: Attachment.read,
    Opcode.METADATA: Metadata.read,
}
