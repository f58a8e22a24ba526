"""Paths that stay below a folder, whatever names in data or links in the folder say.

Bags, datasets and maps are passed around, so a name in them may be ``../../x``, and an entry may be a link to any file.
The folder itself may be a link: it is the user's choice.
"""

import os
from collections.abc import Iterator
from pathlib import Path

from simbev_ros.foundation.errors import InputError


def path_inside(folder: Path, name: str | Path) -> Path:
    """Path of an entry of a folder, for a relative path that is made from data; the entry need not exist.

    Raises:
        InputError: The path, or a link on it, leads out of the folder.
    """
    _require_inside(folder / name, folder)
    return folder / name


def refuse_links_out(folder: Path, entry: str) -> None:
    """Refuse symbolic links that lead out of a folder, at and below one of its entries, which need not exist.

    Raises:
        InputError: There is one.
    """
    start = folder / entry
    for link in [start] if start.is_symlink() else _links_below(start) if start.is_dir() else ():
        _require_inside(link, folder)


def _links_below(folder: Path) -> Iterator[Path]:
    with os.scandir(folder) as entries:
        for entry in entries:
            if entry.is_symlink():
                yield Path(entry)
            elif entry.is_dir():
                yield from _links_below(Path(entry))


def _require_inside(path: Path, folder: Path) -> None:
    target, root = Path(os.path.realpath(path)), Path(os.path.realpath(folder))
    if root not in target.parents:
        raise InputError(f"{path}: leads out of {folder}, to {target}; names and links must stay in their folder")
