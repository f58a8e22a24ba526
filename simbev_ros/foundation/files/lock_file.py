"""Opens files that processes lock: never through a link, and with their content as it is."""

import errno
import os
import stat
from pathlib import Path


def open_lock_file(path: Path, folder: int | None = None) -> int:
    """Open a file for reading and writing, made if it is missing, and return its descriptor.

    Args:
        path: The file.
        folder: Descriptor of the folder that a relative path starts from; None: the working directory.

    Raises:
        OSError: The file cannot be opened, or it is a link, a device or another thing that is no file.
    """
    flags = os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC
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
