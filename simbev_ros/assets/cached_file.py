"""Files that are written once and then read by many processes; a cached thing has the same bytes as one built anew."""

import hashlib
import tempfile
from collections.abc import Callable, Iterator
from functools import lru_cache
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import TypeVar

import numpy as np

from simbev_ros.errors import NPZ_DAMAGE, InputError
from simbev_ros.maps.cache_ageing import remove_unused, use

_T = TypeVar("_T")


def cached(path: Path, kind: str, read: Callable[[Path], _T], write: Callable[[Path], None]) -> _T:
    """What a file holds; if it is not there or damaged, it is written first.

    Args:
        path: The file, in the folder of an entry (``maps.cache_ageing``).
        kind: Of thing, in the plural, for messages.
        read: Raises one of ``errors.NPZ_DAMAGE`` if the file is damaged.
        write: Is given another path. Readers see all or nothing, and of several writers the last wins.

    Raises:
        InputError: The file cannot be written.
    """
    use(path.parent)
    if path.is_file():
        try:
            return read(path)
        except NPZ_DAMAGE:
            pass
    is_first = not path.parent.exists()
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        use(path.parent)
        with tempfile.TemporaryDirectory(prefix=f".{path.stem}-", dir=path.parent) as work:
            write(Path(work) / path.name)
            (Path(work) / path.name).replace(path)
    except OSError as error:
        raise InputError(f"cache of {kind} {path.parent}: cannot be written: {error.strerror}") from error
    if is_first:
        remove_unused(path.parent)
    return read(path)


@lru_cache(maxsize=1)
def assets_version() -> bytes:
    """Hash of the sources and tables of this package, which decide what its things are like."""
    content = hashlib.sha256(np.__version__.encode())
    for name, source in _sources(files("simbev_ros.assets")):
        content.update(name.encode() + source)
    return content.digest()


def _sources(folder: Traversable) -> Iterator[tuple[str, bytes]]:
    for entry in sorted(folder.iterdir(), key=lambda entry: entry.name):
        if entry.is_dir():
            yield from _sources(entry)
        elif entry.name.endswith((".py", ".yaml")):
            yield entry.name, entry.read_bytes()
