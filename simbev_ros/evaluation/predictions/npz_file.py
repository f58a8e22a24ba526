"""Reads NPZ files from other software safely: arrays by name, never a pickled object."""

from collections.abc import Collection
from pathlib import Path

from simbev_ros.foundation.errors import NPZ_DAMAGE, InputError
from simbev_ros.foundation.files.unpacking import NpzReader
from simbev_ros.foundation.types import AnyArray


def read_npz(path: Path, names: Collection[str] | None = None) -> dict[str, AnyArray]:
    """Read the arrays of an NPZ file, by name.

    Args:
        path: The file.
        names: Names of the arrays to read if present; None: all.

    Raises:
        InputError: The file cannot be read, is not NPZ, or is damaged; an array holds Python objects; the arrays
            exceed ``limits.max_unpacked_bytes``.
    """
    name = ""
    try:
        with path.open("rb") as stream:
            file, arrays = NpzReader(stream, names), {}
            for name in file.names:
                arrays[name] = file[name]
            return arrays
    except NPZ_DAMAGE as error:
        prefix = f"{name}: " if name else ""
        raise InputError(f"{path}: {prefix}cannot be read as NPZ: {_reason(error)}") from None


def _reason(error: BaseException) -> str:
    """Reason in terms of the person who wrote the file."""
    if "Object arrays" in str(error):
        return "it holds Python objects; texts must be arrays of a text type, such as np.array([...], str)"
    return getattr(error, "strerror", None) or str(error) or type(error).__name__
