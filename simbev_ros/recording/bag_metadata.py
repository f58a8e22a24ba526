"""rosbag2's description of a bag, version 9: ``metadata.yaml`` and its copy inside the MCAP file."""

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import yaml

from simbev_ros.recording.qos import QosProfile

VERSION = 9
ROS_DISTRO = "jazzy"


@dataclass(slots=True)
class RecordedTopic:
    """One topic of a bag, with what has been written of it so far."""

    name: str
    type_name: str
    type_hash: str
    qos: QosProfile
    channel_id: int
    count: int = 0
    payload_bytes: int = 0

    def as_mapping(self) -> dict[str, Any]:
        """This topic in ``topics_with_message_count``."""
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


def bag_information(
    file_name: str, topics: Sequence[RecordedTopic], start_ns: int, end_ns: int, custom_data: Mapping[str, str]
) -> dict[str, Any]:
    """What stands under ``rosbag2_bagfile_information``, for a bag of one file."""
    count = sum(topic.count for topic in topics)
    span = {
        "starting_time": {"nanoseconds_since_epoch": start_ns},
        "duration": {"nanoseconds": end_ns - start_ns},
        "message_count": count,
    }
    return {
        "version": VERSION,
        "storage_identifier": "mcap",
        "duration": {"nanoseconds": end_ns - start_ns},
        "starting_time": {"nanoseconds_since_epoch": start_ns},
        "message_count": count,
        "topics_with_message_count": [topic.as_mapping() for topic in topics],
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [file_name],
        "files": [{"path": file_name, **span}],
        "custom_data": dict(custom_data) or None,
        "ros_distro": ROS_DISTRO,
    }


def to_yaml(information: Mapping[str, Any]) -> str:
    """YAML text in rosbag2's order of keys."""
    return yaml.safe_dump(information, sort_keys=False, width=sys.maxsize)
