"""Syncing of files and folders to disk (fsync), so that they survive a power cut."""

import os
from collections.abc import Iterable
from pathlib import Path


def sync(*paths: Path) -> None:
    """Sync files, or folders with their entries such as new file names, to disk."""
    is_windows = os.name == "nt"
    for path in paths:
        if is_windows and path.is_dir():  # it has no descriptors of folders
            continue
        descriptor = os.open(path, os.O_RDWR if is_windows else os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def sync_names(files: Iterable[Path]) -> None:
    """Sync the names of files to disk, that is, the entries of the folders that contain them."""
    sync(*sorted({file.parent for file in files}))
