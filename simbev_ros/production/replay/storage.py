"""A dataset that replays are recorded into, as the driver of production writes into it."""

import secrets
import shutil
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path

from simbev_ros.dataset.index_row import Row
from simbev_ros.dataset.plan import PlannedEntry, bag_of
from simbev_ros.dataset.staging import staging_of
from simbev_ros.foundation.files.syncing import sync_names
from simbev_ros.foundation.files.whole_files import write_errors
from simbev_ros.production.scene_log import Attempt, write_scene_log
from simbev_ros.recording.bag_files import check_space


class ReplayStorage:
    """Takes replays from the workers' folders; see ``DatasetStorage``. The caller holds the dataset's lock.

    Replays are scenes of a dataset of their own, or additional bags of the scenes, which change neither plan nor index.

    Args:
        path: The dataset's folder.
        targets: For each replay the folder that its bag gets; logs have the names of these folders.
        existing: Replays that exist already.
        min_free_bytes: Space on the disk that must stay free.

    Attributes:
        staging: Folder for the workers' folders of unfinished bags. Its name is new, because workers of a driver that
            was killed may still write into theirs.
        damaged: Nothing, as existing bags are left alone.
        total_bytes: Size of all replays.
    """

    def __init__(
        self, path: Path, targets: Mapping[PlannedEntry, Path], existing: Iterable[Path], min_free_bytes: int
    ) -> None:
        self._path, self._targets, self._min_free_bytes = path, targets, min_free_bytes
        self._log_names = {entry.name: target.name for entry, target in targets.items()}
        self.staging = staging_of(path) / secrets.token_hex(4)
        self.damaged: dict[str, str] = {}
        sizes = [sum(file.stat().st_size for file in bag.glob("*.mcap")) for bag in existing]
        self.total_bytes, self._largest_bytes = sum(sizes), max(sizes, default=0)

    def uploader_for(self, worker: str) -> None:
        """Bags stay in the worker's folder, where ``commit`` finds them."""

    def commit(self, worker: str, entry: PlannedEntry, row: Row) -> None:
        """Move a finished bag from a worker's folder to its place.

        Raises:
            DiskError: The disk is full.
            InputError: There is something at its place, or it cannot be written to.
        """
        target = self._targets[entry]
        with write_errors(target):
            target.parent.mkdir(parents=True, exist_ok=True)
            bag_of(self.staging / worker, entry).rename(target)
            sync_names([target])
        self.total_bytes += row["bytes"]
        self._largest_bytes = max(self._largest_bytes, row["bytes"])

    def log(self, attempt: Attempt, summary: str, output: Mapping[str, str], *, failed: bool = False) -> None:
        """Write the log of an attempt.

        Raises:
            DiskError: The disk is full.
            InputError: It cannot be written for another reason.
        """
        named = replace(attempt, scene=self._log_names[attempt.scene])
        write_scene_log(self._path, named, summary, output, failed=failed)

    def check_space(self, scenes: int) -> None:
        """Refuse to begin another replay that may not fit.

        Args:
            scenes: Number of unfinished replays, including the one to begin.

        Raises:
            DiskError: Less is free than that many of the largest replay so far take plus what must stay free.
        """
        check_space(self._path, self._min_free_bytes, self._largest_bytes * scenes)

    def discard(self, worker: str) -> None:
        """Remove what a worker that is lost has left."""
        shutil.rmtree(self.staging / worker, ignore_errors=True)

    def close(self) -> None:
        """Remove all unfinished replays."""
        shutil.rmtree(staging_of(self._path), ignore_errors=True)
