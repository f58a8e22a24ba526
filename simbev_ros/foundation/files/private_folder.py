"""Folders of this user alone: those in a shared folder such as /tmp, and one that serves where there is no home."""

import os
import stat
import tempfile
from pathlib import Path

from simbev_ros.foundation.errors import InputError


def is_private_folder(status: os.stat_result) -> bool:
    """Whether a status, of ``os.lstat`` or ``os.fstat``, is that of a folder of this user that no other can change."""
    is_shared = status.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
    return stat.S_ISDIR(status.st_mode) and status.st_uid == os.getuid() and not is_shared


def writable_home() -> Path | None:
    """The user's home; None if there is none, or it cannot be written to, as for a bare user id in a container."""
    try:
        home = Path.home()
    except RuntimeError:
        return None
    return home if os.access(home, os.W_OK) else None


def substitute_home() -> Path:
    """Folder that serves where there is no ``writable_home``, below the folder for temporary files.

    Raises:
        InputError: It cannot be made, or another user could write to it.
    """
    path = Path(tempfile.gettempdir()) / f"simbev_ros-home-{os.getuid()}"
    remedy = "set HOME to a folder that can be written to"
    try:
        path.mkdir(mode=0o700, exist_ok=True)
        is_ours = is_private_folder(path.lstat())
    except OSError as error:
        raise InputError(f"{path}: cannot be made: {error.strerror}; {remedy}") from None
    if not is_ours:
        raise InputError(f"{path}: another user owns it or may write to it; {remedy}")
    return path
