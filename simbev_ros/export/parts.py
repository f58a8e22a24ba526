"""Divides an export into parts and records which are finished, so that a killed export resumes. All exporters use it.

A part is the files of one scene, or of some of its frames. Parts can be made in any order and in many processes, also
on several machines, one process for a part; a part is small and is sent there. Whatever ends a run, a power cut too,
this holds:

1. ``Part.begin`` removes what an earlier part of the same name has left, and makes a staging folder.
2. ``Part.write`` writes files to the staging folder.
3. ``Part.finish`` syncs them to the disk, moves them to their final paths, and writes the part's record last.

So files at final paths are complete, and a part with a record is finished. The record contains the part's identity, the
bags and settings from which it was made: with another identity the part is outdated and is made again. Files of a part
without a record belong to an interrupted run; the staging folder is the mark by which ``begin`` finds and removes them.
Records and staging folders are in the export's folder ``.parts``. The caller holds the folder by ``hold_export``.
"""

import json
import shutil
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

from simbev_ros.dataset.lock import DatasetLock
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.files.confined_paths import path_inside, refuse_links_out
from simbev_ros.foundation.files.structured_text import parse_json
from simbev_ros.foundation.files.syncing import sync
from simbev_ros.foundation.files.whole_files import write_errors, write_whole
from simbev_ros.recording.layout import PARTIAL_SUFFIX, bytes_of, is_dataset, locate_mcap

PARTS_FOLDER = ".parts"

