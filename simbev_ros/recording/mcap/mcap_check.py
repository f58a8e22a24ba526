"""Whether an MCAP file is what it says of itself: every CRC, and its index against its content."""

import io
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import BinaryIO

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, DataEnd, Message, MessageIndex, Metadata, Schema
from mcap.stream_reader import get_chunk_data_stream
from mcap.writer import MCAP0_MAGIC
from zlib_ng.zlib_ng import crc32

from simbev_ros.recording.mcap.mcap_index import DAMAGE, FOOTER_BYTES, RECORD_HEAD, attachment_of, read_summary

_OPCODES = frozenset(int(opcode) for opcode in Opcode)


@dataclass(slots=True)
class McapContent:
    """What has been read of a file, all of it checked.

    Attributes:
        faults: What is wrong, in words that name the place.
        counts: Messages by channel id.
    """

    faults: list[str] = field(default_factory=list)
    channels: dict[int, Channel] = field(default_factory=dict)
    schemas: dict[int, Schema] = field(default_factory=dict)
    attachments: dict[str, bytes] = field(default_factory=dict)
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    counts: dict[int, int] = field(default_factory=dict)


def check_mcap(stream: BinaryIO, see: Callable[[Message, McapContent], None]) -> McapContent:
    """Read a whole file, once, from its start to its end.

    Args:
        stream: The file, seekable.
        see: Called with each message of chunks that are whole.

    Returns:
        What it holds; of a file that cannot be read to its end, all before.
    """
    content = McapContent()
    size = stream.seek(0, 2)
    stream.seek(0)
    if stream.read(len(MCAP0_MAGIC)) != MCAP0_MAGIC:
        content.faults.append("it is not an MCAP file: its first bytes are others")
        return content
    walk = _Walk(content, see)
    for offset, opcode, record in _records(stream, size, content.faults):
        walk.take(offset, opcode, record)
        if opcode == Opcode.DATA_END:
            content.faults += _summary_faults(stream, size, walk)
            return content
    content.faults.append(f"the file is cut off: after byte {stream.tell():,} of {size:,} nothing can be read")
    return content


class _Walk:
    """Goes through the data section record by record."""

    def __init__(self, content: McapContent, see: Callable[[Message, McapContent], None]) -> None:
        self.content, self._see = content, see
        self.chunks: dict[int, int] = {}  # length by offset
        self._crc = crc32(MCAP0_MAGIC)
        self._expected_index: dict[int, list[tuple[int, int]]] | None = {}  # None: the chunk is damaged
        self.whole_chunks = 0

    def take(self, offset: int, opcode: int, record: bytes) -> None:
        """The next record: its head and all that follows."""
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
            self._expected_index = self._enter_chunk(Chunk.read(body))
            self.whole_chunks += 1
        elif opcode == Opcode.MESSAGE_INDEX:
            index = MessageIndex.read(body)
            expected = self._expected_index
            if expected is not None and sorted(index.records) != sorted(expected.pop(index.channel_id, [])):
                content.faults.append(f"message index at byte {offset:,}: it does not list what the chunk holds")
        elif opcode == Opcode.ATTACHMENT:
            attachment = attachment_of(record)
            content.attachments[attachment.name] = attachment.data
        elif opcode == Opcode.METADATA:
            metadata = Metadata.read(body)
            content.metadata[metadata.name] = metadata.metadata

    def _enter_chunk(self, chunk: Chunk) -> dict[int, list[tuple[int, int]]]:
        """What its message indexes must be: log time in ns and offset of each message, by channel id."""
        stream, size = get_chunk_data_stream(chunk, validate_crc=True)
        data, place = stream.read(size), 0
        places: dict[int, list[tuple[int, int]]] = {}
        while place < size:
            opcode, length = RECORD_HEAD.unpack_from(data, place)
            body = ReadDataStream(io.BytesIO(data[place + RECORD_HEAD.size : place + RECORD_HEAD.size + length]))
            if opcode == Opcode.MESSAGE:
                message = Message.read(body, length)
                places.setdefault(message.channel_id, []).append((message.log_time, place))
                self.content.counts[message.channel_id] = self.content.counts.get(message.channel_id, 0) + 1
                self._see(message, self.content)
            elif opcode == Opcode.SCHEMA:
                schema = Schema.read(body)
                self.content.schemas[schema.id] = schema
            elif opcode == Opcode.CHANNEL:
                channel = Channel.read(body)
                self.content.channels[channel.id] = channel
            place += RECORD_HEAD.size + length
        return places

    def _expect_no_more_index(self, offset: int) -> None:
        """All message indexes of a chunk follow it."""
        if self._expected_index:
            self.content.faults.append(f"before byte {offset:,}: a chunk's message index is missing")
        self._expected_index = {}

    def _end(self, end: DataEnd) -> None:
        if end.data_section_crc not in (0, self._crc):
            self.content.faults.append("the CRC of all before the summary is wrong")


def _records(stream: BinaryIO, size: int, faults: list[str]) -> Iterator[tuple[int, int, bytes]]:
    """Offset, opcode and bytes, its head included, of each record of the data section that is whole."""
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


def _summary_faults(stream: BinaryIO, size: int, walk: _Walk) -> Iterator[str]:
    """What is wrong behind the data section."""
    start = stream.tell()
    footer_at = size - len(MCAP0_MAGIC) - FOOTER_BYTES
    if footer_at < start:
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
    if {chunk.chunk_start_offset: chunk.chunk_length for chunk in summary.chunk_indexes} != walk.chunks:
        yield "summary: its list of chunks is not that of the file"
    counts = {channel: count for channel, count in summary.statistics.channel_message_counts.items() if count}
    if walk.whole_chunks == len(walk.chunks) and counts != walk.content.counts:
        yield "summary: its counts of messages are not those of the file"
