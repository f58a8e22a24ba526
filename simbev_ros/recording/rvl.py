"""Writes and reads depth images of 16 bits in RVL: runs of zeros, and differences in digits of three bits.

Format: A. D. Wilson, Fast Lossless Depth Image Compression, ISS 2017, https://doi.org/10.1145/3132272.3134144. The
pixels, row by row, are a series of runs: the number of zeros, the number of other values, and the differences of these
from the value before (zeros left out; the first from 0), with the sign in the lowest bit. Each number is written in
nibbles, lowest three bits first; their top bit says that more follow. Eight nibbles are a little-endian word, the first
one on top.
"""

import numpy as np

from simbev_ros.foundation.types import AnyArray, BoolArray, Int64Array, UInt8Array, UInt16Array, UInt32Array

_DIGIT_BITS, _DIGIT_MASK, _MORE = 3, 7, 8
_MAX_DIGITS = 10
"""Number of digits of the longest number: that of the pixels of an image, in 30 bits."""
_NIBBLES_PER_WORD = 8


def encode_rvl(levels: UInt16Array) -> bytes:
    """RVL stream of an image.

    Args:
        levels: (H, W) or (N,) uint16.
    """
    pixels = levels.reshape(-1)
    filled = pixels != 0
    values = pixels[filled].astype(np.int32)
    differences = np.diff(values, prepend=np.int32(0))
    signed = (differences << 1) ^ (differences >> 31)
    starts, ends = _runs(filled)
    zeros = starts - np.concatenate([[0], ends[:-1]])
    if not len(ends) or ends[-1] < len(pixels):  # zeros at the end are a run without values
        starts, ends = np.append(starts, len(pixels)), np.append(ends, len(pixels))
        zeros = np.append(zeros, len(pixels) - (ends[-2] if len(ends) > 1 else 0))
    counts = ends - starts
    before = np.cumsum(counts) - counts + 2 * np.arange(len(counts))
    numbers = np.empty(len(signed) + 2 * len(counts), np.uint32)
    is_value = np.ones(len(numbers), bool)
    is_value[before] = is_value[before + 1] = False
    numbers[before], numbers[before + 1], numbers[is_value] = zeros, counts, signed
    return _words(_nibbles(numbers))


def decode_rvl(data: bytes, pixels: int) -> UInt16Array:
    """(N,) uint16 pixels of an RVL stream.

    Args:
        data: The stream.
        pixels: Number of pixels.

    Raises:
        ValueError: It is damaged, or has another number of pixels.
    """
    numbers = _numbers(data)
    marks = np.zeros(pixels + 1, np.int8)
    is_value = np.ones(len(numbers), bool)
    at = done = 0
    while done < pixels:
        if at + 2 > len(numbers):
            raise ValueError("it has too few pixels")
        zeros, count = int(numbers[at]), int(numbers[at + 1])
        start, end = done + zeros, done + zeros + count
        if end == done or end > pixels or at + 2 + count > len(numbers):
            raise ValueError("it has a run of wrong length")
        is_value[at : at + 2] = False
        marks[start] += 1
        marks[end] -= 1
        at, done = at + 2 + count, end
    signed = numbers[:at][is_value[:at]].astype(np.int64)
    values = np.cumsum((signed >> 1) ^ -(signed & 1))
    if len(values) and not 0 < values.min() <= values.max() < 1 << 16:
        raise ValueError("it has a value beyond 16 bits")
    result = np.zeros(pixels, np.uint16)
    result[np.cumsum(marks[:-1], dtype=np.int8).view(bool)] = values
    return result


def _runs(filled: BoolArray) -> tuple[Int64Array, Int64Array]:
    """First index of each run of true values, and the index after its last one."""
    edges = np.flatnonzero(np.diff(filled.view(np.int8), prepend=np.int8(0), append=np.int8(0)))
    return edges[::2], edges[1::2]


def _nibbles(numbers: UInt32Array) -> UInt8Array:
    """Digits of all numbers, one after the other."""
    digits = np.ones(len(numbers), np.uint8)
    for bits in range(_DIGIT_BITS, _DIGIT_BITS * _MAX_DIGITS, _DIGIT_BITS):
        is_longer = numbers >= 1 << bits
        if not is_longer.any():
            break
        digits += is_longer
    ends = np.cumsum(digits, dtype=np.int64)
    nibbles = np.zeros(int(ends[-1]), np.uint8)
    positions = ends - digits
    while len(numbers):
        longer = np.flatnonzero(numbers > _DIGIT_MASK)
        nibbles[positions] = numbers.astype(np.uint8) & _DIGIT_MASK
        positions, numbers = positions[longer], numbers[longer] >> np.uint32(_DIGIT_BITS)
        nibbles[positions] |= _MORE
        positions += 1
    return nibbles


def _words(nibbles: UInt8Array) -> bytes:
    """Nibbles in words; the last word is filled up with zeros."""
    padded = np.zeros(-(-len(nibbles) // _NIBBLES_PER_WORD) * _NIBBLES_PER_WORD, np.uint8)
    padded[: len(nibbles)] = nibbles
    pairs = padded[0::2] << 4 | padded[1::2]
    return pairs.view(">u4").astype("<u4").tobytes()


def _numbers(data: bytes) -> UInt32Array:
    """All numbers of a stream, and zeros for the nibbles that pad the last word."""
    words = np.frombuffer(data, "<u4", count=len(data) // 4).astype(">u4").view(np.uint8)
    nibbles = np.empty(2 * len(words), np.uint8)
    nibbles[0::2], nibbles[1::2] = words >> 4, words & 15
    ends = np.flatnonzero(nibbles < _MORE)
    starts = np.concatenate([[0], ends[:-1] + 1]).astype(np.int64)[: len(ends)]
    digits = ends - starts
    if len(digits) and digits.max() >= _MAX_DIGITS:
        raise ValueError("it has a number beyond that of an image's pixels")
    numbers: UInt32Array = (nibbles[starts] & _DIGIT_MASK).astype(np.uint32)
    rest: AnyArray = np.flatnonzero(digits)
    place = 0
    while len(rest):
        place += 1
        numbers[rest] |= (nibbles[starts[rest] + place] & _DIGIT_MASK).astype(np.uint32) << (_DIGIT_BITS * place)
        rest = rest[digits[rest] > place]
    return numbers
