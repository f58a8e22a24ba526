"""Folders that are built once and then read by many processes. In: a key and a function that fills a folder."""

import secrets
import shutil
from collections.abc import Callable
from pathlib import Path

from simbev_ros.foundation.cache.entries import discard_entry, entry_path, evict_unused, hold_entry
from simbev_ros.foundation.cache.seals import require_own, require_seal, write_seal
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.process_limits import is_shortage

_SEAL = ".sha256"


def ensure_folder(
    kind: str, name: str, version: bytes, key: bytes, build: Callable[[Path], None], cache_dir: Path
) -> Path:
    """The folder that belongs to a key, built if it is missing. No process ever sees a half-built folder.

    Args:
        kind: Name of the kind of content, in the plural; it appears in messages.
        name: Shown to users who look into the cache; it identifies nothing.
        version: Fingerprint of the code that builds the folder.
        key: All else that decides the content.
        build: Fills an empty folder.
        cache_dir: Folder of the cache.

    Raises:
        InputError: The cache cannot be written, or another user could have written the folder.
    """
    parent = cache_dir / kind
    folder = entry_path(parent, name, version, key)
    hold_entry(folder)
    if _is_there(folder):
        return folder
    work = parent / f".{name}-{secrets.token_hex(8)}"
    try:  # from here on, as an interrupt may come at any moment
        try:
            parent.mkdir(parents=True, exist_ok=True)
            work.mkdir(mode=0o700)
        except OSError as error:
            raise InputError(f"cache of {kind} {parent}: cannot be written: {error.strerror}") from error
        build(work)
        write_seal(work / _SEAL, folder.name, _content(work))
        _publish(work, folder)
    finally:
        shutil.rmtree(work, ignore_errors=True)
    hold_entry(folder)
    evict_unused(folder)
    return folder


def _is_there(folder: Path) -> bool:
    """Whether an entry is there as it was built; another one in its place is removed."""
    require_own(folder)
    if not folder.is_dir():
        return False
    try:
        require_seal(folder / _SEAL, folder.name, _content(folder))
    except (OSError, ValueError) as error:
        if is_shortage(error):
            raise
        discard_entry(folder)
        return False
    return True


def _content(folder: Path) -> list[Path]:
    """The files of an entry."""
    return [path for path in folder.iterdir() if path.name != _SEAL]


def _publish(work: Path, folder: Path) -> None:
    """Give a finished folder its name; another process may have been first, with the same content."""
    try:
        work.rename(folder)
    except OSError:
        if not folder.is_dir():
            raise
