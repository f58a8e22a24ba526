"""Sequential reader of a scene's bag: topics, messages in the order of their stamps, attachments and metadata."""

import heapq
from collections import ChainMap
from collections.abc import Collection, Iterator, Mapping, MutableMapping
from contextlib import ExitStack
from dataclasses import dataclass
from types import TracebackType
from typing import Any, BinaryIO, NamedTuple, Self

import numpy as np
from mcap.opcode import Opcode
from mcap.records import Channel, Message, Schema
from rosbags.serde import SerdeError

from simbev_ros.config.base import first_problem
from simbev_ros.foundation.errors import FOREIGN_ERRORS, BagError
from simbev_ros.foundation.files.limits import MAX_SCENE_TICKS
from simbev_ros.foundation.files.structured_text import parse_json, parse_yaml
from simbev_ros.foundation.object_store.object_path import AnyPath, ObjectPath
from simbev_ros.foundation.types import Int64Array
from simbev_ros.recording.layout import MAP_ATTACHMENT, PARTIAL_SUFFIX, SCENE_ATTACHMENT, mcap_files, read_errors
from simbev_ros.recording.mcap.chunks import message_at, read_chunk, records_in
from simbev_ros.recording.mcap.mcap_index import DAMAGE, McapIndex, read_mcap_index
from simbev_ros.schema.messages.message_types import types_with
from simbev_ros.schema.scene.spec import SceneSpec

_STRING = "std_msgs/msg/String"
COPIED_ATTACHMENTS = {SCENE_ATTACHMENT: "/world/scene", MAP_ATTACHMENT: "/world/map"}
"""Topics, by attachment, with the same content, which is left when other programs convert a bag."""


@dataclass(frozen=True, slots=True)
class Topic:
    """A topic of a bag.

    Attributes:
        stamps_ns: (N,) log time of each message, ns, in the order of recording.
    """

    name: str
    type_name: str
    type_hash: str
    stamps_ns: Int64Array


class RawMessage(NamedTuple):
    """A serialized message with its topic, stamp and type."""

    topic: str
    stamp_ns: int
    type_name: str
    data: bytes


@dataclass(frozen=True, slots=True)
class _Part:
    """An open file of a bag with its index."""

    stream: BinaryIO
    index: McapIndex

    def channels_of(self, topics: Collection[str] | None) -> set[int]:
        """Channel ids of the given topics; None: of all topics."""
        return {i for i, channel in self.index.channels.items() if topics is None or channel.topic in topics}


