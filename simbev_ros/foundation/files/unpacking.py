"""Unpacks compressed files and NPZ data from elsewhere, which may not exceed what they declare, nor the limits."""

import bz2
import gzip
import io
import os
import warnings
import zipfile
import zlib
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import IO, BinaryIO

import numpy as np
import zstandard
from numpy.lib import format as npy

from simbev_ros.foundation.errors import InputError, LimitError
from simbev_ros.foundation.files.limits import MAX_MAP_RATIO, require_unpacked_size
from simbev_ros.foundation.types import AnyArray

_SUFFIX = ".npy"
_COMPRESSIONS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
"""Kinds of compression that numpy writes. zipfile unpacks them step by step, other kinds all at once."""


def bunzip2(data: bytes, max_bytes: int) -> bytes:
    """Decompress bzip2 data of at most ``max_bytes`` after decompression.

    Raises:
        LimitError: The data unpack to more.
        OSError, EOFError: The data are damaged.
    """
    with bz2.BZ2File(io.BytesIO(data)) as file:
        return _read_up_to(file, max_bytes)


def _read_up_to(file: gzip.GzipFile | bz2.BZ2File, max_bytes: int) -> bytes:
    unpacked = file.read(max_bytes + 1)
    if len(unpacked) > max_bytes:
        raise LimitError(f"it unpacks to more than {max_bytes >> 20} MiB, which is not allowed")
    return unpacked


def read_unpacked(path: Path, max_bytes: int) -> Iterator[bytes]:
    """Read a file in pieces; one compressed with gzip, bzip2 or zstd, whatever its name is, is unpacked meanwhile.

    Raises:
        InputError: The file cannot be read, is damaged, or has more than ``max_bytes`` when unpacked, or so much more
            than when packed that it can only be an attack.
    """
    total_bytes = 0
    try:
        with path.open("rb") as file, _unpacked(file) as stream:
            usual_bytes = max(MAX_MAP_RATIO * os.fstat(file.fileno()).st_size, _UNSUSPICIOUS_BYTES)
            while piece := stream.read(_PIECE_BYTES):
                total_bytes += len(piece)
                if total_bytes > max_bytes:
                    raise InputError(f"{path}: unpacks to more than {max_bytes >> 20} MiB; extract the part you need")
                if total_bytes > usual_bytes and stream is not file:
                    raise InputError(f"{path}: unpacks to more than {MAX_MAP_RATIO} times its size, as no map does")
                yield piece
    except (EOFError, gzip.BadGzipFile, zlib.error, zstandard.ZstdError) as error:
        raise InputError(f"{path}: is damaged and cannot be unpacked: {error}") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from None


def _unpacked(file: BinaryIO) -> IO[bytes] | gzip.GzipFile | bz2.BZ2File:
    """A stream of the unpacked content of a file; by its first bytes, it is compressed or not."""
    magic = file.read(_MAGIC_BYTES)
    file.seek(0)
    if magic.startswith(_GZIP):
        return gzip.open(file)
    if magic.startswith(_BZIP2):
        return bz2.open(file)
    if magic == _ZSTD:
        decompressor = zstandard.ZstdDecompressor(max_window_size=_MAX_WINDOW_BYTES)
        return decompressor.stream_reader(file, read_across_frames=True, closefd=False)
    return file


_PIECE_BYTES = 1 << 20
_UNSUSPICIOUS_BYTES = 16 << 20
_MAGIC_BYTES = 4
_GZIP, _BZIP2, _ZSTD = b"\x1f\x8b", b"BZh", b"\x28\xb5\x2f\xfd"
_MAX_WINDOW_BYTES = 128 << 20


class NpzReader:
    """Reads the arrays of an NPZ file by name; never a pickled object.

    Attributes:
        names: Names of the arrays that can be read.

    Raises:
        LimitError: The arrays unpack to more than ``max_unpacked_bytes`` together.
        errors.NPZ_DAMAGE: The file is damaged.
    """

    def __init__(self, stream: BinaryIO, names: Collection[str] | None = None) -> None:
        """Open a file, seekable, to read the arrays with the given names, if present; None: all."""
        self._archive = zipfile.ZipFile(stream)
        entries = {entry.filename.removesuffix(_SUFFIX): entry for entry in self._archive.infolist()}
        self._entries = {name: entry for name, entry in entries.items() if names is None or name in names}
        self.names = tuple(self._entries)
        require_unpacked_size(sum(entry.file_size for entry in self._entries.values()))

    def __getitem__(self, name: str) -> AnyArray:
        """Read an array.

        Raises:
            KeyError: There is no such array.
            errors.NPZ_DAMAGE: It is damaged, or holds Python objects.
        """
        entry = self._entries[name]
        if entry.compress_type not in _COMPRESSIONS:
            raise ValueError("it is compressed in another way than by numpy")
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # that Python 2 wrote it
            with self._archive.open(entry) as file:
                _check_header(file, entry.file_size)
            with self._archive.open(entry) as file:
                array: AnyArray = npy.read_array(file, allow_pickle=False)
        _check_texts(array)
        return array


def read_npy(data: bytes) -> AnyArray:
    """Read the content of an NPY file, which may be structured; never a pickled object.

    Raises:
        errors.NPZ_DAMAGE: It is damaged, or holds Python objects.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # that Python 2 wrote it
        _check_header(io.BytesIO(data), len(data))
        array: AnyArray = npy.read_array(io.BytesIO(data), allow_pickle=False)
    return array


def _check_header(file: IO[bytes], size_bytes: int) -> None:
    """Raise ValueError if the header of an NPY file promises more than the file holds."""
    version = npy.read_magic(file)
    if version not in _HEADERS:
        raise ValueError(f"version {version} of NPY is not supported")
    shape, _, dtype = _HEADERS[version](file)
    if dtype.hasobject:
        return  # read_array refuses it
    fields = (dtype.fields or {}).values()
    if any(kind.names or kind.subdtype or start + kind.itemsize > dtype.itemsize for kind, start, *_ in fields):
        raise ValueError("its fields are not plain values")  # sizes of fields of fields overflow in numpy
    if int(np.prod([*map(int, shape)], dtype=object)) * max(1, dtype.itemsize) > size_bytes:
        raise ValueError(f"its header says {shape} of {dtype}, but it has only {size_bytes} bytes")


def _check_texts(array: AnyArray) -> None:
    """Raise ValueError if an array has texts with numbers that are not characters, at which Python's strings fail."""
    if array.dtype.names is not None:
        raise ValueError("it is structured; such arrays are not read")
    if array.dtype.kind == "U" and array.nbytes:
        numbers = np.ascontiguousarray(array).reshape(-1).view(np.dtype("u4").newbyteorder(array.dtype.byteorder))
        if ((numbers > _MAX_CHARACTER) | (numbers >> _SURROGATE_BITS == _SURROGATES)).any():
            raise ValueError("it has texts with numbers that are not characters")


_MAX_CHARACTER = 0x10FFFF
_SURROGATE_BITS, _SURROGATES = 11, 0xD800 >> 11
_HEADERS = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}
