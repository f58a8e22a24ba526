"""Files that users ask for on the command line: checked before the work begins, written after it."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from simbev_ros.errors import InputError


def require_place(file: Path) -> None:
    """Check that a file can be created in its folder, before hours are spent on its content.

    Raises:
        InputError: The folder does not exist, or the file is a folder.
    """
    if not file.absolute().parent.is_dir():
        raise InputError(f"{file}: there is no folder {file.absolute().parent}")
    if file.is_dir():
        raise InputError(f"{file}: is a folder, not a file")


def make_room(out: Path, targets: list[Path], overwrite: bool) -> None:
    """Make the folder for some files.

    Raises:
        InputError: The folder cannot be made, or a file exists and must not be overwritten.
    """
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"--out {out}: cannot be created: {error.strerror}") from None
    taken = [path for path in targets if path.exists()]
    if taken and not overwrite:
        raise InputError(f"{taken[0]}: exists already; nothing was overwritten (--overwrite replaces it)")


@contextmanager
def writing(file: Path) -> Iterator[None]:
    """Turn errors of the operating system while a file is written into ``InputError``."""
    try:
        yield
    except OSError as error:
        raise InputError(f"{file}: cannot be written: {error.strerror}") from None
