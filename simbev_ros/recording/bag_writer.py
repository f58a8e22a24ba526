"""Writing one scene: serialised messages in, a rosbag2 bag (one MCAP file and ``metadata.yaml``) out.

The bag grows in ``<name>.partial`` and takes its name only when it is whole. Every ``sync_bytes`` of payload the chunk
in progress is closed and the file is forced to the disk: whatever ends the process, all before that is readable.
"""

import json
import os
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Self

from mcap.writer import Writer
from rosbags.typesys import Stores, get_typestore

from simbev_ros import __version__
from simbev_ros.errors import InputError
from simbev_ros.recording.bag_metadata import RecordedTopic, bag_information, to_yaml
from simbev_ros.recording.layout import METADATA_FILE, mcap_in, partial_of
from simbev_ros.recording.qos import QosProfile

_TYPES = get_typestore(Stores.ROS2_JAZZY)


class SceneBagWriter:
    """Writes one scene's bag.

    As a context manager it abandons the bag unless ``finish`` was called. For one thread. Whatever writes may raise
    OSError when the disk is full.

    Attributes:
        path: The finished bag's folder; until then the bag is in ``partial_path``.

    Raises:
        InputError: There is a bag of this name, finished or not, or its folder cannot be made.
    """

    def __init__(self, path: Path, *, chunk_bytes: int = 4 << 20, sync_bytes: int = 32 << 20) -> None:
        self.path = path
        self.partial_path = partial_of(path)
        for taken in (self.path, self.partial_path):
            if taken.exists():
                raise InputError(f"{taken}: exists already; nothing was overwritten")
        try:
            self.partial_path.mkdir(parents=True)
            self._stream = mcap_in(self.partial_path, path.name).open("xb")
        except OSError as error:
            raise InputError(f"{path}: cannot be created: {error.strerror}") from None
        self._sync_bytes = sync_bytes
        self._unsynced_bytes = 0
        self._topics: dict[str, RecordedTopic] = {}
        self._schema_ids: dict[str, int] = {}
        self._start_ns: int | None = None
        self._end_ns = 0
        self._writer = Writer(self._stream, chunk_size=chunk_bytes, enable_data_crcs=True)
        self._writer.start(profile="ros2", library=f"simbev_ros {__version__}")

    def add_topic(self, name: str, type_name: str, qos: QosProfile) -> None:
        """Announce a topic; each once, before its first message.

        Args:
            name: Full topic name.
            type_name: As in ``sensor_msgs/msg/Image``; one of ROS 2 Jazzy's own message packages.
            qos: What its publisher offers.
        """
        if name in self._topics:
            raise ValueError(f"topic {name} was added before")
        if type_name not in self._schema_ids:
            definition, _ = _TYPES.generate_msgdef(type_name, ros_version=2)
            self._schema_ids[type_name] = self._writer.register_schema(type_name, "ros2msg", definition.encode())
        type_hash = _TYPES.hash_rihs01(type_name)
        channel_id = self._writer.register_channel(
            name,
            "cdr",
            self._schema_ids[type_name],
            {"offered_qos_profiles": qos.as_yaml(), "topic_type_hash": type_hash},
        )
        self._topics[name] = RecordedTopic(name, type_name, type_hash, qos, channel_id)

    def add_attachment(self, name: str, media_type: str, data: bytes) -> None:
        """Put a file into the bag, on the disk when this returns."""
        self._writer.add_attachment(0, 0, name, media_type, data)
        self.sync()

    def write(self, topic: str, stamp_ns: int, data: bytes | memoryview) -> None:
        """Append one message.

        Args:
            topic: A topic announced before.
            stamp_ns: Simulated time of the message, ns; log time and publish time in the bag.
            data: The message, CDR with its encapsulation header.
        """
        entry = self._topics[topic]
        self._writer.add_message(entry.channel_id, stamp_ns, bytes(data), stamp_ns, entry.count)
        entry.count += 1
        entry.payload_bytes += len(data)
        self._start_ns = stamp_ns if self._start_ns is None else min(self._start_ns, stamp_ns)
        self._end_ns = max(self._end_ns, stamp_ns)
        self._unsynced_bytes += len(data)
        if self._unsynced_bytes >= self._sync_bytes:
            self.sync()

    def sync(self) -> None:
        """Close the chunk in progress; all messages written so far are on the disk when this returns."""
        self._writer.flush()  # type: ignore[no-untyped-call]
        os.fsync(self._stream.fileno())
        self._unsynced_bytes = 0

    def finish(self, custom_data: Mapping[str, str]) -> Path:
        """Close the bag and give it its name, in one step that is never half done.

        Args:
            custom_data: Facts of the scene, kept in the bag's description.

        Returns:
            The bag's folder.

        Raises:
            InputError: Meanwhile something else took the name; the bag stays in its unfinished folder.
        """
        self._close(custom_data)
        if self.path.exists():
            raise InputError(f"{self.path}: exists already; the new bag is in {self.partial_path}")
        self.partial_path.rename(self.path)
        _sync_folder(self.path.parent)
        return self.path

    def abandon(self, custom_data: Mapping[str, str] | None = None) -> Path:
        """Close the bag, readable as far as it goes, and leave it in its unfinished folder, which is returned."""
        with suppress(OSError):  # the disk may be full, which may be why: what was synced stays readable
            self._close({"complete": "false", **(custom_data or {})})
        return self.partial_path

    def _close(self, custom_data: Mapping[str, str]) -> None:
        if self._stream.closed:
            return
        topics = list(self._topics.values())
        sizes = json.dumps({topic.name: topic.payload_bytes for topic in topics})
        facts = {**custom_data, "payload_bytes": sizes}
        file_name = Path(self._stream.name).name
        information = bag_information(file_name, topics, self._start_ns or 0, self._end_ns, facts)
        try:
            self._writer.add_metadata("rosbag2", {"serialized_metadata": to_yaml(information)})
            self._writer.finish()  # type: ignore[no-untyped-call]
            self._stream.flush()
            os.fsync(self._stream.fileno())
        finally:
            self._stream.close()
        with (self.partial_path / METADATA_FILE).open("x", encoding="utf-8") as metadata:
            metadata.write(to_yaml({"rosbag2_bagfile_information": information}))
            metadata.flush()
            os.fsync(metadata.fileno())
        _sync_folder(self.partial_path)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.abandon()


def _sync_folder(folder: Path) -> None:
    """Force a folder's entries, such as a new name, to the disk."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
