"""Records a scene twice, to compare another form of a sensor's messages with the usual one."""

from pathlib import Path
from typing import NamedTuple

from commands import Command, digests, record

from simbev_ros.dataset import Scene, open_dataset
from simbev_ros.recording.verify import verify_bag

OF_THE_RIG = {"/world/scene"}
"""Topics that contain the settings of sensors."""


class Recorded(NamedTuple):
    """A recorded scene, and the digests of its topics."""

    bag: Path
    digests: dict[str, str]
    scene: Scene


def record_changed(config: Path, folder: Path, old: str, new: str) -> tuple[Recorded, Recorded]:
    """Record a configuration, and again with a piece of its text replaced; of both only other topics may differ."""
    plain = _record(config, folder / "plain")
    config.write_text(config.read_text().replace(old, new, 1))
    changed = _record(config, folder / "changed")
    before, after = plain.digests, changed.digests
    assert {name for name in before.keys() & after.keys() if before[name] != after[name]} == OF_THE_RIG
    return plain, changed


def _record(config: Path, folder: Path) -> Recorded:
    bag = record(Command, config, folder)
    assert verify_bag(bag) == []
    return Recorded(bag, digests(bag), open_dataset(folder, threads=1).scenes[0])
