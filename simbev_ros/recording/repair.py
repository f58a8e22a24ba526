"""Repair of a damaged or unfinished bag: everything that can still be read is written to a new, valid bag."""

import json
import shutil
import tempfile
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

import zstandard
from mcap.records import Channel, Message, Schema

from simbev_ros.foundation.errors import BagError, DiskError
from simbev_ros.foundation.files.structured_text import load_yaml, parse_yaml
from simbev_ros.foundation.files.whole_files import require_writable, write_errors
from simbev_ros.recording.bag_writer import SceneBagWriter
from simbev_ros.recording.layout import METADATA_FILE, numbered_files, packed_files, partial_of
from simbev_ros.recording.mcap.salvage import Salvage, salvage
from simbev_ros.recording.qos import QosProfile
from simbev_ros.recording.reader import custom_data_in, parse_counts
from simbev_ros.schema.messages.message_types import is_known_type


@dataclass(frozen=True, slots=True)
class Repair:
    """Result of a repair.

    Attributes:
        path: The new bag's folder.
        counts: Number of saved messages by topic.
        lost: Description of each loss, naming the file and byte or the topic; empty if nothing was lost.
    """

    path: Path
    counts: dict[str, int]
    lost: list[str]


def repair_bag(path: Path, out: Path) -> Repair:
    """Write everything that can be read from a bag to a new bag; the old one stays unchanged.

    Args:
        path: A bag's folder, finished or not, or its file.
        out: The new bag's folder, which must not exist.

    Raises:
        BagError: There is no bag, or nothing can be read from it.
        InputError: The new bag cannot be written there.
        DiskError: The disk is full; nothing of the new bag is left.
    """
    if packed := packed_files(path):
        require_writable(out.parent)
        with tempfile.TemporaryDirectory(prefix=f".{out.name}-", dir=out.parent) as folder:
            _unpack(packed, Path(folder))
            return repair_bag(Path(folder), out)
    found, counts, files = Salvage(), dict[str, int](), numbered_files(path)
    messages = _salvage_files(files, found)
    first = next(messages, None)
    if first is None:
        reason = f"; lost: {found.lost[0]}" if found.lost else ""
        raise BagError(f"{path}: it contains no message that can be saved{reason}")
    with SceneBagWriter(out) as writer:
        try:
            for channel, schema, message in chain([first], messages):
                if channel.topic not in counts:
                    writer.add_topic(channel.topic, schema.name, _qos(channel.metadata))
                writer.write(channel.topic, message.log_time, message.data)
                counts[channel.topic] = counts.get(channel.topic, 0) + 1
            for attachment in found.attachments.values():
                writer.add_attachment(attachment.name, attachment.media_type, attachment.data)
            old = _recorded_facts(found, next(iter(files.values())).parent)
            lost = [*found.lost, *_missing_messages(old, counts)]
            writer.finish(_updated_facts(old, counts, lost))
        except BaseException as error:
            writer.abandon()
            shutil.rmtree(partial_of(out))  # its contents are all in the old bag
            if isinstance(error, DiskError):
                raise DiskError(f"{error}; nothing of the new bag is left") from None
            raise
    return Repair(out, counts, lost)


def _unpack(packed: Sequence[Path], folder: Path) -> None:
    """Decompress files of a bag, and copy its description, into a folder. Damaged files end where the damage begins.

    Raises:
        BagError: A file cannot be read.
        DiskError: The disk is full.
    """
    with write_errors(folder):
        for file in packed:
            with file.open("rb") as source, (folder / file.stem).open("wb") as target, suppress(zstandard.ZstdError):
                zstandard.ZstdDecompressor().copy_stream(source, target)
        if (description := packed[0].with_name(METADATA_FILE)).is_file():
            shutil.copyfile(description, folder / METADATA_FILE)


def _salvage_files(files: Mapping[int, Path], found: Salvage) -> Iterator[tuple[Channel, Schema, Message]]:
    """Yield the messages of known types from all files; attachments, metadata and losses go into ``found``."""
    found.lost += [f"file {number}, which is missing" for number in range(max(files)) if number not in files]
    for _, file in sorted(files.items()):
        part, unknown = Salvage(), Counter[str]()
        for message in salvage(file, part):
            channel = part.channels[message.channel_id]
            schema = part.schemas.get(channel.schema_id)
            if schema is None or not is_known_type(schema.name):
                unknown[channel.topic] += 1
                continue
            yield channel, schema, message
        part.lost += [f"{topic}: {count} messages of an unknown type" for topic, count in unknown.items()]
        found.attachments |= part.attachments
        found.metadata |= part.metadata
        found.lost += [f"{file.name}: {loss}" if len(files) > 1 else loss for loss in part.lost]


def _qos(metadata: dict[str, str]) -> QosProfile:
    """The profile that a topic was offered with; the default one if it cannot be read."""
    try:
        (offered, *_) = parse_yaml(metadata["offered_qos_profiles"])
        return QosProfile(**{name: offered[name] for name in ("reliability", "durability", "history", "depth")})
    except (KeyError, ValueError, TypeError):
        return QosProfile()


def _recorded_facts(found: Salvage, folder: Path) -> dict[str, str]:
    """The recorder's facts from ``metadata.yaml`` or its copy in the file, whichever is intact; empty if neither is."""
    copy = found.metadata.get("rosbag2", {}).get("serialized_metadata", "")
    problem = ""
    for file in (folder / METADATA_FILE, None):
        try:
            description = (load_yaml(file) if file else parse_yaml(copy)) or {}
            facts = custom_data_in(description.get("rosbag2_bagfile_information", description))
            parse_counts(facts["expected"])
            return facts
        except ValueError as error:
            problem = str(error)
        except (OSError, KeyError, AttributeError):
            pass  # there is none, or one of another program
    if problem:
        found.lost.append(f"the recorder's accounts: their description is damaged: {problem}")
    return {}


def _missing_messages(old: Mapping[str, str], counts: dict[str, int]) -> list[str]:
    """A sentence for each topic with missing messages, as far as the recorder has left its accounts."""
    expected = parse_counts(old.get("expected", "{}"))
    return [
        f"{topic}: {count - counts.get(topic, 0)} of {count} messages"
        for topic, count in expected.items()
        if counts.get(topic, 0) < count
    ]


def _updated_facts(old: Mapping[str, str], counts: dict[str, int], lost: list[str]) -> dict[str, str]:
    """The recorder's facts, updated to what was saved."""
    complete = "true" if old.get("complete") == "true" and not lost else "false"
    return {**old, "complete": complete, "recorded": json.dumps(counts), "repaired": json.dumps(lost)}
