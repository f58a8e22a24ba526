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
        InputError: The folder cannot be made or written to, another process writes into it, or its lock is not a lock.
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
        before = self._file.read(_MAX_PID_DIGITS + 1)
        if before and not (before.isdecimal() and len(before) <= _MAX_PID_DIGITS):
            self._file.close()  # in a stranger's dataset it may be another name of any file
            raise InputError(f"{dataset}: {_LOCK_FILE} has other content than a lock; remove it")
        self._file.seek(0)
        self._file.truncate(0)
        self._file.write(str(os.getpid()))
        self._file.flush()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._file.truncate(0)
        self._file.close()
