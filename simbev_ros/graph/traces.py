"""What a graph has on the machine, written down, so that the next one removes it if this one is killed."""

import json
import os
import shutil
import tempfile
from pathlib import Path

from simbev_ros.graph.shared_memory import held_files, remove_orphans

_PREFIX = "simbev_ros-"
_FILE = "traces.json"


class Traces:
    """The folder for logs and parameters of one graph, and the files in shared memory of its processes.

    Attributes:
        folder: Temporary.
    """

    def __init__(self) -> None:
        sweep()
        self.folder = Path(tempfile.mkdtemp(prefix=_PREFIX))
        self._files: set[Path] = set()
        self._write()

    def note(self, pid: int) -> None:
        """Write down what a process has in shared memory now."""
        files = held_files(pid) - self._files
        if files:
            self._files |= files
            self._write()

    def remove(self, *, keep_logs: bool) -> None:
        """Remove everything, the processes having ended."""
        remove_orphans(self._files)
        (self.folder / _FILE).unlink(missing_ok=True)
        if not keep_logs:
            shutil.rmtree(self.folder, ignore_errors=True)
        sweep()

    def _write(self) -> None:
        written = self.folder / f"{_FILE}.part"
        written.write_text(json.dumps({"pid": os.getpid(), "files": sorted(map(str, self._files))}))
        written.rename(self.folder / _FILE)


def sweep() -> None:
    """Remove what graphs of this user have left that were killed."""
    for path in Path(tempfile.gettempdir()).glob(f"{_PREFIX}*/{_FILE}"):
        try:
            if path.stat().st_uid != os.getuid():
                continue
            left = json.loads(path.read_text())
            if _is_alive(int(left["pid"])):
                continue
            files = [Path(file) for file in left["files"]]
            remove_orphans(files)
            if any(file.exists() for file in files):
                continue  # processes of that graph are still about to end
        except (OSError, ValueError, KeyError, TypeError):
            continue  # another process is removing it
        shutil.rmtree(path.parent, ignore_errors=True)


def _is_alive(pid: int) -> bool:
    """Whether a process of this number runs Python; numbers are used again."""
    try:
        return b"python" in Path(f"/proc/{pid}/cmdline").read_bytes()
    except OSError:
        return False
