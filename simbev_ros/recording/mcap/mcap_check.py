"""Integrity check of an MCAP file: every CRC, and its indexes and summary against its contents."""

import io
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import BinaryIO

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, DataEnd, Message, MessageIndex, Metadata, Schema
from mcap.writer import MCAP0_MAGIC
from zlib_ng.zlib_ng import crc32

from simbev_ros.recording.mcap.chunks import RECORD_HEAD, message_at, records_in, unpack_chunk
from simbev_ros.recording.mcap.mcap_index import DAMAGE, FOOTER_BYTES, attachment_of, read_summary

_OPCODES = frozenset(int(opcode) for opcode in Opcode)


@dataclass(slots=True)
class McapContent:
    """Checked contents of a file, as far as it could be read.

    Attributes:
        faults: Description of each fault, naming the byte or the record.
        counts: Number of messages by channel id.
    """

    faults: list[str] = field(default_factory=list)
    channels: dict[int, Channel] = field(default_factory=dict)
    schemas: dict[int, Schema] = field(default_factory=dict)
    attachments: dict[str, bytes] = field(default_factory=dict)
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    counts: dict[int, int] = field(default_factory=dict)


def check_mcap(stream: BinaryIO, check_message: Callable[[Message, McapContent], None]) -> McapContent:
    """Read a file once from start to end and check it.

    Args:
        stream: The file, seekable.
        check_message: Called with each message of intact chunks and the contents read so far.

    Returns:
        Contents and faults of the file; if it cannot be read to its end, of the part before.
    """
    content = McapContent()
    size = stream.seek(0, 2)
    stream.seek(0)
    if stream.read(len(MCAP0_MAGIC)) != MCAP0_MAGIC:
        content.faults.append("it is not an MCAP file: its first bytes are wrong")
        return content
    section = _DataSectionChecker(content, check_message)
    for offset, opcode, record in _records(stream, size, content.faults):
        section.check_record(offset, opcode, record)
        if opcode == Opcode.DATA_END:
            content.faults += _summary_faults(stream, size, section)
            return content
    content.faults.append(f"the file is cut off: after byte {stream.tell():,} of {size:,} nothing can be read")
    return content


