"""Compresses by ISA-L into zlib's format or raw DEFLATE, the same content always into the same bytes.

ISA-L's levels 1 and 2 do not guarantee that. When they begin a stream on x86, they compute the hash of the bytes at
position 2 from a register that still holds the address of the stream's state (``.write_first_byte`` in
``igzip_icf_body_h1_gr_bt.asm``, up to version 2.32.1 at least). One of 8192 hashes, which depends on the position of
the thread's stack, then refers to position 2 instead of 0. Once in thousands of images that changes the distance of a
match. It has no effect if the first call has input for the first byte only: the next call computes the hashes
again.
"""

from isal import isal_zlib

_LOOK_AHEAD = 288
"""Number of bytes at the end of its input that ISA-L keeps for the next call: ISAL_LOOK_AHEAD in igzip_lib.h."""
_FIRST_CALL = _LOOK_AHEAD + 1
_SHORT_LEVEL = 0
"""Level for contents that are shorter; it begins a stream as it should."""


def deflate(content: bytes | memoryview, level: int, wbits: int = isal_zlib.MAX_WBITS) -> bytes:
    """Compress with ISA-L.

    Args:
        content: Contiguous bytes.
        level: Level of ISA-L, 0 to 3.
        wbits: Format, as in zlib: 15 is zlib's, -15 raw DEFLATE.
    """
    view = memoryview(content).cast("B")
    if len(view) < _FIRST_CALL:
        return isal_zlib.compress(view, _SHORT_LEVEL, wbits)
    stream = isal_zlib.compressobj(level, isal_zlib.DEFLATED, wbits)
    return b"".join([stream.compress(view[:_FIRST_CALL]), stream.compress(view[_FIRST_CALL:]), stream.flush()])
