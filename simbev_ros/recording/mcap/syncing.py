"""Forcing what was written to the disk, so that it outlives a power cut."""

import os
from collections.abc import Iterable
from pathlib import Path


def sync(*paths: Path) -> None:
    """Force files' bytes, and folders' entries, such as new names, to the disk."""
    for path in paths:
        descriptor = os.open(path, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def sync_names(files: Iterable[Path]) -> None:
    """Force files' names to the disk: the entries of the folders that they are in."""
    sync(*sorted({file.parent for file in files}))
