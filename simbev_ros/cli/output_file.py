"""Files that people ask for on the command line: refused before the work, written after it."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from simbev_ros.errors import InputError


def require_place(file: Path) -> None:
    """See that there is a folder for a file, before hours are spent on what goes into it.

    Raises:
        InputError: There is none, or the file is a folder.
    """
    if not file.absolute().parent.is_dir():
        raise InputError(f"{file}: there is no folder {file.absolute().parent}")
    if file.is_dir():
        raise InputError(f"{file}: is a folder, not a file")


@contextmanager
def writing(file: Path) -> Iterator[None]:
    """Turn what the operating system refuses into InputError."""
    try:
        yield
    except OSError as error:
        raise InputError(f"{file}: cannot be written: {error.strerror}") from None
