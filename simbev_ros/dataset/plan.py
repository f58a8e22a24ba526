"""The plan of a dataset: its finished and future scenes, with numbers that never change.

The plan is stored in the dataset as ``plan.json``, so that interrupted work continues with the same scenes. Scenes that
were recorded into the dataset without a plan are added to it.
"""

import os
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from itertools import islice
from pathlib import Path
from typing import Self, overload

from pydantic import Field

from simbev_ros.config.base import Model, first_problem
from simbev_ros.config.names import NAME_PATTERN, Name
from simbev_ros.config.scenario import SPLITS, MapScenes, Scenario, Split
from simbev_ros.foundation.errors import FOREIGN_ERRORS, InputError
from simbev_ros.foundation.files.confined_paths import path_inside, refuse_links_out
from simbev_ros.foundation.files.input_file import path_exists, read_small_file
from simbev_ros.foundation.files.limits import MAX_SCENE_NUMBER
from simbev_ros.foundation.files.whole_files import write_errors, write_whole
from simbev_ros.foundation.object_store.object_path import AnyPath, ObjectPath
from simbev_ros.recording.layout import SCENES_FOLDER, scene_folder
from simbev_ros.schema.scene.map_spec import MapSpec
from simbev_ros.schema.stored import Stored

PLAN_FILE = "plan.json"
_SCENE = re.compile(rf"(?P<map>{NAME_PATTERN})-(?P<number>\d{{4,}})")
_MAX_NAMED = 5
_MAX_BYTES = 64 << 20


class PlannedEntry(Model):
    """A planned scene: its number, the name of its map, and its split."""

    number: int = Field(ge=0, le=MAX_SCENE_NUMBER)
    map: Name
    split: Split
    scenario: str = Field("", exclude_if=lambda value: not value, description="OpenSCENARIO file that the scene plays")

    @property
    def name(self) -> str:
        """Name of the scene's bag, ``<map>-<number>``."""
        return f"{self.map}-{self.number:04d}"


class Plan(Stored):
    """All finished and future scenes of a dataset, by ascending number."""

    scenes: tuple[PlannedEntry, ...] = ()
    dropped: tuple[PlannedEntry, ...] = ()
    """Scenes that were removed for good; their numbers are never used again."""

    @classmethod
    def load(cls, dataset: AnyPath) -> Self:
        """Load the plan of a dataset, an empty one if there is none, and add recorded scenes that are not in it.

        Raises:
            InputError: The file is damaged, or cannot be read.
        """
        path, content = _read_plan(dataset)
        try:
            plan = cls() if content is None else cls.from_json(content)
        except FOREIGN_ERRORS as error:
            raise InputError(f"{path}: {first_problem(error)}") from None
        known = {entry.number for entry in (*plan.scenes, *plan.dropped)}
        return plan.with_entries(entry for entry in _recorded_entries(dataset) if entry.number not in known)

    def with_entries(self, entries: Iterable[PlannedEntry]) -> Self:
        """Copy of the plan with further scenes."""
        return self.model_copy(
            update={"scenes": tuple(sorted((*self.scenes, *entries), key=lambda entry: entry.number))}
        )

    def without(self, entries: Iterable[PlannedEntry]) -> Self:
        """Copy of the plan in which scenes are dropped: they are neither made again nor are their numbers used."""
        gone = {entry.number: entry for entry in (*self.dropped, *entries)}
        left = tuple(entry for entry in self.scenes if entry.number not in gone)
        return self.model_copy(update={"scenes": left, "dropped": tuple(gone[number] for number in sorted(gone))})

    def with_scenes_of(self, scenario: Scenario, maps: Sequence[MapSpec]) -> Self:
        """Copy of the plan with as many scenes of each map and split as a configuration asks for.

        Existing scenes count. New scenes are numbered after the last one, in the order of the configuration; in an
        empty dataset they are the scenes of ``planned_scenes``.

        Args:
            scenario: The configuration.
            maps: The map of each of its entries.

        Raises:
            InputError: A dataset cannot have that many scenes.
        """
        have = Counter((entry.map, entry.scenario, entry.split) for entry in self.scenes)
        number = max((entry.number for entry in (*self.scenes, *self.dropped)), default=-1) + 1
        added = []
        for wanted, name in _with_names(scenario, maps):
            for split in SPLITS:
                count = getattr(wanted, split)
                key = name, wanted.scenario, split
                enough = min(have[key], count)
                have[key] -= enough
                if number + count - enough > MAX_SCENE_NUMBER + 1:
                    raise InputError(f"scenes: a dataset has at most {MAX_SCENE_NUMBER + 1:,} scenes")
                planned = PlannedEntry(number=number, map=name, split=split, scenario=wanted.scenario)
                added += [planned.model_copy(update={"number": number + k}) for k in range(count - enough)]
                number += count - enough
        return self.with_entries(added)

    def save(self, dataset: AnyPath) -> None:
        """Write the plan atomically.

        Raises:
            InputError: It cannot be written.
        """
        path = dataset / PLAN_FILE
        with write_errors(path):
            write_whole(path, self.model_dump_json(indent=1).encode())

    def finished_entries(self, dataset: AnyPath) -> list[PlannedEntry]:
        """Scenes with a finished bag; in an object store, those that the index lists or is about to list."""
        if isinstance(dataset, ObjectPath):
            from simbev_ros.dataset.stored_index import load_stored_index

            paths = set(load_stored_index(dataset).column("path").to_pylist())
            return [entry for entry in self.scenes if str(bag_of(dataset, entry).relative_to(dataset)) in paths]
        return [entry for entry in self.scenes if bag_of(dataset, entry).is_dir()]

    def missing_entries(self, dataset: AnyPath, scenario: Scenario, maps: Sequence[MapSpec]) -> list[PlannedEntry]:
        """Scenes without a finished bag, in order, up to the number that the configuration still lacks.

        The maps are those of ``with_scenes_of``.
        """
        wanted: Counter[tuple[str, str, Split]] = Counter()
        for asked, name in _with_names(scenario, maps):
            for split in SPLITS:
                wanted[name, asked.scenario, split] += getattr(asked, split)
        finished = self.finished_entries(dataset)
        wanted.subtract((entry.map, entry.scenario, entry.split) for entry in finished)
        numbers = {entry.number for entry in finished}
        chosen = []
        for entry in self.scenes:
            key = entry.map, entry.scenario, entry.split
            if entry.number not in numbers and wanted[key] > 0:
                wanted[key] -= 1
                chosen.append(entry)
        return chosen

    def entries_with_numbers(self, numbers: Sequence[range], parameter: str | None = "replace") -> list[PlannedEntry]:
        """Scenes with the given numbers, by ascending number.

        Raises:
            InputError: There is no scene with one of the numbers; the error has this ``parameter``.
        """
        known = {entry.number for entry in self.scenes}
        asked = (number for each in numbers for number in each)  # lazily, as users may give ranges of any length
        unknown = list(islice((number for number in asked if number not in known), _MAX_NAMED))
        if unknown:
            has = f"its numbers are {min(known)} to {max(known)}" if known else "it has none"
            raise InputError(f"the dataset has no scene {', '.join(map(str, unknown))}; {has}", parameter=parameter)
        return [entry for entry in self.scenes if any(entry.number in each for each in numbers)]


