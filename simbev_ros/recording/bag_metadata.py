"""rosbag2's metadata of a bag, version 9: ``metadata.yaml`` and its copy inside the MCAP file."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import yaml

from simbev_ros.recording.qos import FAST_DUMPER, QosProfile

VERSION = 9
ROS_DISTRO = "jazzy"
_MAX_LINE_WIDTH = 2**31 - 1


@dataclass(slots=True)
class RecordedTopic:
    """A topic of a bag that is being written, with the number and size of its messages so far."""

    name: str
    type_name: str
    type_hash: str
    qos: QosProfile
    channel_id: int
    count: int = 0
    payload_bytes: int = 0

    def as_mapping(self) -> dict[str, Any]:
        """The topic's entry in ``topics_with_message_count``."""
        return {
            "topic_metadata": {
                "name": self.name,
                "type": self.type_name,
                "serialization_format": "cdr",
                "offered_qos_profiles": [self.qos.as_mapping()],
                "type_description_hash": self.type_hash,
            },
            "message_count": self.count,
        }


@dataclass(slots=True)
class RecordedFile:
    """A file of a bag that is being written, with the number and time span of its messages so far."""

    name: str
    count: int = 0
    start_ns: int | None = None
    end_ns: int = 0

    def add_messages(self, stamps_ns: Collection[int]) -> None:
        """Count messages, given by their stamps."""
        if stamps_ns:
            self.include(RecordedFile("", len(stamps_ns), min(stamps_ns), max(stamps_ns)))

    def include(self, other: "RecordedFile") -> None:
        """Count all messages of another file."""
        if other.start_ns is not None:
            self.start_ns = other.start_ns if self.start_ns is None else min(self.start_ns, other.start_ns)
            self.end_ns = max(self.end_ns, other.end_ns)
            self.count += other.count

    def span(self) -> dict[str, Any]:
        """The file's start time, duration and number of messages, as rosbag2 writes them."""
        start_ns = self.start_ns or 0
        return {
            "starting_time": {"nanoseconds_since_epoch": start_ns},
            "duration": {"nanoseconds": self.end_ns - start_ns},
            "message_count": self.count,
        }


def bag_information(
    files: Sequence[RecordedFile], topics: Sequence[RecordedTopic], custom_data: Mapping[str, str]
) -> dict[str, Any]:
    """Content of ``rosbag2_bagfile_information``."""
    whole = RecordedFile("")
    for file in files:
        whole.include(file)
    return {
        "version": VERSION,
        "storage_identifier": "mcap",
        "duration": whole.span()["duration"],
        "starting_time": whole.span()["starting_time"],
        "message_count": whole.count,
        "topics_with_message_count": [topic.as_mapping() for topic in topics],
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [file.name for file in files],
        "files": [{"path": file.name, **file.span()} for file in files],
        "custom_data": dict(custom_data) or None,
        "ros_distro": ROS_DISTRO,
    }


def to_yaml(information: Mapping[str, Any]) -> str:
    """YAML text with the keys in rosbag2's order."""
    return str(yaml.dump(information, Dumper=FAST_DUMPER, sort_keys=False, width=_MAX_LINE_WIDTH))
