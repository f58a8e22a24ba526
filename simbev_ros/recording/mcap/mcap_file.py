"""One MCAP file in the making: whole chunks, attachments and metadata in, each at once on its way to the disk.

The package mcap describes the records. Its own writer knows one level of compression and only ever one file; here
chunks come ready, so that whoever collects messages need not wait for zstd and the disk.
"""

import os
import struct
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
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
from simbev_ros.recording.mcap.mcap_index import MESSAGE_HEAD, RECORD_HEAD

_CRC_BYTES = 4
_CHUNK_HEAD = struct.Struct("<QQQII")
"""First and last log time, bytes and CRC before compression, and length of the name of the compression."""
_LENGTH = struct.Struct("<Q")


class Definition(NamedTuple):
    """A topic: its channel and the type of its messages, which channels share."""

    channel: Channel
    schema: Schema


@dataclass(slots=True)
class ChunkInProgress:
    """Messages that will be one chunk.

    Attributes:
        parts: Heads of records and payloads, one behind the other.
        places: By channel id log time in ns and offset of each message.
        payload_bytes: Of all messages.
    """

    parts: list[bytes | memoryview] = field(default_factory=list)
    places: dict[int, list[tuple[int, int]]] = field(default_factory=dict)
    size: int = 0
    payload_bytes: int = 0

    def add(self, channel_id: int, sequence: int, stamp_ns: int, data: bytes | memoryview) -> None:
        """Append a message; its data must not change any more."""
        length = MESSAGE_HEAD.size + len(data)
        head = RECORD_HEAD.pack(Opcode.MESSAGE, length) + MESSAGE_HEAD.pack(channel_id, sequence, stamp_ns, stamp_ns)
        self.places.setdefault(channel_id, []).append((stamp_ns, self.size))
        self.parts += (head, data)
        self.size += RECORD_HEAD.size + length
        self.payload_bytes += len(data)


class McapFile:
    """Writes one file, for one thread at a time. What is written is with the operating system when a method returns.

    A record that does not fit on the disk is taken back, so that the file ends with a whole one.

    Attributes:
        path: The file.
        size: Bytes so far.

    Raises:
        OSError: The file exists or cannot be made; the disk is full (every method).
    """

    def __init__(self, path: Path, zstd_level: int | None) -> None:
        self.path, self.size = path, 0
        self._file = path.open("xb", buffering=0)
        self._compressor = None if zstd_level is None else zstandard.ZstdCompressor(level=zstd_level)
        self._crc = 0
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, Channel] = {}
        self._counts: Counter[int] = Counter()
        self._chunks: list[ChunkIndex] = []
        self._attachments: list[AttachmentIndex] = []
        self._metadata: list[MetadataIndex] = []
        self._append(MCAP0_MAGIC, _record(Header("ros2", f"simbev_ros {__version__}")))

    def add_chunk(self, chunk: ChunkInProgress, definitions: Iterable[Definition] = ()) -> None:
        """Write messages as one chunk, which begins with the definitions that the file does not have yet."""
        if not chunk.places:
            return
        head = self._definitions(definitions)
        records_bytes, records_crc, data = self._compressed((head, *chunk.parts))
        data_bytes = sum(map(len, data))
        stamps_ns = [stamp_ns for places in chunk.places.values() for stamp_ns, _ in places]
        name = b"" if self._compressor is None else b"zstd"
        span_ns = min(stamps_ns), max(stamps_ns)
        length = _CHUNK_HEAD.size + len(name) + _LENGTH.size + data_bytes
        opening = RECORD_HEAD.pack(Opcode.CHUNK, length)
        opening += _CHUNK_HEAD.pack(*span_ns, records_bytes, records_crc, len(name))
        opening += name + _LENGTH.pack(data_bytes)
        chunk_bytes = len(opening) + data_bytes
        indexes, offsets = b"", {}
        for channel_id, places in chunk.places.items():
            offsets[channel_id] = self.size + chunk_bytes + len(indexes)
            indexes += _record(MessageIndex(channel_id, [(ns, len(head) + place) for ns, place in places]))
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
        self._counts.update({channel_id: len(places) for channel_id, places in chunk.places.items()})

    def add_attachment(self, attachment: Attachment) -> None:
        """Write a file that goes with the messages."""
        offset, record = self.size, _record(attachment)
        self._append(record)
        self._attachments.append(
            AttachmentIndex(offset, len(record), 0, 0, len(attachment.data), attachment.name, attachment.media_type)
        )

    def close(self, metadata: Mapping[str, Mapping[str, str]], definitions: Iterable[Definition] = ()) -> None:
        """Write key-value records by name, and the summary; force all to the disk and close the file."""
        try:
            self._definitions(definitions)
            for name, values in metadata.items():
                offset, record = self.size, _record(Metadata(name, dict(values)))
                self._append(record)
                self._metadata.append(MetadataIndex(offset, len(record), name))
            end = _record(DataEnd(self._crc))
            self._append(end, self._summary(self.size + len(end)), MCAP0_MAGIC)
            self.sync()
        finally:
            self._file.close()

    def sync(self) -> None:
        """Force all to the disk."""
        os.fsync(self._file.fileno())

    def _compressed(self, parts: Sequence[bytes | memoryview]) -> tuple[int, int, list[bytes | memoryview]]:
        """Size and CRC of all parts, and what they become as one stream; they are not joined, which takes as long."""
        size, crc = sum(map(len, parts)), 0
        for part in parts:
            crc = crc32(part, crc)
        if self._compressor is None:
            return size, crc, list(parts)
        stream = self._compressor.compressobj(size)
        return size, crc, [*filter(None, map(stream.compress, parts)), stream.flush()]

    def _definitions(self, definitions: Iterable[Definition]) -> bytes:
        """Records of those that are new in this file; they count as written."""
        new = [each for each in definitions if each.channel.id not in self._channels]
        schemas = {each.schema.id: each.schema for each in new if each.schema.id not in self._schemas}
        channels = {each.channel.id: each.channel for each in new}
        self._schemas |= schemas
        self._channels |= channels
        return _record(*schemas.values(), *channels.values())

    def _summary(self, start: int) -> bytes:
        """The summary section, which starts at a byte of the file, and the footer."""
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
            group = _record(*records)
            offsets.append(SummaryOffset(opcode, len(group), start + len(summary)))
            summary += group
        offsets_at = start + len(summary)
        summary += _record(*offsets)
        footer = _record(Footer(summary_crc=0, summary_offset_start=offsets_at, summary_start=start))[:-_CRC_BYTES]
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
        """Write records, all or none."""
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


def _record(*records: McapRecord) -> bytes:
    builder = RecordBuilder()
    for each in records:
        each.write(builder)
    return builder.end()  # type: ignore[no-untyped-call]