class SceneBag:
    """An open bag of one or several files, for reading messages in order; a context manager.

    The bag may be finished, unfinished or truncated; of a truncated bag all complete chunks are read.

    Attributes:
        name: The scene's name.
        closed: Whether the bag's files were closed by their writer, so that the bag is known to be complete.
        finished: Whether the bag is closed and not in an unfinished folder.
        topics: Topics by name, sorted.
        attachments: Contents of the attachments by file name. Those that a converted bag has lost come from the topics
            in ``COPIED_ATTACHMENTS``.
        custom_data: Facts that the recorder left in the metadata.

    Raises:
        BagError: There is no bag at this path, or it is damaged.
    """

    def __init__(self, path: AnyPath) -> None:
        self.path = path
        files = mcap_files(path)
        self.name = files[0].stem.removesuffix("_0")
        with read_errors(path), ExitStack() as opened:
            streams = [opened.enter_context(file.open("rb")) for file in files]
            self._parts = [_Part(stream, read_mcap_index(stream, str(stream.name))) for stream in streams]
            indexes = [part.index for part in self._parts]
            self.closed = all(index.closed for index in indexes)
            self.finished = self.closed and not _folder_name(files[0]).endswith(PARTIAL_SUFFIX)
            self.attachments: MutableMapping[str, bytes] = ChainMap(*(index.attachments for index in indexes))
            self.custom_data = _custom_data(indexes[-1].metadata, path)
            self.topics = {topic.name: topic for topic in sorted(self._topics(), key=lambda topic: topic.name)}
            self._copy_attachments()
            self._opened = opened.pop_all()

    @property
    def payload_bytes(self) -> Mapping[str, int]:
        """Payload in bytes by topic; empty if the recorder left none."""
        return self.counts("payload_bytes") or {}

    def fact(self, name: str) -> Any:
        """A fact from ``custom_data``, parsed from its JSON; None if it is missing.

        Raises:
            BagError: The fact is damaged.
        """
        try:
            return parse_json(self.custom_data.get(name, "null"))
        except FOREIGN_ERRORS as error:
            raise BagError(f"{self.path}: {name} in the bag's description is damaged: {error}") from None

    def counts(self, name: str) -> Mapping[str, int] | None:
        """A fact that is a number by topic; None if it is missing.

        Raises:
            BagError: The fact is damaged.
        """
        try:
            return parse_counts(self.custom_data[name]) if name in self.custom_data else None
        except FOREIGN_ERRORS as error:
            raise BagError(f"{self.path}: {name} in the bag's description is damaged: {error}") from None

    @property
    def recorded_ticks(self) -> int | None:
        """Number of recorded ticks as the recorder states it; None if it does not.

        Raises:
            BagError: The statement is damaged.
        """
        ticks = self.fact("ticks")
        if ticks is not None and not (type(ticks) is int and 0 <= ticks <= MAX_SCENE_TICKS):
            raise BagError(
                f"{self.path}: ticks in the bag's description is {ticks!r:.40}; allowed: 0 to {MAX_SCENE_TICKS}"
            )
        return ticks

    @property
    def spec(self) -> SceneSpec | None:
        """Specification of the scene; None if the bag has none.

        Raises:
            BagError: The attachment is not a scene specification of this version.
        """
        return attached_spec(self.attachments, self.path)

    @property
    def span_ns(self) -> tuple[int, int]:
        """Stamps of the first and the last message; (0, 0) for an empty bag."""
        chunks = [chunk for part in self._parts for chunk in part.index.chunks]
        return (min(c.start_ns for c in chunks), max(c.end_ns for c in chunks)) if chunks else (0, 0)

    def definitions(self) -> list[tuple[Channel, Schema]]:
        """Channel and schema of each topic, from the first file that has it; topics without a schema are left out."""
        found = {
            channel.topic: (channel, part.index.schemas[channel.schema_id])
            for part in reversed(self._parts)
            for channel in part.index.channels.values()
            if channel.schema_id in part.index.schemas
        }
        return [found[topic] for topic in self.topics if topic in found]

    def messages(
        self, topics: Collection[str] | None = None, *, from_ns: int | None = None, to_ns: int | None = None
    ) -> Iterator[RawMessage]:
        """Yield messages in the order of their stamps; messages with equal stamps come in the order of the file.

        Args:
            topics: Only these topics; None: all.
            from_ns: Only stamps from this one on; None: from the first.
            to_ns: Only stamps up to and including this one; None: up to the last.

        Raises:
            BagError: A chunk is damaged; all messages before it have been yielded.
        """
        first_ns = -1 if from_ns is None else from_ns
        last_ns = 1 << 64 if to_ns is None else to_ns
        wanted = [part.channels_of(topics) for part in self._parts]
        chunks = [
            (chunk.start_ns, number, chunk.offset, chunk.length)
            for number, (part, ids) in enumerate(zip(self._parts, wanted, strict=True))
            for chunk in part.index.chunks
            if chunk.channel_ids & ids and chunk.end_ns >= first_ns and chunk.start_ns <= last_ns
        ]
        waiting: list[tuple[int, int, int, int, Message]] = []
        for start_ns, number, offset, length in sorted(chunks):
            while waiting and waiting[0][0] < start_ns:
                yield self._raw_message(heapq.heappop(waiting))
            for position, message in enumerate(self._chunk_messages(number, offset, length)):
                if message.channel_id in wanted[number] and first_ns <= message.log_time <= last_ns:
                    heapq.heappush(waiting, (message.log_time, number, offset, position, message))
        while waiting:
            yield self._raw_message(heapq.heappop(waiting))

    def decode(self, message: RawMessage) -> Any:
        """Deserialize a message into an object with the fields of its ROS type; arrays are numpy arrays.

        Raises:
            BagError: The bytes are not a message of this type, or the type is unknown.
        """
        try:
            return types_with(message.type_name).deserialize_cdr(message.data, message.type_name)
        except (SerdeError, *FOREIGN_ERRORS) as error:
            raise BagError(f"{self.path}: {message.topic} at {message.stamp_ns} ns: {error}") from None

    def close(self) -> None:
        """Close the bag's files."""
        self._opened.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _copy_attachments(self) -> None:
        """Take the contents of lost attachments from the topics that have them, too."""
        for name, topic in COPIED_ATTACHMENTS.items():
            is_lost = name not in self.attachments and topic in self.topics
            if is_lost and (message := next(self.messages([topic]), None)) is not None:
                self.attachments[name] = text_in(message.data)

    def _topics(self) -> Iterator[Topic]:
        """Yield the topics with the stamps of their messages in all files."""
        for name in {channel.topic for part in self._parts for channel in part.index.channels.values()}:
            found = [(part.index, i) for part in self._parts for i in part.channels_of([name])]
            index, channel = found[0][0], found[0][0].channels[found[0][1]]
            stamps_ns = np.concatenate([index.locations[i].table()[:, 0] for index, i in found])
            yield Topic(name, _type_name(index, channel), channel.metadata.get("topic_type_hash", ""), stamps_ns)

    def _chunk_messages(self, number: int, offset: int, length: int) -> list[Message]:
        """Messages of the chunk at an offset of a file, in the order of the chunk."""
        try:
            data = read_chunk(self._parts[number].stream, offset, length)
            return [message_at(data, start, end) for opcode, start, end in records_in(data) if opcode == Opcode.MESSAGE]
        except DAMAGE as error:
            raise BagError(f"{self._parts[number].stream.name}: damaged chunk at byte {offset}: {error}") from None

    def _raw_message(self, entry: tuple[int, int, int, int, Message]) -> RawMessage:
        _, number, _, _, message = entry
        index = self._parts[number].index
        channel = index.channels[message.channel_id]
        return RawMessage(channel.topic, message.log_time, _type_name(index, channel), message.data)


