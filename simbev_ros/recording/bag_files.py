"""Writer of a bag's MCAP files: receives chunks and attachments, starts new files at a size limit, syncs to disk."""

import shutil
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path

from mcap.records import Attachment
from rich.filesize import decimal

from simbev_ros.foundation.errors import DISK_FULL, DiskError
from simbev_ros.recording.bag_metadata import RecordedFile
from simbev_ros.recording.layout import mcap_in
from simbev_ros.recording.mcap.mcap_file import ChunkInProgress, Definition, McapFile, PackedRecords


class BagFiles:
    """Writes the MCAP files of one bag; for one thread at a time.

    Args:
        folder: The bag's folder.
        name: Name of the scene.
        zstd_level: Compression level of chunks; None: chunks are not compressed.
        split_bytes: A file of this size is closed and a new one is started; None: there is only one file.
        sync_bytes: Amount of payload that is synced to disk together, while the next is written.
        min_free_bytes: Space that must stay free on the disk; checked before every chunk and every sync.

    Attributes:
        definitions: Definitions of all topics; each file contains all of them.
        files: Contents of each file so far, including the one being written.
        counts: Number of messages by channel id.
        failure: First error of the disk. After it nothing is written any more except the end of the last file.

    Raises:
        DiskError: The disk is full, nearly full or failing (every method).
        OSError: The first file cannot be created.
    """

    def __init__(
        self,
        folder: Path,
        name: str,
        *,
        zstd_level: int | None,
        split_bytes: int | None,
        sync_bytes: int,
        min_free_bytes: int,
    ) -> None:
        self.definitions: list[Definition] = []
        self.files: list[RecordedFile] = []
        self._folder, self._name = folder, name
        self._zstd_level, self._split_bytes = zstd_level, split_bytes
        self._sync_bytes, self._min_free_bytes = sync_bytes, min_free_bytes
        self._unsynced_bytes = 0
        self._syncing: Future[None] | None = None
        self._sync_thread = ThreadPoolExecutor(1, thread_name_prefix="sync")
        self.failure: DiskError | None = None
        self.counts: Counter[int] = Counter()
        self._file = self._next_file()

    def define(self, definition: Definition) -> None:
        """Announce a topic."""
        self.definitions.append(definition)

    def add_chunk(self, chunk: ChunkInProgress, packed: Callable[[], PackedRecords] | None = None) -> None:
        """Write a chunk of messages, in a new file if the current one has reached its size limit.

        Args:
            chunk: The messages.
            packed: Waits for ``chunk.pack`` with the bag's level if another thread runs it.
        """
        with self._until_failure():
            if self._split_bytes is not None and self._file.size >= self._split_bytes:
                self._join_sync()
                self._file.close({}, self.definitions)
                self._file = self._next_file()
            check_space(self._folder, self._min_free_bytes)
            self._file.add_chunk(chunk, self.definitions, packed)
        self.counts.update({channel_id: len(entries) for channel_id, entries in chunk.index_entries.items()})
        self.files[-1].add_messages([stamp_ns for entries in chunk.index_entries.values() for stamp_ns, _ in entries])
        self._unsynced_bytes += chunk.payload_bytes
        if self._unsynced_bytes >= self._sync_bytes:
            self._begin_sync()

    def add_attachment(self, attachment: Attachment) -> None:
        """Write an attachment and sync it to disk."""
        with self._until_failure():
            self._file.add_attachment(attachment)
        self.sync()

    def sync(self) -> None:
        """Sync everything to disk, and check that there is space for more."""
        self._begin_sync()
        with self._until_failure():
            self._join_sync()

    def close(self, metadata: Mapping[str, Mapping[str, str]]) -> None:
        """Close the last file, with key-value records by name."""
        with disk_errors(self._folder):
            self._sync_thread.shutdown()
            self._file.close(metadata, self.definitions)

    def _begin_sync(self) -> None:
        """Start a sync in the background as soon as the previous one is done."""
        with self._until_failure():
            self._join_sync()
            check_space(self._folder, self._min_free_bytes)
            self._unsynced_bytes = 0
            self._syncing = self._sync_thread.submit(self._file.sync)

    def _join_sync(self) -> None:
        if self._syncing is not None:
            self._syncing.result()

    def _next_file(self) -> McapFile:
        path = mcap_in(self._folder, self._name, len(self.files))
        file = McapFile(path, self._zstd_level)
        self.files.append(RecordedFile(path.name))
        return file

    @contextmanager
    def _until_failure(self) -> Iterator[None]:
        """Raise the first failure again, or remember a new one, so that nothing is written after a failure."""
        if self.failure is not None:
            raise self.failure
        try:
            with disk_errors(self._folder):
                yield
        except DiskError as error:
            self.failure = error
            raise


@contextmanager
def disk_errors(folder: Path) -> Iterator[None]:
    """Context in which an ``OSError`` is raised as ``DiskError``."""
    try:
        yield
    except OSError as error:
        problem = DISK_FULL.get(error.errno or 0, f"cannot be written: {error.strerror}")
        raise DiskError(f"{folder}: {problem}") from None


@contextmanager
def disk_error_consequence(consequence: str) -> Iterator[None]:
    """Context that adds to a ``DiskError`` what became of the recorded data, which only those around it decide.

    Raises:
        DiskError: One was raised in the context.
    """
    try:
        yield
    except DiskError as error:
        raise DiskError(f"{error}; {consequence}") from None


def check_space(folder: Path, min_free_bytes: int, scene_bytes: int = 0) -> None:
    """Check that there is enough space on the disk of a folder, which need not exist yet.

    Args:
        folder: The folder.
        min_free_bytes: Space that must stay free.
        scene_bytes: Size of what is about to be written.

    Raises:
        DiskError: Less space is free than both together.
    """
    existing = next(each for each in (folder, *folder.absolute().parents) if each.is_dir())
    free_bytes = shutil.disk_usage(existing).free
    if free_bytes < min_free_bytes + scene_bytes:
        needed = f"a scene takes up to {decimal(scene_bytes)}, and " if scene_bytes else ""
        raise DiskError(
            f"{folder}: the disk is nearly full: {decimal(free_bytes)} are free, {needed or 'and '}"
            f"{decimal(min_free_bytes)} must stay free (recording.min_free_mib)"
        )
