"""Opens and locks files: never through a link, and with their content as it is."""

import errno
import os
import stat
from importlib import import_module
from pathlib import Path
from typing import Any

_LOCKED_BYTE = 1 << 30
"""Position that is locked on Windows, where others cannot read what is locked."""


def open_lock_file(path: Path, folder: int | None = None) -> int:
    """Open a file for reading and writing, made if it is missing, and return its descriptor.

    Args:
        path: The file.
        folder: Descriptor of the folder that a relative path starts from; None: the working directory.

    Raises:
        OSError: The file cannot be opened, or it is a link, a device or anything else that is not a file.
    """
    flags = os.O_RDWR | os.O_CREAT
    for name in ("O_NOFOLLOW", "O_NONBLOCK", "O_CLOEXEC"):  # which Windows does not have
        flags |= getattr(os, name, 0)
    try:
        descriptor = os.open(path, flags, 0o666, dir_fd=folder)
    except OSError as error:
        if error.errno == errno.ELOOP:
            raise OSError(errno.ELOOP, f"{path.name} is a link", str(path)) from None
        raise
    if not stat.S_ISREG(os.fstat(descriptor).st_mode):
        os.close(descriptor)
        raise OSError(errno.EINVAL, f"{path.name} is not a file", str(path))
    return descriptor


def lock_file(descriptor: int) -> None:
    """Lock an open file until it is closed, or its process ends.

    Raises:
        BlockingIOError: Another process has locked it.
        OSError: It cannot be locked.
    """
    if os.name == "nt":
        msvcrt: Any = import_module("msvcrt")
        os.lseek(descriptor, _LOCKED_BYTE, os.SEEK_SET)
        try:
            msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)
        except PermissionError as error:
            raise BlockingIOError(errno.EAGAIN, error.strerror) from None
        finally:
            os.lseek(descriptor, 0, os.SEEK_SET)
        return
    import fcntl  # not on Windows

    fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
