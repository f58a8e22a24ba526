"""Writer of a scene's bag: serialized messages in, a rosbag2 bag (MCAP files and ``metadata.yaml``) out.

The bag grows in ``<name>.partial`` and gets its final name only when it is complete. A chunk is handed to the operating
system as soon as it is complete, so it stays readable however the process ends. After every ``sync_bytes`` of payload
the file is synced to disk in the background; a power cut costs at most two such portions.

Large topics, such as sensor data, can be written to chunks of their own. A reader that needs only labels or only the
motion then has little else to read. Topics whose messages are compressed already have chunks that are stored as they
are.
"""

import json
from collections import deque
from collections.abc import Callable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import NamedTuple, Self

from mcap.records import Attachment, Channel, Schema

from simbev_ros.foundation.errors import DiskError, InputError
from simbev_ros.foundation.files.syncing import sync
from simbev_ros.foundation.threads import usable_cores
from simbev_ros.recording.bag_files import BagFiles, check_space, disk_errors
from simbev_ros.recording.bag_metadata import RecordedTopic, bag_information, to_yaml
from simbev_ros.recording.compressed_clouds import COMPRESSED_CLOUD
from simbev_ros.recording.layout import METADATA_FILE, partial_of
from simbev_ros.recording.mcap.mcap_file import ChunkInProgress, Definition
from simbev_ros.recording.qos import QosProfile
from simbev_ros.recording.video import VIDEO_TYPE
from simbev_ros.schema.messages.message_types import message_definition, type_hash

_MAX_PACKERS = 4
"""Maximum number of threads that compress chunks."""
_MAX_WAITING = 4
"""Maximum number of tasks that wait for the disk thread; beyond it ``write`` blocks."""


class _Group(NamedTuple):
    """Topics that share chunks."""

    is_separate: bool
    is_compressed: bool


_COMPRESSED = ("sensor_msgs/msg/CompressedImage", VIDEO_TYPE, COMPRESSED_CLOUD)
"""Types of messages that are compressed, so that compressing them again gains nothing."""
_COMMON = _Group(is_separate=False, is_compressed=False)


