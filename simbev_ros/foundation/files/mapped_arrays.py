"""Named arrays in one file that processes map into memory: they share its pages, and read only what they use.

The format is NPZ without compression, in which the data of each array begins at a multiple of 64 bytes.
"""

import struct
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
    content = np.memmap(path, np.uint8, "r")
    return {member.filename.removesuffix(".npy"): _array(content, member.header_offset) for member in members}


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
