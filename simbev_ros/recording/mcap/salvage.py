"""Salvage of a damaged MCAP file: reads every record that is complete, wherever it is in the file."""

import io
import mmap
import re
import struct
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, McapRecord, Message, Metadata, Schema
from mcap.summary import Summary
from mcap.writer import MCAP0_MAGIC

from simbev_ros.recording.mcap.chunks import RECORD_HEAD, message_at, records_in, unpack_chunk
from simbev_ros.recording.mcap.mcap_index import CRC, DAMAGE, FOOTER_BYTES, attachment_of, read_summary

_CHUNK_PATTERN = re.compile(rb"(?=(\x06.{5}\0{3}.{28}(?:\x04\0{3}zstd|\0{4})))", re.DOTALL)
"""Opcode, a length below one tebibyte, span, size, CRC and compression; the length of the compressed data follows."""
_LENGTH = struct.Struct("<Q")


@dataclass(slots=True)
class Salvage:
    """Everything that could be read from a file, except its messages.

    Attributes:
        lost: Description of each loss, naming the bytes or the record.
    """

    channels: dict[int, Channel] = field(default_factory=dict)
    schemas: dict[int, Schema] = field(default_factory=dict)
    attachments: dict[str, Attachment] = field(default_factory=dict)
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    lost: list[str] = field(default_factory=list)


def salvage(path: Path, found: Salvage) -> Iterator[Message]:
    """Yield the messages of all intact chunks with a known channel, in the order of the file.

    The summary, if it is intact, locates the records. Otherwise each record starts where the previous one ends; a
    record with an impossible length ends this chain, and the next chunk is then searched for by its byte pattern.

    Args:
        path: The file.
        found: Filled while messages are yielded; channels before their messages, ``lost`` at the end.
    """
    if not path.stat().st_size:
        found.lost.append("whatever was in it: the file is empty")
        return
    unnamed_count, closed = 0, False
    with path.open("rb") as stream, mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as data:
        summary = _summary_of(stream)
        if summary is None:
            for opcode, offset, end in _records(data, []):  # a closed file repeats its channels at its end
                if opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                    with suppress(*DAMAGE):
                        _enter(_READERS[opcode](_body(data[offset:end])), found)
        else:
            found.channels |= summary.channels
            found.schemas |= summary.schemas
        for opcode, offset, end in _records(data, found.lost) if summary is None else _listed_records(summary):
            closed |= opcode == Opcode.DATA_END
            if closed:
                break  # the summary contains nothing new
            try:
                for message in _messages(opcode, bytes(data[offset:end]), found):
                    if message.channel_id in found.channels:
                        yield message
                    else:
                        unnamed_count += 1
            except DAMAGE as error:
                found.lost.append(f"{Opcode(opcode).name.lower()} at byte {offset:,} ({end - offset:,} bytes): {error}")
        if not closed and summary is None:
            found.lost.append(f"whatever would have followed byte {len(data):,}, where the file is cut off")
    if unnamed_count:
        found.lost.append(f"{unnamed_count} messages of topics that only another, lost chunk names")


def _summary_of(stream: BinaryIO) -> Summary | None:
    """The summary if it is intact and lists chunks, else None."""
    try:
        summary = read_summary(stream)
    except (*DAMAGE, OSError):  # the file may be shorter than a footer
        return None
    return summary if summary is not None and summary.chunk_indexes else None


def _listed_records(summary: Summary) -> list[tuple[int, int, int]]:
    """Opcode, start and end of each record that a summary lists, in the order of the file."""
    chunks = [(Opcode.CHUNK, chunk.chunk_start_offset, chunk.chunk_length) for chunk in summary.chunk_indexes]
    attachments = [(Opcode.ATTACHMENT, entry.offset, entry.length) for entry in summary.attachment_indexes]
    metadata = [(Opcode.METADATA, entry.offset, entry.length) for entry in summary.metadata_indexes]
    records = sorted((*chunks, *attachments, *metadata), key=lambda record: record[1])
    return [(opcode, offset, offset + length) for opcode, offset, length in records]


def _records(data: mmap.mmap, lost: list[str]) -> Iterator[tuple[int, int, int]]:
    """Yield opcode, start and end of each record that may be intact; skipped bytes are added to ``lost``."""
    offset, size = len(MCAP0_MAGIC), len(data)
    while offset + RECORD_HEAD.size <= size:
        opcode, length = RECORD_HEAD.unpack_from(data, offset)
        end = offset + RECORD_HEAD.size + length
        if opcode in _OPCODES and end <= size and length == _LENGTHS.get(opcode, length):
            yield opcode, offset, end
            if opcode == Opcode.FOOTER:
                return
        else:
            end = _next_chunk(data, offset + 1)
            lost.append(f"bytes {offset:,} to {end - 1:,}: no record can be read there")
        offset = end


_OPCODES = frozenset(int(opcode) for opcode in Opcode)
_LENGTHS: dict[int, int] = {Opcode.DATA_END: CRC.size, Opcode.FOOTER: FOOTER_BYTES - RECORD_HEAD.size}
"""Exact lengths of the records that end the data or the file, which must not be found by mistake."""


def _next_chunk(data: mmap.mmap, start: int) -> int:
    """Offset of the next bytes that look like a chunk; the end of the file if there are none."""
    for match in _CHUNK_PATTERN.finditer(data, start):
        _, length = RECORD_HEAD.unpack_from(data, match.start())
        records_start = match.end(1) + _LENGTH.size
        end = match.start() + RECORD_HEAD.size + length
        if records_start <= end <= len(data) and _LENGTH.unpack_from(data, match.end(1))[0] == end - records_start:
            return match.start()
    return len(data)


def _messages(opcode: int, record: bytes, found: Salvage) -> Iterator[Message]:
    """Yield a message, or those of a chunk; enter all other records into ``found``. Raises one of ``DAMAGE``."""
    if opcode == Opcode.CHUNK:
        data = unpack_chunk(memoryview(record)[RECORD_HEAD.size :])
        for inner, start, end in list(records_in(data)):  # a chunk is saved as a whole or not at all
            if inner == Opcode.MESSAGE:
                yield message_at(data, start, end)
            elif inner in _READERS:
                _enter(_READERS[inner](ReadDataStream(io.BytesIO(data[start:end]))), found)
    elif opcode == Opcode.MESSAGE:
        yield message_at(record, RECORD_HEAD.size, len(record))
    elif opcode == Opcode.ATTACHMENT:
        _enter(attachment_of(record), found)
    elif opcode == Opcode.METADATA:
        _enter(Metadata.read(_body(record)), found)


def _body(record: bytes) -> ReadDataStream:
    return ReadDataStream(io.BytesIO(record[RECORD_HEAD.size :]))


_READERS: dict[int, Callable[[ReadDataStream], McapRecord]] = {
    Opcode.SCHEMA: Schema.read,
    Opcode.CHANNEL: Channel.read,
}


def _enter(record: McapRecord, found: Salvage) -> None:
    match record:
        case Channel():
            found.channels[record.id] = record
        case Schema():
            found.schemas[record.id] = record
        case Attachment():
            found.attachments[record.name] = record
        case Metadata():
            found.metadata[record.name] = record.metadata
        case _:
            pass  # newer versions of mcap may know more kinds of records; none of them is needed here
