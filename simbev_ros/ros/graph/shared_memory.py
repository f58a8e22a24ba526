"""Finds the shared-memory files of Fast DDS that a process holds, and removes those that killed processes left."""

import fcntl
import os
import re
from collections.abc import Collection, Iterable
from pathlib import Path

import psutil

_FOLDER = Path("/dev/shm")
_MAPPED = re.compile(rb"/dev/shm/([^\s/]*fastrtps[^\s/]*)")


def segment_names() -> frozenset[str]:
    """Names of all files of the middleware in /dev/shm, of all users."""
    if not _FOLDER.is_dir():
        return frozenset()
    return frozenset(path.name for path in _FOLDER.iterdir() if "fastrtps" in path.name)


def held_files(pids: Iterable[int]) -> set[Path]:
    """The middleware's files in /dev/shm that processes have mapped, with the lock files that belong to them.

    It reads /proc/PID/maps, because psutil's ``memory_maps`` also counts the pages of every mapping, which is slow.
    """
    mapped = {_segment(name) for pid in pids for name in _MAPPED.findall(_mappings(pid))}
    return {file for file in middleware_files() if _segment(file.name.encode()) in mapped} if mapped else set()


def _mappings(pid: int) -> bytes:
    try:
        return Path(f"/proc/{pid}/maps").read_bytes()
    except OSError:
        return b""


def _segment(name: bytes) -> bytes:
    """Name of the segment that a file contains or locks."""
    return name.removeprefix(b"sem.").removesuffix(b"_mutex").removesuffix(b"_el")


def remove_orphans(files: Iterable[Path]) -> list[Path]:
    """Remove the given files that no other running process has mapped; return the removed ones.

    Only files of the middleware that belong to this user are removed, whatever is given. This process may still have a
    killed process's file mapped for reading; that does not keep the file.
    """
    candidates = set(files) & set(middleware_files())
    in_use = held_files(pid for pid in psutil.pids() if pid != os.getpid()) if candidates else set()
    removed = sorted(candidates - in_use)
    for file in removed:
        file.unlink(missing_ok=True)
    return removed


def unheld_files(names: Collection[str]) -> set[Path]:
    """The named files of this user that no running process has mapped."""
    files = {file for file in middleware_files() if file.name in names}
    return files - held_files(psutil.pids()) if files else set()


def abandoned_files(files: Iterable[Path]) -> set[Path]:
    """Files of processes that have ended, including processes that are not visible from here, as in a container.

    A process that makes a segment holds a lock on a file next to it, ``_el``, as long as it lives. Give no files that
    have just been made: their lock may come next.
    """
    files = set(files)
    ended = {_segment(file.name.encode()) for file in files if file.name.endswith("_el") and not _is_locked(file)}
    return {file for file in files if _segment(file.name.encode()) in ended}


def _is_locked(file: Path) -> bool:
    try:
        with file.open("rb") as opened:
            fcntl.flock(opened, fcntl.LOCK_EX | fcntl.LOCK_NB)  # closing unlocks it
    except OSError:
        return True
    return False


def middleware_files() -> list[Path]:
    """All shared-memory files of the middleware on this machine that belong to this user."""
    if not _FOLDER.is_dir():
        return []
    with os.scandir(_FOLDER) as entries:
        return [Path(entry) for entry in entries if "fastrtps" in entry.name and _is_own_file(entry)]


def _is_own_file(entry: os.DirEntry[str]) -> bool:
    try:
        return entry.is_file(follow_symlinks=False) and entry.stat(follow_symlinks=False).st_uid == os.getuid()
    except FileNotFoundError:
        return False
