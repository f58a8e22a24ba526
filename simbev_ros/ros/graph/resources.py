"""Keeps a record of a graph's files on the machine, so that the next graph removes them if this one is killed."""

import json
import shutil
import tempfile
import time
from collections.abc import Iterable
from pathlib import Path

import psutil

from simbev_ros.foundation.files.private_folder import is_private_folder
from simbev_ros.foundation.files.whole_files import write_errors, write_whole
from simbev_ros.ros.graph.shared_memory import abandoned_files, held_files, remove_orphans, segment_names, unheld_files

_PREFIX = "simbev_ros-"
_FILE = "resources.json"
_SETTLING_S = 1.0
"""Time after which a process has surely mapped a file that it has made."""
_MAX_CLOCK_STEP_S = 60.0
"""Start times this close are equal: the system derives them from a wall clock that may be adjusted in between."""


class GraphResources:
    """The folder for logs and parameters of one graph, and the shared-memory files of its processes.

    Attributes:
        folder: Temporary folder of the graph.
    """

    def __init__(self) -> None:
        reap_killed_graphs()
        self.folder = temporary_folder()
        self._files: set[Path] = set()
        self._names_before = segment_names()
        self._names: frozenset[str] = frozenset()
        self._look_again_s: float | None = None

    def note(self, pids: Iterable[int]) -> None:
        """Add the files that processes currently have in shared memory to the record.

        To find them is slow, so processes are only looked at when files have come or gone, and once more a while
        later; call this several times per second.
        """
        names, now_s = segment_names(), time.monotonic()
        if names != self._names:
            self._names, self._look_again_s = names, now_s + _SETTLING_S
        elif self._look_again_s is not None and now_s >= self._look_again_s:
            self._look_again_s = None
        else:
            return
        files = held_files(pids) - self._files
        if files:
            self._files |= files
            _record(self.folder, self._files)

    def remove(self, *, keep_logs: bool) -> None:
        """Remove everything; call it when the processes have ended."""
        remove_orphans(self._files)
        # A process that ended soon after it had made a file was perhaps never looked at in between.
        new = segment_names() - self._names_before
        if unheld_files(new):
            time.sleep(_SETTLING_S)  # those of another graph that starts are mapped by then
            remove_orphans(abandoned_files(unheld_files(new)))
        (self.folder / _FILE).unlink(missing_ok=True)
        if not keep_logs:
            shutil.rmtree(self.folder, ignore_errors=True)
        reap_killed_graphs()


def temporary_folder() -> Path:
    """A new temporary folder, which the next graph removes if this process is killed.

    Raises:
        DiskError: The disk is full.
        InputError: It cannot be made.
    """
    with write_errors(Path(tempfile.gettempdir())):
        folder = Path(tempfile.mkdtemp(prefix=_PREFIX))
        _record(folder, ())
    return folder


def _record(folder: Path, files: Iterable[Path]) -> None:
    """Note in a temporary folder which process it belongs to, and its files in shared memory."""
    process = psutil.Process()
    record = {"pid": process.pid, "started_s": process.create_time(), "files": sorted(map(str, files))}
    write_whole(folder / _FILE, json.dumps(record).encode())


def reap_killed_graphs() -> None:
    """Remove what killed graphs of this user have left behind."""
    for folder in Path(tempfile.gettempdir()).glob(f"{_PREFIX}*"):
        try:
            if not is_private_folder(folder.lstat()):
                continue
            left = json.loads((folder / _FILE).read_text())
            if _is_alive(int(left["pid"]), left["started_s"]):
                continue
            files = [Path(file) for file in left["files"]]
            remove_orphans(files)
            if any(file.exists() for file in files):
                continue  # some processes of that graph have not ended yet
        except (OSError, ValueError, KeyError, TypeError):
            continue  # no folder of a graph, or another process is removing it
        shutil.rmtree(folder, ignore_errors=True)


def _is_alive(pid: int, started_s: float) -> bool:
    """Whether the process with this pid and start time, s since 1970, still runs: pids are reused, so both count."""
    try:
        process = psutil.Process(pid)
        is_same: bool = abs(process.create_time() - started_s) < _MAX_CLOCK_STEP_S
        is_zombie: bool = process.status() == psutil.STATUS_ZOMBIE
        return is_same and not is_zombie
    except psutil.NoSuchProcess:
        return False
