"""Verification of a recorded bag: its MCAP files, messages, message counts, metadata and attachments."""

from collections import ChainMap
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.parsers import expat

from mcap.records import Message
from rosbags.serde import SerdeError

from simbev_ros.config.scenario import RecordedTopics
from simbev_ros.foundation.errors import FOREIGN_ERRORS, BagError, InputError, foreign_content
from simbev_ros.foundation.files.limits import MAX_OSM_BYTES
from simbev_ros.foundation.files.structured_text import load_yaml, parse_json, parse_yaml
from simbev_ros.foundation.files.unpacking import bunzip2
from simbev_ros.foundation.object_store.object_path import AnyPath
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.recording.layout import (
    CONFIG_ATTACHMENT,
    LEAD_IN_ATTACHMENT,
    MAP_ATTACHMENT,
    MAP_SOURCE_ATTACHMENT,
    METADATA_FILE,
    PARTIAL_SUFFIX,
    SCENE_ATTACHMENT,
    TRAJECTORIES_ATTACHMENT,
    mcap_files,
)
from simbev_ros.recording.lead_in import lead_in_messages
from simbev_ros.recording.mcap.mcap_check import McapContent, check_mcap
from simbev_ros.recording.reader import COPIED_ATTACHMENTS, SceneBag, attached_spec
from simbev_ros.schema.messages.message_types import types_with
from simbev_ros.schema.stored import read_stored
from simbev_ros.schema.trajectories import tracks_from_npz


@dataclass(frozen=True, slots=True)
class Fault:
    """A problem that was found in a bag.

    Attributes:
        bag: The bag's folder.
        place: A file of the bag, or a topic.
        problem: Description of the problem.
    """

    bag: AnyPath
    place: str
    problem: str


def verify_bag(path: Path) -> list[Fault]:
    """Verify a scene's bag, given by its folder or its file, and return all faults; an intact bag has none.

    Every byte of the files is read. CRCs, indexes, types, payloads, stamps and their order are checked, and message
    counts against those that the scene must have. ``metadata.yaml`` must match its copy in the file. Each of several
    agents must have its odometry, which relates their data, unless the configuration leaves it out.
    """
    try:
        files = mcap_files(path)
    except BagError as error:
        return [Fault(path, "", str(error).removeprefix(f"{path}: "))]
    folder = files[0].parent
    messages, contents = _MessageChecker(), list[McapContent]()
    for file in files:
        with file.open("rb") as stream:
            contents.append(check_mcap(stream, messages.check))
    faults = [(file.name, problem) for file, each in zip(files, contents, strict=True) for problem in each.faults]
    is_damaged = bool(faults)
    faults += messages.faults
    if folder.name.endswith(PARTIAL_SUFFIX):
        faults.append(("", "the scene was not finished; simbev repair saves what is in it"))
    if not is_damaged:
        faults += _accounting_faults(path, files[-1])
        faults += [(METADATA_FILE, problem) for problem in _description_faults(files, contents[-1])]
        attachments = ChainMap(*(content.attachments for content in contents))
        recorded = {
            each.channels[channel].topic
            for each in contents
            for channel, count in each.counts.items()
            if count and channel in each.channels
        }
        faults += _attachment_faults(attachments, path, recorded)
        faults += _agent_faults(attachments, path, recorded)
    return [Fault(folder, place, problem) for place, problem in faults]


class _MessageChecker:
    """Checks messages one after the other, and collects their faults.

    Attributes:
        faults: Topic and problem of each fault.
    """

    def __init__(self) -> None:
        self.faults: list[tuple[str, str]] = []
        self._last_ns: dict[str, int] = {}

    def check(self, message: Message, content: McapContent) -> None:
        """Check the next message of a file."""
        channel = content.channels.get(message.channel_id)
        if channel is None or channel.schema_id not in content.schemas:
            self.faults.append((f"channel {message.channel_id}", "a message on a channel that is not defined"))
            return
        kind = content.schemas[channel.schema_id].name
        try:
            stamp_ns = embedded_stamp_ns(types_with(kind).deserialize_cdr(message.data, kind))
        except (SerdeError, *FOREIGN_ERRORS) as error:
            self.faults.append((channel.topic, f"at {message.log_time} ns: no {kind}: {error}"))
            return
        if stamp_ns not in (None, message.log_time):
            self.faults.append((channel.topic, f"at {message.log_time} ns: its header says {stamp_ns} ns"))
        last_ns = self._last_ns.setdefault(channel.topic, message.log_time)
        if message.log_time < last_ns:
            self.faults.append((channel.topic, f"at {message.log_time} ns: it comes after a message of {last_ns} ns"))
        self._last_ns[channel.topic] = message.log_time


def embedded_stamp_ns(message: Any) -> int | None:
    """Stamp within a decoded message, ns; None if it has none."""
    match message:
        case object(header=header):
            stamp = header.stamp
        case object(clock=clock):
            stamp = clock
        case object(transforms=[first, *_]) | object(markers=[first, *_]):
            stamp = first.header.stamp
        case object(data=str(text)):
            record = parse_json(text) if text.startswith("{") else {}
            found = record.get("stamp_ns")
            return None if found is None else int(found)
        case _:
            return None
    return int(stamp.sec) * NS_PER_S + int(stamp.nanosec)


