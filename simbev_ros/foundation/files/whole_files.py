"""Writes files whole: a file gets its name only when its content is complete and on the disk.

For all files that other processes may read while they are replaced, or whose writer may be killed: plans, indexes,
records of exports, pictures. Content enters; one file leaves. A killed writer leaves ``NAME.part`` behind, which the
next writer of the same file removes.
"""

import os
import shutil
import stat
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from simbev_ros.foundation.errors import DISK_FULL, DiskError, InputError
from simbev_ros.foundation.files.syncing import sync, sync_names
from simbev_ros.foundation.object_store.object_path import AnyPath, ObjectPath
from simbev_ros.foundation.object_store.transfers import put_bytes

_UNFINISHED_SUFFIX = ".part"


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Lend a temporary path to write a file to; afterwards the file is synced to the disk and renamed.

    If the block raises, the temporary file is removed and an earlier file at ``path`` stays as it is. A character
    device or a pipe, such as ``/dev/stdout``, stays too and is written to.

    Args:
        path: Final path of the file; its folder is made if necessary.

    Yields:
        Path for the content, in the same folder unless that is a device's.

    Raises:
        InputError: There is a link, a disk or a socket at ``path``.
        OSError: The file cannot be written.
    """
    if is_stream(path):
        with tempfile.TemporaryDirectory(prefix="simbev_ros-") as folder:
            yield (content := Path(folder, path.name))
            # Without a reader, opening a pipe fails instead of waiting for one.
            with content.open("rb") as source, os.fdopen(os.open(path, os.O_WRONLY | os.O_NONBLOCK), "wb") as target:
                os.set_blocking(target.fileno(), True)
                shutil.copyfileobj(source, target)
        return
    require_replaceable(path)
    unfinished = path.with_name(path.name + _UNFINISHED_SUFFIX)
    has_new_folder = not path.parent.exists()
    path.parent.mkdir(parents=True, exist_ok=True)
    unfinished.unlink(missing_ok=True)  # in a stranger's dataset it may be a link to any file
    try:
        yield unfinished
        sync(unfinished)
        unfinished.replace(path)
    except BaseException:
        unfinished.unlink(missing_ok=True)
        raise
    sync_names([path, path.parent] if has_new_folder else [path])


def is_stream(path: Path) -> bool:
    """Whether there is a character device or a pipe, also behind a link, which is written to and never replaced."""
    try:
        mode = path.stat().st_mode
    except OSError:
        return False
    return stat.S_ISCHR(mode) or stat.S_ISFIFO(mode)


def require_replaceable(path: Path) -> None:
    """Check that nothing but a regular file is lost if a file is written at this path.

    Raises:
        InputError: There is a link, a disk or a socket.
    """
    if path.is_symlink():
        raise InputError(f"{path}: is a link to {path.readlink()}; name the file itself")
    if path.exists() and not (path.is_file() or path.is_dir()):
        raise InputError(f"{path}: is a disk or a socket, not a file")


def write_whole(path: AnyPath, content: bytes | Iterable[bytes]) -> None:
    """Write a file or an object whole, from bytes or from pieces that are produced one after the other.

    Args:
        path: The file; its folder is made if necessary.
        content: Content of the file, or its consecutive pieces.

    Raises:
        OSError: The file cannot be written.
        StoreError: The object cannot be written.
    """
    if isinstance(path, ObjectPath):
        put_bytes(content if isinstance(content, bytes) else b"".join(content), path)
        return
    with whole_file(path) as unfinished, unfinished.open("wb") as file:
        file.writelines([content] if isinstance(content, bytes) else content)


def require_writable(folder: Path) -> None:
    """Check that files can be written into a folder, or that it can be made, before time is spent on their content.

    Nothing stays on the disk.

    Raises:
        DiskError: The disk is full.
        InputError: It cannot be written to for another reason.
    """
    try:
        with tempfile.TemporaryFile(dir=nearest_existing(folder.absolute())):
            pass
    except OSError as error:
        if error.errno in DISK_FULL:
            raise DiskError(f"{folder}: {DISK_FULL[error.errno]}") from None
        raise InputError(f"{folder}: cannot be written to: {error.strerror}") from None


def nearest_existing(folder: Path) -> Path:
    """The path, or the nearest one above it at which there is something."""
    for path in (folder, *folder.parents):
        with suppress(FileNotFoundError, NotADirectoryError):
            path.lstat()
            return path
    raise FileNotFoundError(folder)


@contextmanager
def write_errors(path: AnyPath) -> Iterator[None]:
    """Turn errors of the operating system within a block into errors for the user.

    Args:
        path: Path that the message names if the error names none.

    Raises:
        DiskError: The disk is full.
        InputError: A file cannot be written for another reason.
    """
    try:
        yield
    except OSError as error:
        file = str(error.filename or path).removesuffix(_UNFINISHED_SUFFIX)
        if error.errno in DISK_FULL:
            raise DiskError(f"{file}: {DISK_FULL[error.errno]}") from None
        raise InputError(f"{file}: cannot be written: {error.strerror or error}") from None
