"""Writer of an MCAP file: complete chunks, attachments and metadata are written as soon as they are given.

The records themselves come from the package mcap. Its own writer has a fixed level of compression and collects messages
itself; this one receives complete chunks, so that the thread that collects messages need not wait for zstd or the disk.
"""

import os
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    MessageIndex,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)
from mcap.writer import MCAP0_MAGIC
from zlib_ng.zlib_ng import crc32

from simbev_ros import __version__
from simbev_ros.recording.mcap.chunks import CHUNK_DATA_LENGTH, CHUNK_HEAD, MESSAGE_HEAD, RECORD_HEAD

_CRC_BYTES = 4


class Definition(NamedTuple):
    """Definition of a topic: its channel and the schema of its message type, which channels can share."""

    channel: Channel
    schema: Schema


class PackedRecords(NamedTuple):
    """Records of a chunk as they are written: their size and CRC before compression, and the data."""

    size: int
    crc: int
    data: Sequence[bytes | memoryview]
    is_compressed: bool


@dataclass(slots=True)
class ChunkInProgress:
    """Messages collected for a chunk.

    Attributes:
        is_compressed: Whether the messages are compressed already, so that the chunk is stored as it is.
        parts: Record headers and payloads, in turn.
        index_entries: Log time in ns and offset in the chunk of each message, by channel id.
        size: Size of all parts in bytes.
        payload_bytes: Size of all payloads.
    """

    is_compressed: bool = False
    parts: list[bytes | memoryview] = field(default_factory=list)
    index_entries: dict[int, list[tuple[int, int]]] = field(default_factory=dict)
    size: int = 0
    payload_bytes: int = 0

    def add_message(self, channel_id: int, sequence: int, stamp_ns: int, data: bytes | memoryview) -> None:
        """Append a message; its data must not be modified afterwards."""
        length = MESSAGE_HEAD.size + len(data)
        head = RECORD_HEAD.pack(Opcode.MESSAGE, length) + MESSAGE_HEAD.pack(channel_id, sequence, stamp_ns, stamp_ns)
        self.index_entries.setdefault(channel_id, []).append((stamp_ns, self.size))
        self.parts += (head, data)
        self.size += RECORD_HEAD.size + length
        self.payload_bytes += len(data)

    def pack(self, zstd_level: int | None, head: bytes = b"") -> PackedRecords:
        """Compress the records, after others; parts are not joined first, which would take as long."""
        parts = [head, *self.parts]
        size, crc = sum(map(len, parts)), 0
        for part in parts:
            crc = crc32(part, crc)
        if zstd_level is None or self.is_compressed:
            return PackedRecords(size, crc, parts, is_compressed=False)
        stream = zstandard.ZstdCompressor(level=zstd_level).compressobj(size)
        data = [*filter(None, map(stream.compress, parts)), stream.flush()]
        return PackedRecords(size, crc, data, is_compressed=True)


