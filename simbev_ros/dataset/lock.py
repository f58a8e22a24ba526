"""Lock that keeps a second process from writing into a dataset."""

import os
from pathlib import Path
from typing import Self

from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.files.lock_file import lock_file, open_lock_file

_LOCK_FILE = ".lock"
_MAX_PID_DIGITS = 10


class DatasetLock:
    """Context manager that a process holds while it writes into a dataset.

    The operating system releases the lock when the process ends, however it ends.

    Raises:
        InputError: The folder cannot be made or written to, or another process writes into it.
    """

    def __init__(self, dataset: Path) -> None:
        try:
            dataset.mkdir(parents=True, exist_ok=True)
            self._file = os.fdopen(open_lock_file(dataset / _LOCK_FILE), "r+", errors="replace")
            lock_file(self._file.fileno())
        except BlockingIOError:
            holder = self._file.read(_MAX_PID_DIGITS).strip()
            self._file.close()
            name = f"process {holder}" if holder.isdecimal() else "another process"
            raise InputError(f"{dataset}: {name} is writing into it") from None
        except OSError as error:
            raise InputError(f"{dataset}: cannot be written to: {error.strerror}") from None
        self._file.truncate(0)
        self._file.write(str(os.getpid()))
        self._file.flush()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._file.truncate(0)
        self._file.close()
