"""Folders of things that are built once and then read by many processes."""

import hashlib
import os
import shutil
import tempfile
from collections.abc import Callable
from functools import lru_cache
from importlib.metadata import version
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path

from simbev_ros.errors import InputError
from simbev_ros.maps.cache_ageing import entry_path, remove_unused, use

_PACKAGES = ("maps", "geometry", "config")
_MODULES = ("random.py", "types.py")
_LIBRARIES = ("eclipse-sumo", "numpy", "scipy", "shapely", "pyproj")


def default_cache_dir() -> Path:
    """``$XDG_CACHE_HOME/simbev_ros``, by default ``~/.cache/simbev_ros``."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "simbev_ros"


def folder_of(kind: str, name: str, version: bytes, key: bytes, build: Callable[[Path], None], cache_dir: Path) -> Path:
    """The folder that holds what belongs to a key; built if it is not there. Half-built ones are never seen.

    Args:
        kind: Of thing, in the plural; it appears in messages.
        name: For people who look into the cache.
        version: Of the code that builds it.
        key: All else that decides the content.
        build: Fills an empty folder.
        cache_dir: Where the cache is.

    Raises:
        InputError: The cache cannot be written.
    """
    parent = cache_dir / kind
    folder = entry_path(parent, name, version, key)
    use(folder)
    if folder.is_dir():
        return folder
    try:
        parent.mkdir(parents=True, exist_ok=True)
        work = Path(tempfile.mkdtemp(prefix=f".{name}-", dir=parent))
    except OSError as error:
        raise InputError(f"cache of {kind} {parent}: cannot be written: {error.strerror}") from error
    try:
        build(work)
        _publish(work, folder)
    finally:
        shutil.rmtree(work, ignore_errors=True)
    use(folder)
    remove_unused(folder)
    return folder


@lru_cache(maxsize=1)
def code_version() -> bytes:
    """Hash of the sources, tables and libraries that decide what a map is like."""
    content = hashlib.sha256("\n".join(map(version, _LIBRARIES)).encode())
    package = files("simbev_ros")
    for entry in (*map(package.joinpath, _PACKAGES), *map(package.joinpath, _MODULES)):
        _add(content, entry)
    return content.digest()


def _add(content: "hashlib._Hash", entry: Traversable) -> None:
    """Add a file, or all sources and tables below a folder."""
    if entry.is_dir():
        for child in sorted(entry.iterdir(), key=lambda child: child.name):
            _add(content, child)
    elif entry.name.endswith((".py", ".yaml")):
        content.update(entry.name.encode() + entry.read_bytes())


def _publish(work: Path, folder: Path) -> None:
    """Give a finished folder its name; another process may have been first, with the same content."""
    try:
        work.rename(folder)
    except OSError:
        if not folder.is_dir():
            raise