class McapFile:
    """Writes one MCAP file; for one thread at a time. When a method returns, the operating system has its data.

    A record that does not fit on the disk is removed again, so that the file ends with a complete record.

    Attributes:
        path: The file.
        size: Size of the file so far in bytes.

    Raises:
        OSError: The file exists or cannot be created; the disk is full (every method).
    """

    def __init__(self, path: Path, zstd_level: int | None) -> None:
        self.path, self.size = path, 0
        self._file = path.open("xb", buffering=0)
        self._zstd_level = zstd_level
        self._crc = 0
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, Channel] = {}
        self._counts: Counter[int] = Counter()
        self._chunks: list[ChunkIndex] = []
        self._attachments: list[AttachmentIndex] = []
        self._metadata: list[MetadataIndex] = []
        self._append(MCAP0_MAGIC, _to_bytes(Header("ros2", f"simbev_ros {__version__}")))

    def add_chunk(
        self,
        chunk: ChunkInProgress,
        definitions: Iterable[Definition] = (),
        packed: Callable[[], PackedRecords] | None = None,
    ) -> None:
        """Write messages as a chunk that starts with the definitions which the file does not have yet.

        Args:
            chunk: The messages.
            definitions: Definitions of all topics.
            packed: Waits for ``chunk.pack`` with this file's level if another thread runs it; it is of no use if the
                chunk has to start with definitions.
        """
        if not chunk.index_entries:
            return
        head = self._definitions(definitions)
        records = chunk.pack(self._zstd_level, head) if head or packed is None else packed()
        records_bytes, records_crc, data = records.size, records.crc, records.data
        data_bytes = sum(map(len, data))
        stamps_ns = [stamp_ns for entries in chunk.index_entries.values() for stamp_ns, _ in entries]
        name = b"zstd" if records.is_compressed else b""
        span_ns = min(stamps_ns), max(stamps_ns)
        length = CHUNK_HEAD.size + len(name) + CHUNK_DATA_LENGTH.size + data_bytes
        opening = RECORD_HEAD.pack(Opcode.CHUNK, length)
        opening += CHUNK_HEAD.pack(*span_ns, records_bytes, records_crc, len(name))
        opening += name + CHUNK_DATA_LENGTH.pack(data_bytes)
        chunk_bytes = len(opening) + data_bytes
        indexes, offsets = b"", {}
        for channel_id, entries in chunk.index_entries.items():
            offsets[channel_id] = self.size + chunk_bytes + len(indexes)
            indexes += _to_bytes(MessageIndex(channel_id, [(ns, len(head) + offset) for ns, offset in entries]))
        entry = ChunkIndex(
            chunk_length=chunk_bytes,
            chunk_start_offset=self.size,
            compression=name.decode(),
            compressed_size=data_bytes,
            message_end_time=span_ns[1],
            message_index_length=len(indexes),
            message_index_offsets=offsets,
            message_start_time=span_ns[0],
            uncompressed_size=records_bytes,
        )
        self._append(opening, *data, indexes)
        self._chunks.append(entry)
        self._counts.update({channel_id: len(entries) for channel_id, entries in chunk.index_entries.items()})

    def add_attachment(self, attachment: Attachment) -> None:
        """Write an attachment."""
        offset, record = self.size, _to_bytes(attachment)
        self._append(record)
        self._attachments.append(
            AttachmentIndex(offset, len(record), 0, 0, len(attachment.data), attachment.name, attachment.media_type)
        )

    def close(self, metadata: Mapping[str, Mapping[str, str]], definitions: Iterable[Definition] = ()) -> None:
        """Write metadata records by name and the summary, sync everything to disk and close the file."""
        try:
            self._definitions(definitions)
            for name, values in metadata.items():
                offset, record = self.size, _to_bytes(Metadata(name, dict(values)))
                self._append(record)
                self._metadata.append(MetadataIndex(offset, len(record), name))
            end = _to_bytes(DataEnd(self._crc))
            self._append(end, self._summary(self.size + len(end)), MCAP0_MAGIC)
            self.sync()
        finally:
            self._file.close()

    def sync(self) -> None:
        """Sync everything to disk."""
        os.fsync(self._file.fileno())

    def _definitions(self, definitions: Iterable[Definition]) -> bytes:
        """Records of the definitions that are new in this file; from now on they count as written."""
        new = [each for each in definitions if each.channel.id not in self._channels]
        schemas = {each.schema.id: each.schema for each in new if each.schema.id not in self._schemas}
        channels = {each.channel.id: each.channel for each in new}
        self._schemas |= schemas
        self._channels |= channels
        return _to_bytes(*schemas.values(), *channels.values())

    def _summary(self, start: int) -> bytes:
        """Summary section, which starts at byte ``start`` of the file, and footer."""
        groups: Mapping[Opcode, Iterable[McapRecord]] = {
            Opcode.SCHEMA: self._schemas.values(),
            Opcode.CHANNEL: self._channels.values(),
            Opcode.STATISTICS: [self._statistics()],
            Opcode.CHUNK_INDEX: self._chunks,
            Opcode.ATTACHMENT_INDEX: self._attachments,
            Opcode.METADATA_INDEX: self._metadata,
        }
        summary, offsets = bytearray(), []
        for opcode, records in groups.items():
            group = _to_bytes(*records)
            offsets.append(SummaryOffset(opcode, len(group), start + len(summary)))
            summary += group
        offsets_start = start + len(summary)
        summary += _to_bytes(*offsets)
        footer = _to_bytes(Footer(summary_crc=0, summary_offset_start=offsets_start, summary_start=start))[:-_CRC_BYTES]
        crc = crc32(footer, crc32(summary))
        return bytes(summary) + footer + crc.to_bytes(_CRC_BYTES, "little")

    def _statistics(self) -> Statistics:
        return Statistics(
            attachment_count=len(self._attachments),
            channel_count=len(self._channels),
            channel_message_counts=dict(self._counts),
            chunk_count=len(self._chunks),
            message_count=self._counts.total(),
            message_end_time=max((chunk.message_end_time for chunk in self._chunks), default=0),
            message_start_time=min((chunk.message_start_time for chunk in self._chunks), default=0),
            metadata_count=len(self._metadata),
            schema_count=len(self._schemas),
        )

    def _append(self, *records: bytes | memoryview) -> None:
        """Write either all of the records or none."""
        try:
            for record in records:
                rest = memoryview(record)
                while rest:
                    rest = rest[self._file.write(rest) or 0 :]
        except OSError:
            os.ftruncate(self._file.fileno(), self.size)
            self._file.seek(self.size)
            raise
        for record in records:
            self._crc = crc32(record, self._crc)
            self.size += len(record)


def _to_bytes(*records: McapRecord) -> bytes:
    builder = RecordBuilder()
    for each in records:
        each.write(builder)
    return builder.end()  # type: ignore[no-untyped-call]
