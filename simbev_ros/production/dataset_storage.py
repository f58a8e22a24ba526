"""Storage backends of a dataset, as the driver of production sees them: a folder, or a prefix of an object store."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from simbev_ros.dataset.index_row import Row
from simbev_ros.dataset.lock import DatasetLock
from simbev_ros.dataset.plan import PlannedEntry
from simbev_ros.dataset.staging import clean_up_staging, staging_of
from simbev_ros.foundation.files.whole_files import require_writable
from simbev_ros.foundation.object_store.object_lock import ObjectLock, require_writable_store
from simbev_ros.foundation.object_store.object_path import AnyPath, ObjectPath
from simbev_ros.foundation.object_store.transfers import delete_tree
from simbev_ros.production.scene_log import Attempt
from simbev_ros.production.upload import Uploader

if TYPE_CHECKING:
    from simbev_ros.production.bucket_storage import BucketStorage
    from simbev_ros.production.folder_storage import FolderStorage

Lock = DatasetLock | ObjectLock


class DatasetStorage(Protocol):
    """Takes finished scenes from workers, and keeps index and logs. Only the driver writes into it.

    Every method may raise ``InputError``: a file or an object cannot be written or read; and ``DiskError``: the disk is
    full.

    Attributes:
        staging: Folder on this machine for the workers' folders of unfinished scenes. Its name is new, because workers
            of a driver that was killed may still write into theirs.
        damaged: Problems of scenes that exist and are damaged, by name.
    """

    staging: Path
    damaged: dict[str, str]

    @property
    def total_bytes(self) -> int:
        """Size of all scenes."""

    def uploader_for(self, worker: str) -> Uploader | None:
        """The uploader of a worker's finished bags; None: they stay in the worker's folder in ``staging``."""

    def commit(self, worker: str, entry: PlannedEntry, row: Row) -> None:
        """Move a finished scene from a worker into the dataset, and add it to the index."""

    def log(self, attempt: Attempt, summary: str, output: Mapping[str, str], *, failed: bool = False) -> None:
        """Write the log of an attempt."""

    def check_space(self, scenes: int) -> None:
        """Refuse to begin another scene that may not fit.

        Args:
            scenes: Number of unfinished scenes, including the one to begin.

        Raises:
            DiskError: Less is free than that many of the largest scene so far take plus what must stay free.
        """

    def discard(self, worker: str) -> None:
        """Remove what a worker that is lost has left."""

    def close(self) -> None:
        """Write the index, and remove all unfinished scenes."""


@contextmanager
def lock_dataset(path: AnyPath) -> Iterator[Lock]:
    """Lock a dataset against other drivers, and clean up after one that was killed.

    Raises:
        InputError: It cannot be written to, or another process writes into it.
    """
    if isinstance(path, ObjectPath):
        with ObjectLock(path) as lock:
            delete_tree(staging_of(path))
            yield lock
    else:
        with DatasetLock(path) as file_lock:
            clean_up_staging(path)
            yield file_lock


def open_storage(
    path: AnyPath, lock: Lock, existing: Sequence[PlannedEntry], min_free_bytes: int
) -> "FolderStorage | BucketStorage":
    """Open a dataset to add scenes to it or to remove some.

    Args:
        path: The dataset.
        lock: Its lock, from ``lock_dataset``.
        existing: Scenes that have a finished bag.
        min_free_bytes: Space on this machine's disk that must stay free.

    Raises:
        InputError: The index is damaged, or cannot be written.
    """
    if isinstance(path, ObjectPath):
        from simbev_ros.production.bucket_storage import BucketStorage

        assert isinstance(lock, ObjectLock)
        return BucketStorage(path, lock, min_free_bytes)
    from simbev_ros.production.folder_storage import FolderStorage

    return FolderStorage(path, existing, min_free_bytes)


def require_writable_dataset(path: AnyPath) -> None:
    """Check that a dataset can be written to. At most an empty object for its prefix stays.

    Raises:
        InputError: It cannot.
        DiskError: The disk is full.
    """
    if isinstance(path, ObjectPath):
        require_writable_store(path)
    else:
        require_writable(path)