@overload
def bag_of(dataset: Path, entry: PlannedEntry) -> Path: ...
@overload
def bag_of(dataset: ObjectPath, entry: PlannedEntry) -> ObjectPath: ...
def bag_of(dataset: AnyPath, entry: PlannedEntry) -> AnyPath:
    """Folder of a scene's finished bag, whether or not it exists."""
    return scene_folder(dataset, entry.split, entry.name)


def _with_names(scenario: Scenario, maps: Sequence[MapSpec]) -> Iterator[tuple[MapScenes, str]]:
    """Each entry of a configuration's scenes with the name of its map."""
    return zip(scenario.scenes, (spec.name for spec in maps), strict=True)


def _read_plan(dataset: AnyPath) -> tuple[AnyPath, bytes | None]:
    """Path of a dataset's plan, and its content; None if there is no plan."""
    if isinstance(dataset, ObjectPath):
        try:
            return dataset / PLAN_FILE, (dataset / PLAN_FILE).read_bytes(_MAX_BYTES)
        except FileNotFoundError:
            return dataset / PLAN_FILE, None
    path = path_inside(dataset, PLAN_FILE)
    return path, read_small_file(path, _MAX_BYTES) if path_exists(path) else None


def _recorded_entries(dataset: AnyPath) -> Iterator[PlannedEntry]:
    """Yield the scenes that have finished bags; in an object store, those in the index."""
    if isinstance(dataset, ObjectPath):
        from simbev_ros.dataset.index import read_index

        for row in read_index(dataset):
            yield PlannedEntry(number=row["number"], map=row["map"], split=row["split"])
        return
    refuse_links_out(dataset, SCENES_FOLDER)
    for split in SPLITS:
        for match in filter(None, map(_SCENE.fullmatch, _folder_names(dataset / SCENES_FOLDER / split))):
            if int(match["number"]) <= MAX_SCENE_NUMBER:
                yield PlannedEntry(number=int(match["number"]), map=match["map"], split=split)


def _folder_names(path: Path) -> list[str]:
    """Names of the folders in a folder, sorted; none if it cannot be read. A path for each would take much memory."""
    with suppress(FileNotFoundError, NotADirectoryError, PermissionError), os.scandir(path) as found:
        return sorted(entry.name for entry in found if entry.is_dir())
    return []