class _DataSectionChecker:
    """Checks the data section record by record.

    Attributes:
        content: Contents read so far.
        chunks: Length of each chunk by its offset.
        whole_chunks: Number of intact chunks.
    """

    def __init__(self, content: McapContent, check_message: Callable[[Message, McapContent], None]) -> None:
        self.content, self._check_message = content, check_message
        self.chunks: dict[int, int] = {}  # length by offset
        self._crc = crc32(MCAP0_MAGIC)
        self._expected_index: dict[int, list[tuple[int, int]]] | None = {}  # None: the chunk is damaged
        self.whole_chunks = 0

    def check_record(self, offset: int, opcode: int, record: bytes) -> None:
        """Check the next record, given with its header."""
        body = ReadDataStream(io.BytesIO(record[RECORD_HEAD.size :]))
        try:
            if opcode == Opcode.DATA_END:
                self._end(DataEnd.read(body))
                return
            self._crc = crc32(record, self._crc)
            if opcode not in (Opcode.MESSAGE_INDEX, Opcode.CHUNK):
                self._expect_no_more_index(offset)
            self._enter(offset, opcode, record, body)
        except DAMAGE as error:
            name = Opcode(opcode).name.lower().replace("_", " ") if opcode in _OPCODES else f"record {opcode}"
            self.content.faults.append(f"{name} at byte {offset:,}: {error}")

    def _enter(self, offset: int, opcode: int, record: bytes, body: ReadDataStream) -> None:
        content = self.content
        if opcode == Opcode.CHUNK:
            self._expect_no_more_index(offset)
            self.chunks[offset] = len(record)
            self._expected_index = None
            self._expected_index = self._enter_chunk(unpack_chunk(memoryview(record)[RECORD_HEAD.size :]))
            self.whole_chunks += 1
        elif opcode == Opcode.MESSAGE_INDEX:
            index = MessageIndex.read(body)
            expected = self._expected_index
            if expected is not None and sorted(index.records) != sorted(expected.pop(index.channel_id, [])):
                content.faults.append(f"message index at byte {offset:,}: it does not match the chunk's messages")
        elif opcode == Opcode.ATTACHMENT:
            attachment = attachment_of(record)
            content.attachments[attachment.name] = attachment.data
        elif opcode == Opcode.METADATA:
            metadata = Metadata.read(body)
            content.metadata[metadata.name] = metadata.metadata

    def _enter_chunk(self, data: bytes) -> dict[int, list[tuple[int, int]]]:
        """Enter a chunk's records; return its expected message indexes: log times in ns and offsets by channel id."""
        index_entries: dict[int, list[tuple[int, int]]] = {}
        for opcode, start, end in records_in(data):
            if opcode == Opcode.MESSAGE:
                message = message_at(data, start, end)
                entry = message.log_time, start - RECORD_HEAD.size
                index_entries.setdefault(message.channel_id, []).append(entry)
                self.content.counts[message.channel_id] = self.content.counts.get(message.channel_id, 0) + 1
                self._check_message(message, self.content)
            elif opcode == Opcode.SCHEMA:
                schema = Schema.read(ReadDataStream(io.BytesIO(data[start:end])))
                self.content.schemas[schema.id] = schema
            elif opcode == Opcode.CHANNEL:
                channel = Channel.read(ReadDataStream(io.BytesIO(data[start:end])))
                self.content.channels[channel.id] = channel
        return index_entries

    def _expect_no_more_index(self, offset: int) -> None:
        """Report message indexes of the last chunk that are missing; all of them must follow the chunk directly."""
        if self._expected_index:
            self.content.faults.append(f"before byte {offset:,}: a chunk's message index is missing")
        self._expected_index = {}

    def _end(self, end: DataEnd) -> None:
        if end.data_section_crc not in (0, self._crc):
            self.content.faults.append("the CRC of the data section is wrong")


def _records(stream: BinaryIO, size: int, faults: list[str]) -> Iterator[tuple[int, int, bytes]]:
    """Yield offset, opcode and bytes with header of each complete record of the data section."""
    offset = stream.tell()
    while offset + RECORD_HEAD.size <= size:
        stream.seek(offset)
        head = stream.read(RECORD_HEAD.size)
        opcode, length = RECORD_HEAD.unpack(head)
        if opcode not in _OPCODES or offset + RECORD_HEAD.size + length > size:
            return
        yield offset, opcode, head + stream.read(length)
        if opcode == Opcode.DATA_END:
            return
        offset += RECORD_HEAD.size + length
        stream.seek(offset)


def _summary_faults(stream: BinaryIO, size: int, section: _DataSectionChecker) -> Iterator[str]:
    """Yield faults after the data section: in the summary and the footer."""
    start = stream.tell()
    footer_offset = size - len(MCAP0_MAGIC) - FOOTER_BYTES
    if footer_offset < start:
        yield "the file is cut off: it has no footer"
        return
    stream.seek(-len(MCAP0_MAGIC), io.SEEK_END)
    if stream.read() != MCAP0_MAGIC:
        yield "the file is cut off: its last bytes are not those of an MCAP file"
        return
    try:
        summary = read_summary(stream)
    except DAMAGE as error:
        yield f"summary: {error}"
        return
    if summary is None or summary.statistics is None:
        yield "it has no summary"
        return
    if {chunk.chunk_start_offset: chunk.chunk_length for chunk in summary.chunk_indexes} != section.chunks:
        yield "summary: its list of chunks does not match the file"
    counts = {channel: count for channel, count in summary.statistics.channel_message_counts.items() if count}
    if section.whole_chunks == len(section.chunks) and counts != section.content.counts:
        yield "summary: its message counts do not match the file"
