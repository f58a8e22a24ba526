"""Which scenes a dataset is to have: numbers, once given, stay, whatever is asked for later.

The plan is kept in the dataset as ``plan.json``, so that work that was interrupted goes on with the same scenes. Scenes
that were recorded into the dataset without a plan are taken into it.
"""

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import Self

from pydantic import ValidationError

from simbev_ros.config.base import Model
from simbev_ros.config.scenario import SPLITS, Scenario, Split
from simbev_ros.errors import InputError
from simbev_ros.maps.source import map_spec
from simbev_ros.recording.layout import scene_folder
from simbev_ros.recording.mcap.syncing import sync, sync_names

PLAN_FILE = "plan.json"
_SCENE = re.compile(r"(?P<map>.+)-(?P<number>\d{4,})")
_RANGE = re.compile(r"(\d+)(?:-(\d+))?")
_MOST_NAMED = 5


class PlannedEntry(Model):
    """One scene: its number, the name of its map, and its split."""

    number: int
    map: str
    split: Split

    @property
    def name(self) -> str:
        """That of its bag."""
        return f"{self.map}-{self.number:04d}"


class Plan(Model):
    """All scenes, by ascending number."""

    scenes: tuple[PlannedEntry, ...] = ()

    @classmethod
    def of(cls, dataset: Path) -> Self:
        """The plan of a dataset, which has none at first, and what is there without being planned.

        Raises:
            InputError: Its file is damaged, or cannot be read.
        """
        path = dataset / PLAN_FILE
        try:
            plan = cls.model_validate_json(path.read_bytes()) if path.exists() else cls()
        except ValidationError as error:
            raise InputError(f"{path}: {error.errors()[0]['msg']}") from None
        except OSError as error:
            raise InputError(f"{path}: cannot be read: {error.strerror}") from None
        known = {entry.number for entry in plan.scenes}
        return plan.with_entries(entry for entry in _recorded(dataset) if entry.number not in known)

    def with_entries(self, entries: Iterable[PlannedEntry]) -> Self:
        """With more scenes."""
        return self.model_copy(
            update={"scenes": tuple(sorted((*self.scenes, *entries), key=lambda entry: entry.number))}
        )

    def extended(self, scenario: Scenario) -> Self:
        """With as many scenes of each map and split as a configuration asks for; those that are there count.

        New scenes take the numbers after the last one, in the order of the configuration: in an empty dataset they are
        those of ``planned_scenes``.

        Raises:
            InputError: There is no such map.
        """
        have = Counter((entry.map, entry.split) for entry in self.scenes)
        number = max((entry.number for entry in self.scenes), default=-1) + 1
        added = []
        for wanted in scenario.scenes:
            name = map_spec(wanted.map).name
            for split in SPLITS:
                count = getattr(wanted, split)
                enough = min(have[name, split], count)
                have[name, split] -= enough
                added += [PlannedEntry(number=number + k, map=name, split=split) for k in range(count - enough)]
                number += count - enough
        return self.with_entries(added)

    def save(self, dataset: Path) -> None:
        """Write it, in one step that is never half done.

        Raises:
            InputError: It cannot be written.
        """
        path = dataset / PLAN_FILE
        unfinished = path.with_suffix(".part")
        try:
            unfinished.write_text(self.model_dump_json(indent=1), encoding="utf-8")
            sync(unfinished)
            unfinished.rename(path)
            sync_names([path])
        except OSError as error:
            raise InputError(f"{path}: cannot be written: {error.strerror}") from None

    def to_make(self, dataset: Path, scenario: Scenario) -> list[PlannedEntry]:
        """The first of the scenes without a finished bag, as many as are wanted beyond those that have one."""
        wanted: Counter[tuple[str, Split]] = Counter()
        for asked in scenario.scenes:
            for split in SPLITS:
                wanted[map_spec(asked.map).name, split] += getattr(asked, split)
        missing = []
        for entry in self.scenes:
            if bag_of(dataset, entry).is_dir():
                wanted[entry.map, entry.split] -= 1
            else:
                missing.append(entry)
        chosen = []
        for entry in missing:
            if wanted[entry.map, entry.split] > 0:
                wanted[entry.map, entry.split] -= 1
                chosen.append(entry)
        return chosen

    def chosen(self, numbers: Sequence[range]) -> list[PlannedEntry]:
        """The scenes of some numbers.

        Raises:
            InputError: One of them has no scene.
        """
        known = {entry.number for entry in self.scenes}
        asked = (number for each in numbers for number in each)  # any range can be written down: it may have no end
        unknown = list(islice((number for number in asked if number not in known), _MOST_NAMED))
        if unknown:
            has = f"its numbers are {min(known)} to {max(known)}" if known else "it has none"
            raise InputError(f"--replace: the dataset has no scene {', '.join(map(str, unknown))}; {has}")
        return [entry for entry in self.scenes if any(entry.number in each for each in numbers)]


def bag_of(dataset: Path, entry: PlannedEntry) -> Path:
    """The folder of a scene's finished bag."""
    return scene_folder(dataset, entry.split, entry.name)


def numbers_of(words: Iterable[str]) -> list[range]:
    """Scene numbers of words such as ``3``, ``17-20`` and ``3,5``.

    Raises:
        InputError: A word means no number.
    """
    numbers = []
    for part in (part.strip() for word in words for part in re.split(r"[,\s]+", word.strip())):
        match = _RANGE.fullmatch(part)
        first, last = (int(match[1]), int(match[2] or match[1])) if match else (1, 0)
        if last < first:
            raise InputError(f"--replace: {part!r} is neither a scene's number, such as 3, nor a range, such as 17-20")
        numbers.append(range(first, last + 1))
    return numbers


def _recorded(dataset: Path) -> Iterator[PlannedEntry]:
    """The scenes of which there are finished bags."""
    for split in SPLITS:
        for folder in sorted((dataset / "scenes" / split).glob("*")):
            match = _SCENE.fullmatch(folder.name)
            if match and folder.is_dir():
                yield PlannedEntry(number=int(match["number"]), map=match["map"], split=split)
