"""Writes and copies objects: a file or bytes into the store, objects within it, folders out of it or away."""

from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from itertools import repeat
from pathlib import Path
from threading import Event
from typing import BinaryIO

from simbev_ros.foundation.files.confined_paths import path_inside
from simbev_ros.foundation.object_store.connection import StoreError, connection, store_errors
from simbev_ros.foundation.object_store.object_path import ObjectPath

PART_BYTES = 8 << 20
"""Bytes that are read at once while a file is transferred; larger objects are uploaded in parts."""
MAX_COPY_BYTES = 5 << 30
"""Largest object that S3 copies within a store; larger ones pass through this machine."""
_MAX_TRANSFERS = 8


def put_file(source: Path, target: ObjectPath) -> None:
    """Upload a file, in parts if it is large. The object appears when the last part is there.

    pyarrow cannot abort an upload. After a failure it completes the object, cut off, and this function deletes it: for
    a moment others may see it, and if the deletion fails too, it stays. So upload to keys that nobody reads, and copy
    from there. A killed process leaves no object, but parts that cost space until a lifecycle rule of the bucket
    removes incomplete uploads.

    Raises:
        OSError: The file cannot be read.
        StoreError: The store cannot be reached, refuses access, or fails.
    """
    with source.open("rb") as stream:
        _put(_parts(stream), target, source.stat().st_size)


def put_bytes(content: bytes, target: ObjectPath) -> None:
    """Write an object whole, in place of an earlier one.

    Raises:
        StoreError: The store cannot be reached, refuses access, or fails.
    """
    with store_errors(str(target)), connection().files.open_output_stream(target.location) as stream:
        stream.write(content)


def copy_object(source: ObjectPath, target: ObjectPath) -> None:
    """Copy an object within the store.

    Raises:
        FileNotFoundError: There is no such object.
        StoreError: The store cannot be reached, refuses access, or fails.
    """
    size_bytes = source.stat().st_size
    if size_bytes > MAX_COPY_BYTES:
        with source.open() as stream:
            _put(_parts(stream), target, size_bytes)
        return
    with store_errors(str(target)):
        connection(is_patient=True).files.copy_file(source.location, target.location)


def list_objects(folder: ObjectPath) -> dict[ObjectPath, int]:
    """Sizes in bytes of all objects in a folder and the folders in it, sorted by key; empty if there is no folder.

    Raises:
        StoreError: The store cannot be reached, refuses access, or fails.
    """
    from pyarrow.fs import FileSelector

    with store_errors(str(folder)):
        selector = FileSelector(folder.location, allow_not_found=True, recursive=True)
        found = connection().files.get_file_info(selector)
    sizes = {folder / info.path.removeprefix(folder.location): info.size for info in found if info.is_file}
    return dict(sorted(sizes.items()))


def delete_tree(folder: ObjectPath) -> None:
    """Delete all objects in a folder; nothing happens if there are none.

    Raises:
        StoreError: The store cannot be reached, refuses access, or fails.
    """
    if not folder.key:
        raise ValueError(f"{folder}: a whole bucket is never deleted")
    with suppress(FileNotFoundError), store_errors(str(folder)):
        connection().files.delete_dir(folder.location)


def download(sizes: Mapping[ObjectPath, int], folder: ObjectPath, target: Path) -> None:
    """Download objects, each byte once.

    Args:
        sizes: Sizes in bytes of the objects, from ``list_objects``.
        folder: The folder in the store that all of them are in.
        target: The local folder that takes its place; none of the files may exist.

    Raises:
        OSError: The files cannot be written.
        InputError: A key leads out of the folder.
        StoreError: The store cannot be reached, refuses access, or fails.
    """
    files, stop = [path_inside(target, Path(path.relative_to(folder))) for path in sizes], Event()
    with ThreadPoolExecutor(_MAX_TRANSFERS, thread_name_prefix="download") as pool:
        try:
            list(pool.map(_download, sizes, sizes.values(), files, repeat(stop)))
        except BaseException:
            stop.set()  # the other threads, which are waited for, end with their current part
            raise


def _download(source: ObjectPath, size_bytes: int, target: Path, stop: Event) -> None:
    target.parent.mkdir(parents=True, exist_ok=True)
    with source.open() as stream, target.open("xb") as file:
        while not stop.is_set() and (part := stream.read(PART_BYTES)):
            file.write(part)
        if file.tell() != size_bytes and not stop.is_set():
            raise StoreError(f"{source}: {file.tell():,} of {size_bytes:,} bytes could be read")


def _put(parts: Iterable[bytes], target: ObjectPath, size_bytes: int) -> None:
    """Upload consecutive parts. pyarrow can only complete an object, so what failed is completed and deleted."""
    with store_errors(str(target)):
        stream = connection(is_patient=True).files.open_output_stream(target.location)
    try:
        for part in parts:
            with store_errors(str(target)):
                stream.write(part)
        if stream.tell() != size_bytes:
            raise StoreError(f"{target}: not written: {stream.tell():,} of {size_bytes:,} bytes could be read for it")
        with store_errors(str(target)):
            stream.close()
    except BaseException:
        with suppress(OSError):
            stream.close()
        with suppress(OSError, StoreError), store_errors(str(target)):
            connection().files.delete_file(target.location)
        raise


def _parts(stream: BinaryIO) -> Iterator[bytes]:
    return iter(lambda: stream.read(PART_BYTES), b"")
