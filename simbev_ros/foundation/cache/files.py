"""Files that are written once and then read by many processes. In: a path and how to read and write it."""

import fcntl
import os
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, TypeVar

from simbev_ros.foundation.cache.entries import evict_unused, hold_entry
from simbev_ros.foundation.cache.seals import require_own, require_seal, write_seal
from simbev_ros.foundation.errors import NPZ_DAMAGE, InputError
from simbev_ros.foundation.files.lock_file import open_lock_file
from simbev_ros.foundation.process_limits import is_shortage

_T = TypeVar("_T")


def read_cached(path: Path, kind: str, read: Callable[[Path], _T], write: Callable[[Path], None]) -> _T:
    """The content of a file; if the file is missing or damaged, it is written first, by one process for all.

    Args:
        path: The file, in the folder of an entry (``foundation.cache.entries``).
        kind: Name of the kind of content, in the plural; it appears in messages.
        read: Raises one of ``foundation.errors.NPZ_DAMAGE`` if the file is damaged.
        write: Receives a temporary path. Readers see all or nothing.

    Raises:
        InputError: The file cannot be written, or another user could have written it.
    """
    hold_entry(path.parent)
    require_own(path.parent)
    with _SuppressedDamage():
        return _read(path, read)
    is_first = not path.parent.exists()
    with writing_alone(path.parent / f".{path.stem}.lock", kind):
        with _SuppressedDamage():
            return _read(path, read)  # another process has written it meanwhile
        _write(path, kind, write)
    if is_first:
        evict_unused(path.parent)
    return read(path)


@contextmanager
def writing_alone(lock: Path, kind: str) -> Iterator[None]:
    """Context in which one process of this user is at a time, to write what the others then find.

    Args:
        lock: File that is locked, in a folder of the cache; it is there only during the context.
        kind: As for ``read_cached``.

    Raises:
        InputError: The lock file cannot be made.
    """
    try:
        lock.parent.mkdir(parents=True, exist_ok=True)
        descriptor = open_lock_file(lock)
    except OSError as error:
        raise InputError(f"cache of {kind} {lock.parent}: cannot be written: {error.strerror}") from error
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield
    finally:
        lock.unlink(missing_ok=True)
        os.close(descriptor)


class _SuppressedDamage(suppress):
    """Suppresses errors that a damaged file causes, but not those of a process that has reached its limits."""

    def __init__(self) -> None:
        super().__init__(*NPZ_DAMAGE)

    def __exit__(self, kind: Any, error: BaseException | None, trace: Any) -> bool:
        return (error is None or not is_shortage(error)) and super().__exit__(kind, error, trace)


def _read(path: Path, read: Callable[[Path], _T]) -> _T:
    require_seal(_seal(path), path.parent.name, [path])
    return read(path)


def _seal(path: Path) -> Path:
    return path.with_name(f".{path.name}.sha256")


def _write(path: Path, kind: str, write: Callable[[Path], None]) -> None:
    try:
        hold_entry(path.parent)
        with tempfile.TemporaryDirectory(prefix=f".{path.stem}-", dir=path.parent) as work:
            write(Path(work) / path.name)
            write_seal(Path(work) / _seal(path).name, path.parent.name, [Path(work) / path.name])
            (Path(work) / _seal(path).name).replace(_seal(path))
            (Path(work) / path.name).replace(path)
    except OSError as error:
        file = "" if error.filename is None else f"{error.filename}: "  # of the cache, or one that is read to write it
        raise InputError(f"cache of {kind} {path.parent}: cannot be written: {file}{error.strerror}") from error
