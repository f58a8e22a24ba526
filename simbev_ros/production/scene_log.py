"""Log files of the scenes of a dataset: how each was made, and the output of the processes that made it."""

import time
from collections.abc import Mapping
from pathlib import Path

from simbev_ros.confined_paths import path_inside
from simbev_ros.recording.whole_files import write_errors, write_whole

LOG_FOLDER = "logs"


class SceneLog:
    """Log of one attempt at a scene: ``logs/<scene>.log``, or ``logs/<scene>.failed-1.log`` if the attempt failed."""

    def __init__(self, dataset: Path, name: str, attempt: int) -> None:
        self._folder, self._name, self._attempt = path_inside(dataset, LOG_FOLDER), name, attempt
        self._began = time.time()

    def close(self, summary: str, output: Mapping[str, str], *, failed: bool = False) -> None:
        """Write the file: a summary of how the attempt ended, and the output of each process.

        Raises:
            DiskError: The disk is full.
            InputError: It cannot be written for another reason.
        """
        name = f"{self._name}.failed-{self._attempt + 1}" if failed else self._name
        duration_s = time.time() - self._began
        began = time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(self._began))
        lines = [f"{self._name}, attempt {self._attempt + 1}, began {began}, took {duration_s:.1f} s", summary]
        for process, text in output.items():
            lines += [f"--- {process}", text.rstrip()] if text.strip() else []
        with write_errors(self._folder):
            write_whole(self._folder / f"{name}.log", ("\n".join(lines) + "\n").encode())
