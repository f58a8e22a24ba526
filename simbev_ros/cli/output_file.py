"""Files that users ask for on the command line: checked before the work begins."""

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.text import Text

from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.files.input_file import is_folder
from simbev_ros.foundation.files.whole_files import is_stream, require_replaceable, require_writable, write_errors

Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace existing pictures.")]


def require_place(file: Path, *, folder_is_made: bool = False) -> None:
    """Check that a file can be created in its folder, before hours are spent on its content.

    Args:
        file: The file.
        folder_is_made: Whether its folder is made if there is none.

    Raises:
        DiskError: The disk is full.
        InputError: The folder does not exist or cannot be written to, or the file is a folder, a link, a disk or a
            socket.
    """
    _require_no_url(file)
    if is_stream(file):
        return
    if not (folder_is_made or is_folder(file.absolute().parent)):
        raise InputError(f"{file}: there is no folder {file.absolute().parent}")
    if file.is_dir():
        raise InputError(f"{file}: is a folder, not a file")
    require_replaceable(file)
    if not file.exists():
        require_writable(file.parent)


def make_room(out: Path, files: list[Path], overwrite: bool, folders: Iterable[Path] = ()) -> None:
    """Make the folder for some files, and for folders that are made with them.

    Raises:
        DiskError: The disk is full.
        InputError: The folder cannot be made or written to, a file exists and must not be overwritten, or it is what
            no file replaces.
    """
    _require_no_url(out)
    require_writable(out)
    with write_errors(out):
        out.mkdir(parents=True, exist_ok=True)
    taken = [path for path in (*files, *folders) if path.exists()]
    if taken and not overwrite:
        raise InputError(f"{taken[0]}: exists already; nothing was overwritten (--overwrite replaces it)")
    for file in files:
        require_place(file)
    for folder in folders:
        require_replaceable(folder)


def _require_no_url(path: Path) -> None:
    if (scheme := path.parts[0] if path.parts else "").endswith(":"):
        raise InputError(f"{path}: must be a path on this machine, not a URL with {scheme}//")


def show_written(paths: Iterable[Path], console: Console) -> None:
    """Print the files that were written."""
    for path in paths:
        console.print(Text.assemble(("wrote", "green"), f" {path}"), soft_wrap=True)


def require_name(path: Path) -> None:
    """Check that a path ends in a name, from which other names are made.

    Raises:
        InputError: It does not, such as ``/``.
    """
    if path.name in ("", ".."):
        raise InputError(f"{path}: must end in a name")