def _folder_name(file: AnyPath) -> str:
    """Name of the folder of a file."""
    return file.parent.name if isinstance(file, ObjectPath) else file.resolve().parent.name


def _type_name(index: McapIndex, channel: Channel) -> str:
    """Type of a channel's messages; empty if the file lacks its schema."""
    schema = index.schemas.get(channel.schema_id)
    return schema.name if schema else ""


def text_in(message: bytes | memoryview) -> bytes:
    """UTF-8 text in a serialized std_msgs/String. Raises BagError if it is none."""
    try:
        value: Any = types_with(_STRING).deserialize_cdr(bytes(message), _STRING)
    except (SerdeError, *FOREIGN_ERRORS) as error:
        raise BagError(f"a text on a topic is damaged: {error}") from None
    return str(value.data).encode()


def attached_spec(attachments: Mapping[str, bytes], path: AnyPath) -> SceneSpec | None:
    """Parse the scene specification among the attachments of the bag at ``path``; None if it is not attached.

    Raises:
        BagError: The attachment is not a scene specification of this version.
    """
    text = attachments.get(SCENE_ATTACHMENT)
    if text is None:
        return None
    try:
        return SceneSpec.from_json(text)
    except FOREIGN_ERRORS as error:
        raise BagError(f"{path}: {SCENE_ATTACHMENT}: {first_problem(error)}") from None


def parse_counts(text: str) -> dict[str, int]:
    """Parse a fact that is a number by topic. Raises ValueError if it is not."""
    counts = parse_json(text)
    if not (isinstance(counts, dict) and all(type(count) is int and count >= 0 for count in counts.values())):
        raise ValueError("it is not a number by topic")
    return counts


def _custom_data(metadata: Mapping[str, Mapping[str, str]], path: AnyPath) -> dict[str, str]:
    text = metadata.get("rosbag2", {}).get("serialized_metadata", "")
    try:
        return custom_data_in(parse_yaml(text) or {})
    except FOREIGN_ERRORS as error:
        raise BagError(f"{path}: the bag's description is damaged: {error}") from None


def custom_data_in(description: Any) -> dict[str, str]:
    """The recorder's facts by name in a bag's parsed description; empty if there are none.

    Raises:
        ValueError: The description or the facts are not a mapping.
    """
    facts = description.get("custom_data") or {} if isinstance(description, dict) else None
    if not isinstance(facts, dict):
        raise ValueError("custom_data is not a mapping")
    return {str(name): str(value) for name, value in facts.items()}
