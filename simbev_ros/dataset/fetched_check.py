"""Verification of bags in object stores: each is downloaded to a temporary folder, so that every byte is read once."""

import tempfile
from collections.abc import Iterator
from pathlib import Path

from simbev_ros.dataset.check import row_faults
from simbev_ros.dataset.index_row import Row
from simbev_ros.foundation.object_store.object_path import ObjectPath
from simbev_ros.foundation.object_store.transfers import download, list_objects, nameless_objects
from simbev_ros.recording.layout import METADATA_FILE, numbered_files
from simbev_ros.recording.verify import Fault, verify_bag

_MAX_NAME_CHARS = 100


def verify_fetched_bag(bag: ObjectPath, row: Row | None = None, temporary: Path | None = None) -> list[Fault]:
    """Verify a bag as ``verify_bag`` does, and compare it with its row of the index.

    Args:
        bag: The bag's folder, or its MCAP file.
        row: The row of the index that describes the bag; None for a bag that belongs to no dataset.
        temporary: Folder for temporary files, with space for the bag; None: that of the system, which ``TMPDIR`` moves.

    Raises:
        InputError: The store cannot be reached or refuses access, or has neither the bag nor its row.
    """
    if row is None:
        numbered_files(bag)
    is_file = bag.suffix == ".mcap"
    with tempfile.TemporaryDirectory(prefix="simbev_verify_", dir=temporary) as folder:
        local = Path(folder, row["path"]) if row else Path(folder, bag.parent.name if is_file else bag.name)
        sizes, source = (_files_of_mcap(bag), bag.parent) if is_file else (list_objects(bag), bag)
        left_out = nameless_objects(sizes, source)
        download({path: sizes[path] for path in sizes.keys() - left_out}, source, local)
        found = [*_left_out(left_out, source), *_faults(local / bag.name if is_file else local, Path(folder), row)]
        return [
            Fault(bag.parent if is_file else bag, place, text.replace(str(local), str(bag))) for place, text in found
        ]


def _files_of_mcap(file: ObjectPath) -> dict[ObjectPath, int]:
    """Sizes of an MCAP file and of the description next to it."""
    described = file.with_name(METADATA_FILE)
    return {path: path.stat().st_size for path in (file, *([described] if described.is_file() else []))}


def _left_out(paths: list[ObjectPath], folder: ObjectPath) -> Iterator[tuple[str, str]]:
    """Yield place and problem of the objects that are not downloaded, as one fault."""
    if paths:
        more = f", nor can those of {len(paths) - 1:,} more objects" if len(paths) > 1 else ""
        name = paths[0].key.removeprefix(f"{folder.key}/")
        yield f"{name!r:.{_MAX_NAME_CHARS}}", f"this cannot be the name of a file in the folder{more}; it is not read"


def _faults(bag: Path, dataset: Path, row: Row | None) -> Iterator[tuple[str, str]]:
    """Yield place and problem of each fault of a downloaded bag."""
    if row is None or any(bag.glob("*.mcap")):
        yield from ((fault.place, fault.problem) for fault in verify_bag(bag))
    yield from row_faults(dataset, row) if row else ()
