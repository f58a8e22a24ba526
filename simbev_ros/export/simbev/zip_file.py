"""Writes a ZIP file that contains one file, compressed by ISA-L, several times faster than Python's own module does.

Format: https://pkware.cachefly.net/webdocs/casestudies/APPNOTE.TXT, sections 4.3.7, 4.3.12 and 4.3.16.
"""

import struct

from zlib_ng import zlib_ng

from simbev_ros.recording.deflate import deflate

_ABOUT = struct.Struct("<HHHHHIIIHH")
"""Fields of a file in both headers: version, flags, method, time, date, CRC, packed size, size, lengths of its name and
of extra fields."""
_PLACE = struct.Struct("<HHHII")
"""Length of a comment, disk, internal and external attributes, position of the local header."""
_END = struct.Struct("<HHHHIIH")
"""Disk, disk of the directory, entries on it, all entries, size and position of the directory, length of a comment."""

_VERSION, _DEFLATE, _FIRST_OF_JANUARY_1980 = 20, 8, 0x21
_MAX_BYTES = (1 << 32) - 1
_ISAL_LEVEL = 2


def zip_of_one_file(name: str, content: bytes) -> bytes:
    """ZIP file with one compressed file; the same content gives the same bytes, as no time is stored.

    Raises:
        ValueError: The content has 4 GiB or more.
    """
    if len(content) > _MAX_BYTES:
        raise ValueError(f"{name} has {len(content)} bytes; at most {_MAX_BYTES} fit into a ZIP file")
    packed, raw_name = deflate(content, _ISAL_LEVEL, wbits=-15), name.encode("ascii")
    checksum, sizes = zlib_ng.crc32(content), (len(packed), len(content))
    about = _ABOUT.pack(_VERSION, 0, _DEFLATE, 0, _FIRST_OF_JANUARY_1980, checksum, *sizes, len(raw_name), 0)
    entry = b"".join([b"PK\x03\x04", about, raw_name, packed])
    directory = b"".join([b"PK\x01\x02", struct.pack("<H", _VERSION), about, _PLACE.pack(0, 0, 0, 0, 0), raw_name])
    end = b"PK\x05\x06" + _END.pack(0, 0, 1, 1, len(directory), len(entry), 0)
    return entry + directory + end
