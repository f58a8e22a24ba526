"""Which content of the cache is believed: what this user, or root, put there, unchanged, and under its own name.

What is read as it is (road networks, meshes) would otherwise be taken from all who can write to the
folder, and a folder that was copied under another name would silently give another map.
"""

import hashlib
import os
import stat
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

from simbev_ros.foundation.errors import InputError

_BLOCK_BYTES = 1 << 20

_checked: set[tuple[Path, int, int]] = set()
"""Path, inode and time of change of the seals that this process has checked."""


def require_own(entry: Path) -> None:
    """Check that no other user could have written an entry; one that is absent passes.

    Raises:
        InputError: It is a link, or another user owns it or may write to it.
    """
    with suppress(FileNotFoundError, NotADirectoryError):
        status = entry.lstat()
        # Where each user has a group of their own, folders are made writable for it.
        others = stat.S_IWOTH | (0 if status.st_gid == os.getgid() else stat.S_IWGRP)
        if not stat.S_ISDIR(status.st_mode) or status.st_uid not in (os.getuid(), 0) or status.st_mode & others:
            raise InputError(
                f"cache {entry}: is a link, or another user owns it or may write to it; remove it, or set "
                "XDG_CACHE_HOME to a folder of your own"
            )


def write_seal(seal: Path, entry: str, files: Iterable[Path]) -> None:
    """Write the digest of files, which are in the same folder, and of their entry's name."""
    seal.write_text(_digest(entry, files), encoding="ascii")


def require_seal(seal: Path, entry: str, files: Iterable[Path]) -> None:
    """Check files against their seal, once per process.

    Raises:
        ValueError: They were changed, or are those of another entry.
        OSError: One is missing.
    """
    status = seal.stat()
    key = seal, status.st_ino, status.st_mtime_ns
    if key not in _checked:
        if seal.read_text(encoding="ascii") != _digest(entry, files):
            raise ValueError(f"{seal.parent}: not what was written there for {entry}")
        _checked.add(key)


def _digest(entry: str, files: Iterable[Path]) -> str:
    """SHA-256 of the name of an entry, and of the names, sizes and bytes of files."""
    digest = hashlib.sha256(entry.encode() + b"\0")
    for path in sorted(files):
        with path.open("rb") as file:
            digest.update(f"{path.name}\0{os.fstat(file.fileno()).st_size}\0".encode())
            while block := file.read(_BLOCK_BYTES):
                digest.update(block)
    return digest.hexdigest()
