"""The MCAP files of one bag: chunks in, one file after the other out, as large as they may be."""

import errno
import os
from collections import Counter
from collections.abc import Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path

from mcap.records import Attachment
from rich.filesize import decimal

from simbev_ros.errors import DiskError
from simbev_ros.recording.bag_metadata import RecordedFile
from simbev_ros.recording.layout import mcap_in
from simbev_ros.recording.mcap.mcap_file import ChunkInProgress, Definition, McapFile

_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


class BagFiles:
    """Writes them, for one thread at a time.

    Args:
        folder: Where they go.
        name: That of the scene.
        zstd_level: None: chunks are not compressed.
        split_bytes: A file that has so many is closed, and the next one begun; None: there is one.
        sync_bytes: Payload that is forced to the disk together, while the next is written.
        least_free_bytes: Must stay free on the disk; looked at whenever something was forced to it.

    Attributes:
        definitions: Of all topics; each file gets all of them.
        files: What is in each file, that in the making included.
        counts: Messages by channel.
        failure: After it nothing is written any more, but the end of the last file.

    Raises:
        DiskError: The disk is full, or nearly, or fails (every method).
        OSError: The first file cannot be made.
    """

    def __init__(
        self,
        folder: Path,
        name: str,
        *,
        zstd_level: int | None,
        split_bytes: int | None,
        sync_bytes: int,
        least_free_bytes: int,
    ) -> None:
        self.definitions: list[Definition] = []
        self.files: list[RecordedFile] = []
        self._folder, self._name = folder, name
        self._zstd_level, self._split_bytes = zstd_level, split_bytes
        self._sync_bytes, self._least_free_bytes = sync_bytes, least_free_bytes
        self._unsynced_bytes = 0
        self._syncing: Future[None] | None = None
        self._sync_thread = ThreadPoolExecutor(1, thread_name_prefix="sync")
        self.failure: DiskError | None = None
        self.counts: Counter[int] = Counter()
        self._file = self._next_file()

    def define(self, definition: Definition) -> None:
        """Announce a topic."""
        self.definitions.append(definition)

    def add_chunk(self, chunk: ChunkInProgress) -> None:
        """Write messages."""
        with self._once():
            if self._split_bytes is not None and self._file.size >= self._split_bytes:
                self._join_sync()
                self._file.close({}, self.definitions)
                self._file = self._next_file()
            self._file.add_chunk(chunk, self.definitions)
        self.counts.update({channel_id: len(places) for channel_id, places in chunk.places.items()})
        self.files[-1].add([stamp_ns for places in chunk.places.values() for stamp_ns, _ in places])
        self._unsynced_bytes += chunk.payload_bytes
        if self._unsynced_bytes >= self._sync_bytes:
            self._begin_sync()

    def add_attachment(self, attachment: Attachment) -> None:
        """Write a file that goes with the messages."""
        with self._once():
            self._file.add_attachment(attachment)
        self.sync()

    def sync(self) -> None:
        """Force all to the disk, and see whether there is room for more."""
        self._begin_sync()
        with self._once():
            self._join_sync()

    def close(self, metadata: Mapping[str, Mapping[str, str]]) -> None:
        """Close the last file, with key-value records by name."""
        with disk_errors(self._folder):
            self._sync_thread.shutdown()
            self._file.close(metadata, self.definitions)

    def _begin_sync(self) -> None:
        """Force all to the disk when what was to be forced before is there."""
        with self._once():
            self._join_sync()
            check_space(self._folder, self._least_free_bytes)
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
    def _once(self) -> Iterator[None]:
        """Nothing is done after a failure."""
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
    """Turn what the operating system refuses into ``DiskError``."""
    try:
        yield
    except OSError as error:
        problem = "the disk is full" if error.errno in _FULL else f"cannot be written: {error.strerror}"
        raise DiskError(f"{folder}: {problem}; what was recorded before stays readable there") from None


def check_space(folder: Path, least_free_bytes: int, scene_bytes: int = 0) -> None:
    """See that there is room on the disk of a folder, which need not be there yet.

    Args:
        folder: The folder.
        least_free_bytes: What must stay free.
        scene_bytes: What is about to be written.

    Raises:
        DiskError: Less is free than both together.
    """
    status = os.statvfs(next(each for each in (folder, *folder.absolute().parents) if each.is_dir()))
    free_bytes = status.f_bavail * status.f_frsize
    if free_bytes < least_free_bytes + scene_bytes:
        needed = f"a scene takes up to {decimal(scene_bytes)}, and " if scene_bytes else ""
        raise DiskError(
            f"{folder}: the disk is nearly full: {decimal(free_bytes)} are free, {needed or 'and '}"
            f"{decimal(least_free_bytes)} must stay free (recording.least_free_mib)"
        )
