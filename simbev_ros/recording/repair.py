"""A damaged or unfinished bag → a valid one with everything that could be read of it."""

import json
from dataclasses import dataclass
from pathlib import Path

import yaml

from simbev_ros.errors import BagError
from simbev_ros.recording.bag_writer import SceneBagWriter
from simbev_ros.recording.layout import locate_mcap
from simbev_ros.recording.qos import QosProfile
from simbev_ros.recording.salvage import Salvage, salvage


@dataclass(frozen=True, slots=True)
class Repair:
    """What has been saved.

    Attributes:
        path: The new bag's folder.
        counts: Messages by topic.
        lost: What could not be saved, in words that name the place; empty if nothing was missing.
    """

    path: Path
    counts: dict[str, int]
    lost: list[str]


def repair_bag(path: Path, out: Path) -> Repair:
    """Write a new bag; the old one stays as it is.

    Args:
        path: A bag's folder, finished or not, or its file.
        out: The new bag's folder, which must not exist.

    Raises:
        BagError: There is no bag, or nothing of it can be read.
        InputError: The new bag cannot be written there.
    """
    file = locate_mcap(path)
    if not file.stat().st_size:
        raise BagError(f"{file}: it is empty")
    found, counts = Salvage(), dict[str, int]()
    with SceneBagWriter(out) as writer:
        for message in salvage(file, found):
            channel = found.channels[message.channel_id]
            if channel.topic not in counts:
                writer.add_topic(channel.topic, found.schemas[channel.schema_id].name, _qos(channel.metadata))
            writer.write(channel.topic, message.log_time, message.data)
            counts[channel.topic] = counts.get(channel.topic, 0) + 1
        if not counts:
            raise BagError(f"{file}: there is no message in it that could be saved")
        for attachment in found.attachments.values():
            writer.add_attachment(attachment.name, attachment.media_type, attachment.data)
        lost = [*found.lost, *_missing(found, counts)]
        writer.finish(_facts(found, counts, lost))
    return Repair(out, counts, lost)


def _qos(metadata: dict[str, str]) -> QosProfile:
    """The profile that a topic was offered with."""
    try:
        (offered, *_) = yaml.safe_load(metadata["offered_qos_profiles"])
        return QosProfile(**{name: offered[name] for name in ("reliability", "durability", "history", "depth")})
    except (KeyError, ValueError, TypeError, yaml.YAMLError):
        return QosProfile()


def _recorded_facts(found: Salvage) -> dict[str, str]:
    """What the recorder left, if the old file was closed and this part of it is whole."""
    try:
        information = yaml.safe_load(found.metadata["rosbag2"]["serialized_metadata"])
        return dict(information["custom_data"])
    except (KeyError, TypeError, ValueError, yaml.YAMLError):
        return {}


def _missing(found: Salvage, counts: dict[str, int]) -> list[str]:
    """Topics of which messages are missing, as far as the recorder has left its books."""
    expected: dict[str, int] = json.loads(_recorded_facts(found).get("expected", "{}"))
    return [
        f"{topic}: {count - counts.get(topic, 0)} of {count} messages"
        for topic, count in expected.items()
        if counts.get(topic, 0) < count
    ]


def _facts(found: Salvage, counts: dict[str, int], lost: list[str]) -> dict[str, str]:
    """The recorder's facts, put right."""
    old = _recorded_facts(found)
    complete = "true" if old.get("complete") == "true" and not lost else "false"
    return {**old, "complete": complete, "recorded": json.dumps(counts), "repaired": json.dumps(lost)}
