"""Looks at paths and reads small files that users wrote or got from others.

Only regular files are read, and never more bytes than a limit. A path that no file can have, because it is too long or
a loop of links, is one where nothing exists; ``pathlib`` raises an ``OSError`` for some of these.
"""

import os
import stat
from pathlib import Path

from simbev_ros.foundation.errors import InputError


def path_exists(path: Path) -> bool:
    """Whether a path leads to anything."""
    return os.path.exists(path)  # noqa: PTH110  # Path.exists raises errors


def is_file(path: Path) -> bool:
    """Whether a path leads to a regular file."""
    return os.path.isfile(path)  # noqa: PTH113  # Path.is_file raises errors


def is_folder(path: Path) -> bool:
    """Whether a path leads to a folder."""
    return os.path.isdir(path)  # noqa: PTH112  # Path.is_dir raises errors


def require_file(path: Path) -> None:
    """Check that a path leads to a regular file, because opening another thing, such as a pipe, may wait forever.

    Raises:
        InputError: It does not.
    """
    try:
        mode = path.stat().st_mode
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from None
    if not stat.S_ISREG(mode):
        raise InputError(f"{path}: is not a file")


def read_small_file(path: Path, max_bytes: int) -> bytes:
    """The content of a regular file.

    Raises:
        InputError: It is not a regular file, cannot be read, or is larger than ``max_bytes``.
    """
    require_file(path)
    try:
        with path.open("rb") as stream:
            content = stream.read(max_bytes + 1)
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from None
    if len(content) > max_bytes:
        raise InputError(f"{path}: is larger than {max_bytes >> 20} MiB")
    return content
