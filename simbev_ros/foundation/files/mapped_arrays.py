"""Named arrays in one file that processes map into memory: they share its pages, and read only what they use.

The format is NPZ without compression, in which the data of each array begins at a multiple of 64 bytes.
"""

import ctypes
import mmap
import os
import struct
import weakref
import zipfile
from collections.abc import Mapping
from io import BytesIO
from pathlib import Path

import numpy as np

from simbev_ros.foundation.types import AnyArray

_ALIGNMENT_BYTES = 64
_LOCAL_HEADER = struct.Struct("<26xHH")
"""The header before a member of a ZIP file; it ends with the lengths of the name and the extra field that follow."""
_PADDING_ID = 0xD935
"""Type of an extra field that aligns a member, as in Android's packages."""
_MAX_ARRAY_HEADER_BYTES = 1 << 16
_LIBRARY = ctypes.CDLL(None, use_errno=True)
_LIBRARY.mmap.restype = ctypes.c_void_p
_LIBRARY.mmap.argtypes = ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int, ctypes.c_int, ctypes.c_int, ctypes.c_long
_LIBRARY.munmap.argtypes = ctypes.c_void_p, ctypes.c_size_t


def write_arrays(path: Path, arrays: Mapping[str, AnyArray]) -> None:
    """Write arrays by name."""
    with zipfile.ZipFile(path, "w") as archive:
        for name, array in arrays.items():
            member = zipfile.ZipInfo(f"{name}.npy")
            content = BytesIO()
            np.lib.format.write_array(content, np.asanyarray(array), allow_pickle=False)
            head_bytes = archive.start_dir + _LOCAL_HEADER.size + len(member.filename.encode()) + 4
            padding = -head_bytes % _ALIGNMENT_BYTES
            member.extra = struct.pack("<HH", _PADDING_ID, padding) + bytes(padding)
            archive.writestr(member, content.getbuffer())


def map_arrays(path: Path) -> dict[str, AnyArray]:
    """Map the arrays of a file that ``write_arrays`` wrote, read-only; the file may be removed meanwhile.

    Raises:
        One of ``foundation.errors.NPZ_DAMAGE``: The file is damaged.
    """
    with zipfile.ZipFile(path) as archive:
        members = archive.infolist()
    content = _map(path)
    return {member.filename.removesuffix(".npy"): _array(content, member.header_offset) for member in members}


def _map(path: Path) -> AnyArray:
    """The bytes of a file, read-only; Python's own maps each hold a descriptor, of which a town would need too many."""
    with path.open("rb") as stream:
        size = os.fstat(stream.fileno()).st_size
        address = _LIBRARY.mmap(None, size, mmap.PROT_READ, mmap.MAP_SHARED, stream.fileno(), 0)
    if address in (None, ctypes.c_void_p(-1).value):
        raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()), str(path))
    memory = (ctypes.c_uint8 * size).from_address(address)
    weakref.finalize(memory, _LIBRARY.munmap, address, size).atexit = False
    content: AnyArray = np.frombuffer(memoryview(memory), np.uint8)
    content.flags.writeable = False
    return content


def _array(content: AnyArray, offset: int) -> AnyArray:
    """The array in the member of a ZIP file that begins at an offset."""
    begin = offset + _LOCAL_HEADER.size
    begin += sum(_LOCAL_HEADER.unpack(content[offset:begin].tobytes()))
    head = BytesIO(content[begin : begin + _MAX_ARRAY_HEADER_BYTES].tobytes())
    np.lib.format.read_magic(head)
    shape, is_fortran, dtype = np.lib.format.read_array_header_1_0(head)
    if dtype.hasobject:  # their addresses would be believed
        raise ValueError("Python objects")
    return np.ndarray(shape, dtype, content, begin + head.tell(), order="F" if is_fortran else "C")
