"""Finds the shared-memory files of Fast DDS that a process holds, and removes those that killed processes left."""

import os
from collections.abc import Iterable
from pathlib import Path

import psutil

_FOLDER = Path("/dev/shm")


def held_files(pid: int) -> set[Path]:
    """The middleware's files in /dev/shm that a process has mapped, with the lock files that belong to them.

    It reads /proc/PID/maps, because psutil's ``memory_maps`` also counts the pages of every mapping, which is slow.
    """
    try:
        lines = Path(f"/proc/{pid}/maps").read_text().splitlines()
    except OSError:
        return set()
    mapped = {Path(line.split(maxsplit=5)[5]) for line in lines if "/dev/shm/" in line and "fastrtps" in line}
    names = {path.name.removeprefix("sem.").removesuffix("_mutex").removesuffix("_el") for path in mapped}
    return {file for file in middleware_files() if any(name in file.name for name in names)}


def remove_orphans(files: Iterable[Path]) -> list[Path]:
    """Remove the given files that no other running process has mapped; return the removed ones.

    Only files of the middleware that belong to this user are removed, whatever is given. This process may still have a
    killed process's file mapped for reading; that does not keep the file.
    """
    candidates = set(files) & set(middleware_files())
    in_use = {file for pid in psutil.pids() if pid != os.getpid() for file in held_files(pid)} if candidates else set()
    removed = sorted(candidates - in_use)
    for file in removed:
        file.unlink(missing_ok=True)
    return removed


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
