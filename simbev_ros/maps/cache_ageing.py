"""Entries of the cache that other versions of the code have made go when nobody has used them for long.

An entry is a folder below that of its kind, and its name says which version has made it. Who uses one bumps its time of
modification and holds a lock on it for as long as the process lives, which frees it whatever ends the process.
"""

import fcntl
import hashlib
import os
import tempfile
import time
from contextlib import suppress
from functools import cache
from pathlib import Path

KEPT_S = 14 * 86400.0
"""So long an entry of another version is kept after its last use."""


def entry_path(kind: Path, name: str, version: bytes, key: bytes) -> Path:
    """Where an entry is.

    Args:
        kind: Folder of its kind.
        name: For people who look into the cache.
        version: Of the code that makes it.
        key: All else that decides its content.
    """
    return kind / f"{name}-{hashlib.sha256(version).hexdigest()[:8]}-{hashlib.sha256(version + key).hexdigest()[:20]}"


def use(entry: Path) -> None:
    """Keep an entry for this process, and for others for a while, if it is there and may be changed."""
    with suppress(OSError):
        os.utime(entry)
        _lock(entry, entry.stat().st_ino)


@cache
def _lock(entry: Path, _inode: int) -> None:
    """Never unlocked: the folder stays open."""
    descriptor = os.open(entry, os.O_RDONLY | os.O_DIRECTORY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except OSError:  # it is just being removed
        os.close(descriptor)
        raise


def remove_unused(written: Path) -> None:
    """Remove the entries beside one that was just written that are of other versions, old, and in no use.

    What cannot be removed stays, without a word.
    """
    version = _version(written)
    for entry in written.parent.iterdir():
        if _version(entry) != version and _is_old(entry):
            with suppress(OSError):
                _remove(entry)


def discard(entry: Path) -> None:
    """Take an entry out of the cache, at once for all who look."""
    with tempfile.TemporaryDirectory(prefix=".damaged-", dir=entry.parent) as bin_, suppress(FileNotFoundError):
        entry.rename(Path(bin_) / entry.name)


def _remove(entry: Path) -> None:
    descriptor = os.open(entry, os.O_RDONLY | os.O_DIRECTORY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        if _is_old(entry):  # nobody has begun to use it before it was locked
            discard(entry)
    finally:
        os.close(descriptor)


def _version(entry: Path) -> str:
    return entry.name.rpartition("-")[0].rpartition("-")[2]


def _is_old(entry: Path) -> bool:
    try:
        return entry.stat().st_mtime < time.time() - KEPT_S
    except FileNotFoundError:
        return False
