"""A dataset in a folder, as the driver of its production writes into it: scenes, index, and a log for each attempt."""

import secrets
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path

from simbev_ros.dataset.growing_index import GrowingIndex
from simbev_ros.dataset.index import update_index
from simbev_ros.dataset.index_row import Row
from simbev_ros.dataset.plan import PlannedEntry, bag_of
from simbev_ros.dataset.staging import move_into_dataset, remove_from_dataset, staging_of
from simbev_ros.foundation.files.whole_files import write_errors
from simbev_ros.production.scene_log import Attempt, write_scene_log
from simbev_ros.recording.bag_files import check_space
from simbev_ros.recording.layout import scenes_folder
from simbev_ros.ros.graph.interrupts import postponing_interrupts


class FolderStorage:
    """Takes finished scenes from the workers' folders; see ``DatasetStorage``. The caller holds the dataset's lock.

    Args:
        path: The dataset's folder.
        existing: Scenes that have a finished bag; the index is brought up to date with them.
        min_free_bytes: Space on the disk that must stay free.

    Attributes:
        index: The index.
        staging: Folder for the workers' folders of unfinished scenes. Its name is new, because workers of a driver that
            was killed may still write into theirs.
        damaged: Problems of scenes that exist and are damaged, by name.

    Raises:
        InputError: The index is damaged, or cannot be written.
    """

    def __init__(self, path: Path, existing: Sequence[PlannedEntry], min_free_bytes: int) -> None:
        self._path, self._min_free_bytes = path, min_free_bytes
        self.staging = staging_of(path) / secrets.token_hex(4)
        scenes_folder(path).mkdir(exist_ok=True)  # from now on it is recognized as a dataset
        table, damaged = update_index(path, (bag_of(path, entry) for entry in existing))
        self.index = GrowingIndex(path, table)
        self.damaged = {bag.name: problem for bag, problem in damaged.items()}

    @property
    def total_bytes(self) -> int:
        """Size of all scenes."""
        return self.index.total_bytes

    def uploader_for(self, worker: str) -> None:
        """Bags stay in the worker's folder, where ``commit`` finds them."""

    def commit(self, worker: str, entry: PlannedEntry, row: Row) -> None:
        """Move a finished scene from a worker's folder into the dataset, and add it to the index, even if interrupted.

        Raises:
            DiskError: The disk is full.
            InputError: A file cannot be written.
        """
        with postponing_interrupts():
            move_into_dataset(self._path, entry, self.staging / worker)
            self.index.add(row)
        self.damaged.pop(entry.name, None)

    def remove(self, entry: PlannedEntry) -> None:
        """Remove a scene, with its additional bags and its row of the index.

        Raises:
            DiskError: The disk is full.
            InputError: A file cannot be written.
        """
        with postponing_interrupts(), write_errors(bag_of(self._path, entry)):
            self.index.remove(entry.number)
            remove_from_dataset(self._path, entry)

    def log(self, attempt: Attempt, summary: str, output: Mapping[str, str], *, failed: bool = False) -> None:
        """Write the log of an attempt.

        Raises:
            DiskError: The disk is full.
            InputError: It cannot be written for another reason.
        """
        write_scene_log(self._path, attempt, summary, output, failed=failed)

    def check_space(self, scenes: int) -> None:
        """Refuse to begin another scene that may not fit.

        Args:
            scenes: Number of unfinished scenes, including the one to begin.

        Raises:
            DiskError: Less is free than that many of the largest scene so far take plus what must stay free.
        """
        check_space(self._path, self._min_free_bytes, self.index.largest_bytes * scenes)

    def discard(self, worker: str) -> None:
        """Remove what a worker that is lost has left."""
        shutil.rmtree(self.staging / worker, ignore_errors=True)

    def close(self) -> None:
        """Write the index, and remove all unfinished scenes.

        Raises:
            DiskError: The disk is full.
            InputError: The index cannot be written.
        """
        shutil.rmtree(staging_of(self._path), ignore_errors=True)
        self.index.write()
