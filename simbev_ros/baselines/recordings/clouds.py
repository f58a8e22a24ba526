"""Reads files of points: float32 numbers (``.bin``), NumPy's arrays, and the formats PCD and PLY, as text or binary."""

import io
import re
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from simbev_ros.foundation.errors import InputError, foreign_content
from simbev_ros.foundation.files.input_file import read_small_file
from simbev_ros.foundation.files.unpacking import read_npy
from simbev_ros.foundation.types import AnyArray, Float32Array, Float64Array

_MAX_BYTES = 256 << 20
_MAX_POSITION_M = 1e4
_INTENSITY = ("intensity", "i", "reflectivity", "remission")
_PCD_KINDS = {"F": "f", "I": "i", "U": "u"}
_PLY_TYPES = {"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4"}
_PLY_TYPES |= {"float": "f4", "double": "f8", "float32": "f4", "float64": "f8"}
_PLY_TYPES |= {f"{sign}int{bits}": f"{sign or 'i'}{bits // 8}" for sign in ("", "u") for bits in (8, 16, 32)}


def read_cloud(path: Path, columns: int = 4) -> Float32Array:
    """The points of a file whose position is finite.

    Args:
        path: A file that ends as one of ``CLOUD_READERS``.
        columns: Number of float32 of each point in a ``.bin`` file: x, y, z, intensity if there are four, and others.

    Returns:
        (N, 4) x, y, z in m and intensity as it is in the file, 0 where it has none.

    Raises:
        InputError: The file is not a cloud, is damaged, or is larger than 256 MiB.
    """
    if path.suffix.lower() not in CLOUD_READERS:
        raise InputError(f"{path}: is not a cloud; files that are read end in {', '.join(CLOUD_READERS)}")
    data = read_small_file(path, _MAX_BYTES)
    with foreign_content(path), np.errstate(all="ignore"):
        points = np.asarray(CLOUD_READERS[path.suffix.lower()](data, columns), np.float32)
        known = np.isfinite(points).all(1) & (np.abs(points[:, :3]) < _MAX_POSITION_M).all(1)
        if not known.any():
            raise ValueError("it has no point with finite numbers")
    return points[known]


def read_numbers(text: bytes, max_rows: int | None = None) -> Float64Array:
    """(N, columns) numbers of lines of text, of which there is at least one. Raises ValueError if it is not such."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # that there are none
        rows = np.loadtxt(io.BytesIO(text), np.float64, max_rows=max_rows, ndmin=2)
    if not rows.size:
        raise ValueError("it has no numbers")
    return rows


def _read_bin(data: bytes, columns: int) -> AnyArray:
    if len(data) % (4 * columns):
        raise ValueError(f"its {len(data)} bytes are not points of {columns} float32 numbers each")
    return _four_columns(np.frombuffer(data, "<f4").reshape(-1, columns))


def _read_npy(data: bytes, _: int) -> AnyArray:
    array = read_npy(data)
    if array.dtype.names:
        return _named_columns(array.dtype.names, lambda name: array[name].ravel())
    if array.ndim != 2 or array.shape[1] < 3 or array.dtype.kind not in "fiu":
        raise ValueError(f"it has the shape {array.shape} of {array.dtype!s:.40}, not (N, 3 or more) of numbers")
    return _four_columns(array)


def _read_pcd(data: bytes, _: int) -> AnyArray:
    """A cloud of the Point Cloud Library."""
    head, form, body = _head_and_body(data, rb"^DATA (\w+)\r?\n")
    rows: dict[str, list[str]] = {line.split()[0]: line.split()[1:] for line in head.splitlines() if line.strip()}
    names = rows["FIELDS"]
    repeats = [int(each) for each in rows.get("COUNT", ["1"] * len(names))]
    formats = [f"<{_PCD_KINDS[kind]}{size}" for kind, size in zip(rows["TYPE"], rows["SIZE"], strict=True)]
    if form == "binary_compressed":
        raise ValueError("it is compressed; write it as binary, such as with pcl_convert_pcd_ascii_binary IN OUT 1")
    return _table_columns(names, formats, repeats, body, int(rows["POINTS"][0]), is_text=form == "ascii")


def _read_ply(data: bytes, _columns: int) -> AnyArray:
    """The vertices of a PLY file."""
    head, _, body = _head_and_body(data, rb"^(end_header)\r?\n")
    lines = [line.split() for line in head.splitlines() if line.strip()]
    form = next(line[1] for line in lines if line[0] == "format")
    first, *others = [index for index, line in enumerate(lines) if line[0] == "element"]
    if lines[first][1] != "vertex":
        raise ValueError("its first element is not vertex")
    properties = [line for line in lines[first : others[0] if others else None] if line[0] == "property"]
    order = ">" if form == "binary_big_endian" else "<"
    formats = [order + _PLY_TYPES[line[1]] for line in properties]
    names = [line[2] for line in properties]
    return _table_columns(names, formats, [1] * len(names), body, int(lines[first][2]), is_text=form == "ascii")


CLOUD_READERS: dict[str, Callable[[bytes, int], AnyArray]] = {
    ".bin": _read_bin,
    ".npy": _read_npy,
    ".pcd": _read_pcd,
    ".ply": _read_ply,
}
"""How to read a file by its ending."""


def _head_and_body(data: bytes, end: bytes) -> tuple[str, str, bytes]:
    found = re.search(end, data, re.MULTILINE)
    if found is None:
        raise ValueError("its header does not end")
    return data[: found.start()].decode("ascii"), found[1].decode("ascii"), data[found.end() :]


def _table_columns(
    names: Sequence[str], formats: Sequence[str], repeats: Sequence[int], body: bytes, count: int, *, is_text: bool
) -> AnyArray:
    """(N, 4) columns of a table of rows, each with fields of some formats, some of them with several numbers."""
    row_bytes = sum(np.dtype(kind).itemsize * n for kind, n in zip(formats, repeats, strict=True))
    if min(repeats) < 1 or not 0 < count * (1 if is_text else row_bytes) <= len(body):
        raise ValueError(f"it says that it has {count} points, but has {len(body)} bytes of them")
    if is_text:
        starts = np.cumsum([0, *repeats])
        table = read_numbers(body, count)
        return _named_columns(names, lambda name: table[:, starts[names.index(name)]])
    fields = [(str(index), kind, (n,)) for index, (kind, n) in enumerate(zip(formats, repeats, strict=True))]
    rows = np.frombuffer(body, np.dtype(fields), count)
    return _named_columns(names, lambda name: rows[str(names.index(name))][:, 0])


def _named_columns(names: Sequence[str], column: Callable[[str], AnyArray]) -> AnyArray:
    if not {"x", "y", "z"} <= {*names}:
        raise ValueError(f"it has the columns {', '.join(names)!s:.80}, not x, y and z")
    intensity = next((name for name in _INTENSITY if name in names), None)
    return _four_columns(np.stack([column(name) for name in ("x", "y", "z", *([intensity] if intensity else []))], 1))


def _four_columns(rows: AnyArray) -> AnyArray:
    return rows[:, :4] if rows.shape[1] > 3 else np.column_stack([rows, np.zeros(len(rows), rows.dtype)])