class SceneBagWriter:
    """Writes one scene's bag.

    As a context manager it abandons the bag unless ``finish`` was called. It is meant for one thread and passes
    compression and disk access to others, for which only a few chunks may wait.

    Args:
        path: The finished bag's folder.
        chunk_bytes: Size of a chunk before compression.
        zstd_level: Compression level of chunks; None: chunks are not compressed.
        split_bytes: A file of this size is closed and a new one is started; all topics then share chunks, so that the
            time spans of files do not overlap. None: the bag has one file.
        sync_bytes: Amount of payload that is synced to disk together.
        min_free_bytes: Space that must stay free on the disk.

    Attributes:
        path: The finished bag's folder; until then the bag is in ``partial_path``.

    Raises:
        InputError: There is a bag with this name, finished or not, or its folder cannot be created.
        DiskError: The disk is full, nearly full or failing (every method that writes, possibly on a later call).
    """

    def __init__(
        self,
        path: Path,
        *,
        chunk_bytes: int = 4 << 20,
        zstd_level: int | None = 1,
        split_bytes: int | None = None,
        sync_bytes: int = 32 << 20,
        min_free_bytes: int = 0,
    ) -> None:
        self.path = path
        self.partial_path = partial_of(path)
        for taken in (self.path, self.partial_path):
            if taken.exists():
                raise InputError(f"{taken}: exists already; nothing was overwritten")
        check_space(path, min_free_bytes)
        try:
            self.partial_path.mkdir(parents=True)
            self._files = BagFiles(
                self.partial_path,
                path.name,
                zstd_level=zstd_level,
                split_bytes=split_bytes,
                sync_bytes=sync_bytes,
                min_free_bytes=min_free_bytes,
            )
        except OSError as error:
            raise InputError(f"{path}: cannot be created: {error.strerror}") from None
        self._topics: dict[str, RecordedTopic] = {}
        self._schemas: dict[str, Schema] = {}
        self._chunk_bytes = min(chunk_bytes, sync_bytes)
        self._shares_chunks = split_bytes is not None
        self._chunks: dict[_Group, ChunkInProgress] = {}
        self._groups: dict[str, _Group] = {}
        self._is_closed = False
        self._zstd_level = zstd_level
        self._packers = ThreadPoolExecutor(min(usable_cores(), _MAX_PACKERS), thread_name_prefix="zstd")
        self._disk = ThreadPoolExecutor(1, thread_name_prefix="bag")
        self._waiting: deque[Future[None]] = deque()

    def add_topic(self, name: str, type_name: str, qos: QosProfile, *, separate_chunks: bool = False) -> None:
        """Announce a topic, once and before its first message.

        Args:
            name: Full topic name.
            type_name: A type such as ``sensor_msgs/msg/Image``, that ``schema.messages.message_types`` knows.
            qos: Quality of service that the publisher offers.
            separate_chunks: Whether to keep the topic, with others for which this is set, out of the common chunks.
        """
        if name in self._topics:
            raise ValueError(f"topic {name} was added before")
        if type_name not in self._schemas:
            definition = message_definition(type_name).encode()
            self._schemas[type_name] = Schema(
                id=len(self._schemas) + 1, data=definition, encoding="ros2msg", name=type_name
            )
        digest, schema = type_hash(type_name), self._schemas[type_name]
        channel = Channel(
            id=len(self._topics) + 1,
            topic=name,
            message_encoding="cdr",
            metadata={"offered_qos_profiles": qos.as_yaml(), "topic_type_hash": digest},
            schema_id=schema.id,
        )
        self._topics[name] = RecordedTopic(name, type_name, digest, qos, channel.id)
        self._groups[name] = _COMMON if self._shares_chunks else _Group(separate_chunks, type_name in _COMPRESSED)
        self._submit(self._files.define, Definition(channel, schema))

    def add_attachment(self, name: str, media_type: str, data: bytes) -> None:
        """Write an attachment; it is synced to disk when this returns."""
        self._flush_chunks()
        self._submit(self._files.add_attachment, Attachment(0, 0, name, media_type, data))
        self._wait()

    def write(self, topic: str, stamp_ns: int, data: bytes | memoryview) -> None:
        """Append a message.

        Args:
            topic: A topic announced with ``add_topic``.
            stamp_ns: Simulated time of the message, ns; it becomes log time and publish time in the bag.
            data: The message, CDR with its encapsulation header; the caller must not modify it afterwards.
        """
        entry, group = self._topics[topic], self._groups[topic]
        chunk = self._chunks.setdefault(group, ChunkInProgress(group.is_compressed))
        chunk.add_message(entry.channel_id, entry.count, stamp_ns, data)
        entry.count += 1
        entry.payload_bytes += len(data)
        if chunk.size > self._chunk_bytes:
            self._submit_chunk(group)

    def sync(self) -> None:
        """Close the chunks in progress and sync; all messages written so far are on disk when this returns."""
        self._flush_chunks()
        self._submit(self._files.sync)
        self._wait()

    def _flush_chunks(self) -> None:
        for group in sorted(self._chunks):
            self._submit_chunk(group)

    def _submit_chunk(self, group: _Group) -> None:
        """Let a chunk be compressed by one of several threads and then written by the disk thread."""
        chunk = self._chunks.pop(group)
        self._submit(self._files.add_chunk, chunk, self._packers.submit(chunk.pack, self._zstd_level).result)

    def _submit(self, work: Callable[..., None], *arguments: object) -> None:
        """Submit a task to the disk thread, which runs tasks in order; block while too many wait."""
        while self._waiting and (self._waiting[0].done() or len(self._waiting) >= _MAX_WAITING):
            self._waiting.popleft().result()
        self._waiting.append(self._disk.submit(work, *arguments))

    def _wait(self) -> None:
        while self._waiting:
            self._waiting.popleft().result()

    def finish(self, custom_data: Mapping[str, str]) -> Path:
        """Close the bag and rename it atomically to its final name.

        Args:
            custom_data: Facts about the scene, which are kept in the bag's metadata.

        Returns:
            The bag's folder.

        Raises:
            InputError: Something else has taken the name meanwhile; the bag stays in its unfinished folder.
        """
        self._close(custom_data)
        if self.path.exists():
            raise InputError(f"{self.path}: exists already; the new bag is in {self.partial_path}")
        self.partial_path.rename(self.path)
        sync(self.path.parent)
        return self.path

    def abandon(self, custom_data: Mapping[str, str] | None = None) -> Path:
        """Close the bag, readable as far as it goes, and leave it in its unfinished folder; return this folder."""
        with suppress(DiskError):  # what was synced stays readable
            self._close({**(custom_data or {}), "complete": "false"})
        return self.partial_path

    def _close(self, custom_data: Mapping[str, str]) -> None:
        if self._is_closed:
            return
        self._is_closed = True
        with suppress(DiskError):
            self._flush_chunks()
            self._wait()
        self._disk.shutdown()
        self._packers.shutdown()
        topics = list(self._topics.values())
        for topic in topics:
            topic.count = self._files.counts[topic.channel_id]
        sizes = json.dumps({topic.name: topic.payload_bytes for topic in topics})
        information = bag_information(self._files.files, topics, {**custom_data, "payload_bytes": sizes})
        self._files.close({"rosbag2": {"serialized_metadata": to_yaml(information)}})
        with disk_errors(self.partial_path):
            with (self.partial_path / METADATA_FILE).open("x", encoding="utf-8") as metadata:
                metadata.write(to_yaml({"rosbag2_bagfile_information": information}))
            sync(self.partial_path / METADATA_FILE, self.partial_path)
        if self._files.failure is not None:
            raise self._files.failure

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.abandon()