Json = dict[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class Part:
    """One part of an export, finished or not. Exporters add what they need to make it in a subclass.

    Attributes:
        out: Folder of the export.
        name: Name of the part, unique in the export and the same in every run.
        identity: Items that the record of the finished part has: what the part was made from, such as a fingerprint of
            the scene's bags, and settings. Plain values.
        patterns: Glob patterns, relative to ``out``, of all files that a part of this name can have, whatever its
            identity.
        record_suffix: Suffix of the record's file name behind ``name``.
    """

    out: Path
    name: str
    identity: Json
    patterns: tuple[str, ...]
    record_suffix: str = ".json"

    def record(self) -> Json | None:
        """The record of the part; None if the part is not finished, or outdated."""
        try:
            record = parse_json(self._record_path.read_bytes())
        except (OSError, ValueError):
            return None
        return record if isinstance(record, dict) and self.identity.items() <= record.items() else None

    def finished_record(self) -> Json:
        """The record of a part that is finished.

        Raises:
            InputError: It is not; another process has changed the export.
        """
        record = self.record() or self._look_again()
        if record is None:
            raise InputError(f"{self._record_path}: this part of the export has been changed meanwhile")
        return record

    def begin(self) -> None:
        """Remove an earlier or interrupted part of this name, and make an empty staging folder.

        Raises:
            InputError: The folder cannot be written to.
        """
        self.remove()
        with write_errors(self.out):
            self._staging.mkdir(parents=True)

    def write(self, path: str, content: bytes) -> None:
        """Write a file of the part at once. Arguments and errors as for ``open``."""
        with self.open(path) as file:
            file.write(content)

    @contextmanager
    def open(self, path: str) -> Iterator[BinaryIO]:
        """Open a file of the part to write it, which appears at its final path when the part is finished.

        Args:
            path: Final path, relative to ``out``.

        Raises:
            InputError: The file cannot be written.
        """
        staged = path_inside(self._staging, path)
        with write_errors(self.out / path):
            staged.parent.mkdir(parents=True, exist_ok=True)
            with staged.open("wb") as file:
                yield file

    def finish(self, facts: Json) -> None:
        """Move the files of the part to their final paths, then write its record.

        Args:
            facts: Items of the record besides the identity, such as what the last stage of the export needs to know of
                this part. Plain values.

        Raises:
            InputError: A file cannot be written.
        """
        staging = self._staging
        targets = {file: self.out / file.relative_to(staging) for file in staging.rglob("*") if file.is_file()}
        folders = {folder for path in targets.values() for folder in path.parents if folder.is_relative_to(self.out)}
        with write_errors(self.out):
            sync(*targets)
            for file, path in targets.items():
                path.parent.mkdir(parents=True, exist_ok=True)
                file.replace(path)
            sync(*sorted(folders))
            write_whole(self._record_path, json.dumps({**self.identity, **facts}).encode())
            shutil.rmtree(staging)

    def remove(self) -> None:
        """Remove the record, the files and the staging folder of the part, whatever its identity, as far as they exist.

        Raises:
            InputError: A file cannot be removed.
        """
        if not (self._staging.exists() or self._record_path.exists()):
            return
        with write_errors(self.out):
            self._staging.mkdir(parents=True, exist_ok=True)  # if the run ends here, the next one continues the removal
            self._record_path.unlink(missing_ok=True)
            sync(self._record_path.parent)  # a record must not outlive its files
            for pattern in self.patterns:
                for file in list(self.out.glob(pattern)):
                    file.unlink()
            shutil.rmtree(self._staging)

    def tidy_up(self) -> None:
        """Remove what an interruption or failure after ``begin`` has left, at the end of a run; a finished part stays.

        Raises:
            InputError: A file cannot be removed.
        """
        if self._staging.exists():
            if self.record() is None:
                self.remove()
            else:
                with write_errors(self.out):
                    shutil.rmtree(self._staging)

    def _look_again(self) -> Json | None:
        """The record; NFS remembers for a while that a file was not there, until its folders are opened."""
        with suppress(OSError):
            for folder in (self.out, self._record_path.parent):
                list(folder.iterdir())
        return self.record()

    @property
    def _record_path(self) -> Path:
        return path_inside(self.out, Path(PARTS_FOLDER, f"{self.name}{self.record_suffix}"))

    @property
    def _staging(self) -> Path:
        return path_inside(self.out, Path(PARTS_FOLDER, f"{self.name}{PARTIAL_SUFFIX}"))


@contextmanager
def hold_export(out: Path) -> Iterator[None]:
    """Hold an export's folder, new or begun, while parts are written to it and removed from it.

    Raises:
        DiskError: The disk is full.
        InputError: The folder is a dataset or cannot be written to, another process writes into it, or a link in it
            leads out of it.
    """
    if is_dataset(out):
        raise InputError(f"{out}: holds a dataset; choose another folder for what is exported")
    with DatasetLock(out), write_errors(out):
        for entry in sorted(out.iterdir()):
            refuse_links_out(out, entry.name)
        yield


def fingerprint_of(bag: Path) -> str:
    """Fingerprint of a bag for the identity of parts: another bag at the same path has another one.

    Raises:
        BagError: There is no bag.
    """
    return f"{bytes_of(bag)} {locate_mcap(bag).stat().st_mtime_ns}"


def is_begun(out: Path) -> bool:
    """Whether a folder contains an export in parts, finished or not."""
    return (out / PARTS_FOLDER).is_dir()


def remove_vanished(out: Path, present: Collection[str], patterns_of: Callable[[str], tuple[str, ...] | None]) -> None:
    """Remove earlier parts without data, such as the end of a scene that is shorter now.

    Args:
        out: Folder of the export.
        present: Names of the parts that there are now.
        patterns_of: Patterns of the files of a part, by its name; None: the part stays.

    Raises:
        InputError: A file cannot be removed.
    """
    for name in part_names(out) - set(present):
        patterns = patterns_of(name)
        if patterns is not None:
            Part(out=out, name=name, identity={}, patterns=patterns).remove()


def part_names(out: Path) -> set[str]:
    """Names of all parts in an export's folder, finished or interrupted."""
    files = (out / PARTS_FOLDER).glob("*")
    return {file.name.removesuffix(".json").removesuffix(PARTIAL_SUFFIX) for file in files}
