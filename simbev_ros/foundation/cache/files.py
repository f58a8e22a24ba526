"""Files that are written once and then read by many processes. In: a path and how to read and write it."""

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from simbev_ros.foundation.cache.entries import evict_unused, hold_entry
from simbev_ros.foundation.errors import NPZ_DAMAGE, InputError

_T = TypeVar("_T")


def read_cached(path: Path, kind: str, read: Callable[[Path], _T], write: Callable[[Path], None]) -> _T:
    """The content of a file; if the file is missing or damaged, it is written first.

    Args:
        path: The file, in the folder of an entry (``foundation.cache.entries``).
        kind: Name of the kind of content, in the plural; it appears in messages.
        read: Raises one of ``foundation.errors.NPZ_DAMAGE`` if the file is damaged.
        write: Receives a temporary path. Readers see all or nothing, and the last of several writers wins.

    Raises:
        InputError: The file cannot be written.
    """
    hold_entry(path.parent)
    if path.is_file():
        try:
            return read(path)
        except NPZ_DAMAGE:
            pass
    is_first = not path.parent.exists()
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        hold_entry(path.parent)
        with tempfile.TemporaryDirectory(prefix=f".{path.stem}-", dir=path.parent) as work:
            write(Path(work) / path.name)
            (Path(work) / path.name).replace(path)
    except OSError as error:
        raise InputError(f"cache of {kind} {path.parent}: cannot be written: {error.strerror}") from error
    if is_first:
        evict_unused(path.parent)
    return read(path)
