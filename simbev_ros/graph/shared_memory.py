"""Shared-memory files of Fast DDS: which our processes hold, and removing those that a killed one left behind."""

from collections.abc import Iterable
from pathlib import Path

_FOLDER = Path("/dev/shm")


def held_files(pid: int) -> set[Path]:
    """The middleware's files in /dev/shm that a process has mapped, with the locks that belong to them."""
    try:
        lines = Path(f"/proc/{pid}/maps").read_text().splitlines()
    except OSError:
        return set()
    mapped = {Path(line.split(maxsplit=5)[5]) for line in lines if "/dev/shm/" in line and "fastrtps" in line}
    names = {path.name.removeprefix("sem.").removesuffix("_mutex").removesuffix("_el") for path in mapped}
    return {file for file in _middleware_files() if any(name in file.name for name in names)}


def remove_orphans(files: Iterable[Path]) -> list[Path]:
    """Remove those files that no living process has mapped any more; give what was removed."""
    in_use = {
        file
        for process in Path("/proc").iterdir()
        if process.name.isdecimal()
        for file in held_files(int(process.name))
    }
    removed = []
    for file in sorted(set(files) - in_use):
        if file.exists():
            file.unlink(missing_ok=True)
            removed.append(file)
    return removed


def _middleware_files() -> list[Path]:
    return [file for file in _FOLDER.iterdir() if "fastrtps" in file.name] if _FOLDER.is_dir() else []