def _accounting_faults(path: Path, last: Path) -> Iterator[tuple[str, str]]:
    """Yield where the messages of a bag with intact files differ from the recorder's accounts, in the last file."""
    try:
        with SceneBag(path) as bag:
            facts, counts = bag.custom_data, {name: len(topic.stamps_ns) for name, topic in bag.topics.items()}
            expected_counts = bag.counts("expected")
    except BagError as error:
        yield last.name, str(error).removeprefix(f"{path}: ")
        return
    if expected_counts is None:
        yield last.name, "the recorder's message counts are missing, as in bags that other programs have converted"
        return
    if facts.get("complete") != "true":
        yield last.name, f"the scene is incomplete ({facts.get('ended', 'for an unknown reason')})"
    for topic, expected in expected_counts.items():
        if counts.get(topic, 0) != expected:
            yield topic, f"{counts.get(topic, 0)} of {expected} messages"
    for topic in counts.keys() - expected_counts.keys():
        yield topic, "a topic that the scene does not have"


def _description_faults(files: Sequence[Path], last: McapContent) -> Iterator[str]:
    """Yield problems of ``metadata.yaml``: missing, different from its copy in the last file, or naming other files."""
    try:
        described = load_yaml(files[0].parent / METADATA_FILE)
    except FileNotFoundError:
        yield "it is missing"
        return
    except (OSError, ValueError) as error:
        yield f"it cannot be read: {error}"
        return
    try:
        copy = parse_yaml(last.metadata.get("rosbag2", {}).get("serialized_metadata", ""))
    except ValueError as error:
        yield f"its copy in the file cannot be read: {error}"
        return
    if not isinstance(described, dict) or described.get("rosbag2_bagfile_information") != copy:
        yield "it differs from its copy in the file"
    elif not isinstance(copy, dict):
        yield "neither it nor the file describes a bag"
    elif copy.get("relative_file_paths") != [file.name for file in files]:
        yield f"its files are {copy.get('relative_file_paths')}"


def _attachment_faults(
    attachments: Mapping[str, bytes], path: Path, recorded: Collection[str]
) -> Iterator[tuple[str, str]]:
    """Yield attachments of the bag at ``path`` that are missing, also among its topics, or cannot be read."""
    try:
        if attached_spec(attachments, path) is None and COPIED_ATTACHMENTS[SCENE_ATTACHMENT] not in recorded:
            yield SCENE_ATTACHMENT, "it is missing"
    except BagError as error:
        yield SCENE_ATTACHMENT, str(error).removeprefix(f"{path}: {SCENE_ATTACHMENT}: ")
    for name, check in _CHECKS.items():
        if name in attachments:
            try:
                with foreign_content(name):
                    check(attachments[name])
            except InputError as error:
                yield name, str(error).removeprefix(f"{name}: ")


def _check_configuration(content: bytes) -> None:
    if not isinstance(parse_yaml(content), dict):
        raise ValueError("it is not a configuration")


def _check_map(content: bytes) -> None:
    if b"<OpenDRIVE" not in content:
        raise ValueError("it is not an OpenDRIVE file")
    try:
        expat.ParserCreate().Parse(content, True)
    except expat.ExpatError as error:
        raise ValueError(f"it is not valid XML: {error}") from None


_CHECKS: Mapping[str, Callable[[bytes], object]] = {
    CONFIG_ATTACHMENT: _check_configuration,
    LEAD_IN_ATTACHMENT: lead_in_messages,
    MAP_ATTACHMENT: _check_map,
    MAP_SOURCE_ATTACHMENT: lambda content: bunzip2(content, MAX_OSM_BYTES),
    TRAJECTORIES_ATTACHMENT: tracks_from_npz,
}
"""Attachment → what reads it and raises an error if it cannot be read."""


def _agent_faults(attachments: Mapping[str, bytes], path: Path, recorded: Collection[str]) -> Iterator[tuple[str, str]]:
    """Yield the odometry that an agent of several lacks, given the topics that have messages."""
    try:
        spec = attached_spec(attachments, path)
    except BagError:  # a fault of the attachment
        return
    for agent in spec.agents if spec is not None and len(spec.agents) > 1 else ():
        topic = f"/{agent.name}/odom"
        if topic not in recorded and not _is_left_out(topic, attachments):
            yield topic, f"the scene has an agent {agent.name}, but not its odometry"


def _is_left_out(topic: str, attachments: Mapping[str, bytes]) -> bool:
    """Whether the attached configuration leaves a topic out of the recording."""
    try:
        chosen = read_stored(RecordedTopics, parse_yaml(attachments[CONFIG_ATTACHMENT])["recording"]["topics"])
    except (ValueError, LookupError, TypeError):  # it is not the recorder's
        return False
    return topic not in chosen
