"""Entries of the cache: where they are, which are in use, and which are evicted.

An entry is a folder below the folder of its kind. Its name contains a hash of the fingerprint of the code that built
it. A process that uses an entry sets its modification time and holds a lock on it until it has used many others, or
ends, however that happens. Entries that other versions of the code built are evicted when no process has used them for
a while, or sooner while disk space is low.
"""

import fcntl
import hashlib
import math
import os
import shutil
import tempfile
import time
from collections import OrderedDict
from contextlib import suppress
from pathlib import Path

from simbev_ros.foundation.files.confined_paths import path_inside
from simbev_ros.foundation.files.private_folder import substitute_home, writable_home

KEPT_S = 14 * 86400.0
"""How long after its last use an entry of another version is kept."""

SPARE_BYTES = 20e9
"""Free space on the disk below which entries of other versions are not kept; two large maps take 8 GB."""

_MAX_HELD = 64
"""Number of entries that a process holds at once; each takes a descriptor, and each map has three entries."""

_held: OrderedDict[tuple[Path, int], int] = OrderedDict()
"""Descriptors of the locked entries by path and inode, in order of their last use."""


def default_cache_dir() -> Path:
    """Folder of the cache: ``$XDG_CACHE_HOME/simbev_ros``, by default ``~/.cache/simbev_ros``.

    Without a home that can be written to, it is in the folder for temporary files.

    Raises:
        InputError: Another user could write to it there.
    """
    if given := os.environ.get("XDG_CACHE_HOME"):
        return Path(given) / "simbev_ros"
    with suppress(RuntimeError):
        folder = Path.home() / ".cache" / "simbev_ros"
        if folder.is_dir() or os.access(folder.parent, os.W_OK):
            return folder
    return (writable_home() or substitute_home()) / ".cache" / "simbev_ros"


def entry_path(kind: Path, name: str, version: bytes, key: bytes) -> Path:
    """Path of an entry, whether or not it exists.

    Args:
        kind: Folder of the entry's kind.
        name: Shown to users who look into the cache; it identifies nothing.
        version: Fingerprint of the code that builds the entry.
        key: All else that decides the content.

    Raises:
        InputError: The name leads out of the folder.
    """
    entry = f"{name}-{hashlib.sha256(version).hexdigest()[:8]}-{hashlib.sha256(version + key).hexdigest()[:20]}"
    return path_inside(kind, entry)


def hold_entry(entry: Path) -> None:
    """Protect an entry from eviction while this process uses it; without effect if it is absent or read-only.

    A process holds a limited number of entries, those used last; earlier ones are young, so that they are evicted last.
    """
    with suppress(OSError):
        os.utime(entry)
        _lock(entry, entry.stat().st_ino)


def _lock(entry: Path, inode: int) -> None:
    """Lock an entry, once; unlock the one that has not been used for the longest time if too many are locked."""
    if (entry, inode) not in _held:
        descriptor = os.open(entry, os.O_RDONLY | os.O_DIRECTORY)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except OSError:  # another process is just removing it
            os.close(descriptor)
            raise
        _held[entry, inode] = descriptor
    _held.move_to_end((entry, inode))
    if len(_held) > _MAX_HELD:
        _, oldest = _held.popitem(last=False)
        os.close(oldest)


def evict_unused(written: Path) -> None:
    """Remove unused entries of the same kind that other versions built: old ones, and more while disk space is low.

    Args:
        written: An entry that was just written. Entries of its version stay, and so does any that cannot be removed.
    """
    version = _version(written)
    others = [(_last_use_s(entry), entry) for entry in written.parent.iterdir() if _version(entry) != version]
    for last_use_s, entry in sorted(others):
        if last_use_s < time.time() - KEPT_S or (not _is_hidden(entry) and _is_space_low(entry.parent)):
            with suppress(OSError):
                _evict(entry, last_use_s)


def discard_entry(entry: Path) -> None:
    """Remove a damaged entry; it disappears for all processes at the same moment."""
    with tempfile.TemporaryDirectory(prefix=".damaged-", dir=entry.parent) as bin_, suppress(FileNotFoundError):
        entry.rename(Path(bin_) / entry.name)


def _evict(entry: Path, last_use_s: float) -> None:
    """Remove an entry unless a process holds it, or has begun to use it since it was last looked at."""
    descriptor = os.open(entry, os.O_RDONLY | os.O_DIRECTORY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        if _last_use_s(entry) == last_use_s:
            discard_entry(entry)
    finally:
        os.close(descriptor)


def _version(entry: Path) -> str:
    """The part of an entry's name that stands for the version of the code."""
    return entry.name.rpartition("-")[0].rpartition("-")[2]


def _last_use_s(entry: Path) -> float:
    """Time at which an entry was last used, in seconds since the epoch; infinite if it is gone."""
    try:
        return entry.stat().st_mtime
    except FileNotFoundError:
        return math.inf


def _is_hidden(entry: Path) -> bool:
    """Whether this is a temporary folder, of an entry that a process is building or removing."""
    return entry.name.startswith(".")


def _is_space_low(folder: Path) -> bool:
    """Whether the disk of a folder has little free space."""
    return shutil.disk_usage(folder).free < SPARE_BYTES
