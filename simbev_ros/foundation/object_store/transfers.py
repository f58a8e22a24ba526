"""Writes and copies objects: a file or bytes into the store, objects within it, folders out of it or away."""

from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from itertools import repeat
from pathlib import Path, PurePosixPath
from threading import Event
from typing import TYPE_CHECKING, BinaryIO

from simbev_ros.foundation.files.confined_paths import path_inside
from simbev_ros.foundation.object_store.connection import StoreError, connection
from simbev_ros.foundation.object_store.object_path import ObjectPath
from simbev_ros.foundation.object_store.writer import writer, writer_errors

if TYPE_CHECKING:
    from obstore import PutMode

PART_BYTES = 8 << 20
"""Bytes that are read at once while a file is transferred; larger objects are uploaded in parts."""
MAX_COPY_BYTES = 5 << 30
"""Largest object that S3 copies within a store; larger ones pass through this machine."""
_MAX_TRANSFERS, _MAX_PARTS_AT_ONCE = 8, 4
_MAX_PARTS = 10_000
"""Largest number of parts of an upload."""
_MAX_NAME_BYTES = 255


def put_file(source: Path, target: ObjectPath) -> None:
    """Upload a file, in parts if it is large. The object appears when the last part is there.

    After a failure nothing is left. A killed process leaves no object, but parts that cost space until a lifecycle rule
    of the bucket removes incomplete uploads.

    Raises:
        OSError: The file cannot be read.
        StoreError: The store cannot be reached, refuses access, or fails.
    """
    with source.open("rb") as stream:
        _put(stream, target, source.stat().st_size)


def put_bytes(content: bytes, target: ObjectPath, mode: "PutMode" = "overwrite") -> str:
    """Write an object whole, by default in place of an earlier one.

    Args:
        content: The object's content.
        target: The object.
        mode: ``create``: only if there is none; ``{"e_tag": …}``: only if it has this entity tag.

    Returns:
        Its entity tag.

    Raises:
        StoreConflict: There is an object already, or it has another entity tag.
        StoreError: The store cannot be reached, refuses access, or fails.
    """
    import obstore

    with writer_errors(str(target)):
        result = obstore.put(writer(target.bucket), target.key, content, mode=mode, use_multipart=False)
    return result["e_tag"] or ""


def get_bytes(source: ObjectPath) -> tuple[bytes, str]:
    """Content and entity tag of a small object, for a conditional write in its place.

    Raises:
        FileNotFoundError: There is no such object.
        StoreError: The store cannot be reached, refuses access, or fails.
    """
    return connection().read_whole(source.bucket, source.key)


def copy_object(source: ObjectPath, target: ObjectPath) -> None:
    """Copy an object within the store.

    Raises:
        FileNotFoundError: There is no such object.
        StoreError: The store cannot be reached, refuses access, or fails.
    """
    import obstore

    size_bytes = source.stat().st_size
    if size_bytes > MAX_COPY_BYTES:
        with source.open() as stream:
            _put(stream, target, size_bytes)
        return
    with writer_errors(str(target)):
        obstore.copy(writer(target.bucket), source.key, target.key)


def list_objects(folder: ObjectPath) -> dict[ObjectPath, int]:
    """Sizes in bytes of all objects in a folder and the folders in it, sorted by key; empty if there is no folder.

    Raises:
        StoreError: The store cannot be reached, refuses access, or fails.
    """
    found = connection().entries(folder.bucket, folder.key, is_recursive=True)
    sizes = {ObjectPath(folder.bucket, key): size for key, size in found if size is not None}
    return {path: sizes[path] for path in sorted(sizes) if sizes[path] or not path.key.endswith("/")}


def delete_tree(folder: ObjectPath) -> None:
    """Delete all objects in a folder; nothing happens if there are none.

    Raises:
        StoreError: The store cannot be reached, refuses access, or fails.
    """
    if not folder.key:
        raise ValueError(f"{folder}: a whole bucket is never deleted")
    delete_objects(list_objects(folder))


def delete_objects(paths: Iterable[ObjectPath]) -> None:
    """Delete objects of one bucket; those that are missing do not matter.

    Raises:
        StoreError: The store cannot be reached, refuses access, or fails.
    """
    import obstore

    paths = list(paths)
    if paths:
        with writer_errors(str(paths[0])):
            obstore.delete(writer(paths[0].bucket), [path.key for path in paths])


def nameless_objects(paths: Iterable[ObjectPath], folder: ObjectPath) -> list[ObjectPath]:
    """Objects of a folder that no file in a folder can stand for, because of their names.

    A name leads elsewhere (``..``, a slash too many, a backslash), is too long or not printable, or is below an object.
    """
    names = {path: path.key.removeprefix(f"{folder.key}/" if folder.key else "") for path in paths}
    objects = {*names.values()} - {"."}
    return [
        path
        for path, name in names.items()
        if not all(map(_is_name, name.split("/"))) or objects & {*map(str, PurePosixPath(name).parents)}
    ]


def _is_name(part: str) -> bool:
    """Whether a part of a key can be the name of a file; U+FFFD stands for bytes of a key that are not UTF-8."""
    is_text = part.isprintable() and not {"\\", "\ufffd"} & {*part}
    return is_text and part not in ("", ".", "..") and len(part.encode()) <= _MAX_NAME_BYTES


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


def _put(stream: BinaryIO, target: ObjectPath, size_bytes: int) -> None:
    """Upload a stream, or nothing if it does not have this size."""
    import obstore

    def parts() -> Iterator[bytes]:
        read_bytes = 0
        while part := stream.read(PART_BYTES):
            read_bytes += len(part)
            yield part
        if read_bytes != size_bytes:
            raise StoreError(f"{target}: not written: {read_bytes:,} of {size_bytes:,} bytes could be read for it")

    content = parts() if size_bytes > PART_BYTES else b"".join(parts())
    with writer_errors(str(target)):
        part_bytes = max(PART_BYTES, -(-size_bytes // _MAX_PARTS))
        store, limit = writer(target.bucket), _MAX_PARTS_AT_ONCE
        obstore.put(store, target.key, content, chunk_size=part_bytes, max_concurrency=limit)
