"""Distinguishes this user's folders from those of other users in a shared folder such as /tmp."""

import os
import stat


def is_private_folder(status: os.stat_result) -> bool:
    """Whether a status, of ``os.lstat`` or ``os.fstat``, is that of a folder of this user that no other can change."""
    is_shared = status.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
    return stat.S_ISDIR(status.st_mode) and status.st_uid == os.getuid() and not is_shared
