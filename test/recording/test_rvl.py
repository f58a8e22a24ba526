"""RVL streams are those of Wilson's paper, which a slow reader and writer of its C code's logic here define."""

from collections.abc import Iterator

import numpy as np
import pytest

from simbev_ros.foundation.types import UInt16Array
from simbev_ros.recording.rvl import decode_rvl, encode_rvl


def word(value: int) -> bytes:
    """Eight nibbles, the first one on top."""
    return value.to_bytes(4, "little")


def nibbles_of(data: bytes) -> Iterator[int]:
    """Nibbles in the order in which the paper's decoder takes them: words of 32 bits, the highest nibble first."""
    for place in range(0, len(data), 4):
        value = int.from_bytes(data[place : place + 4], "little")
        for shift in range(28, -1, -4):
            yield value >> shift & 15


def read_slowly(data: bytes, count: int) -> list[int]:
    """Pixels of a stream, one by one."""
    nibbles = nibbles_of(data)

    def number() -> int:
        value = shift = 0
        while True:
            nibble = next(nibbles)
            value |= (nibble & 7) << shift
            shift += 3
            if nibble < 8:
                return value

    pixels: list[int] = []
    previous = 0
    while len(pixels) < count:
        pixels += [0] * number()
        for _ in range(number()):
            signed = number()
            previous += -(signed + 1) // 2 if signed % 2 else signed // 2
            pixels.append(previous)
    return pixels


def write_slowly(pixels: list[int]) -> bytes:
    """Stream of pixels, one by one."""
    nibbles: list[int] = []

    def add(value: int) -> None:
        while value > 7:
            nibbles.append(value & 7 | 8)
            value >>= 3
        nibbles.append(value)

    place = previous = 0
    while place < len(pixels):
        start = place
        while place < len(pixels) and pixels[place] == 0:
            place += 1
        add(place - start)
        start = place
        while place < len(pixels) and pixels[place] != 0:
            place += 1
        add(place - start)
        for value in pixels[start:place]:
            add(2 * (value - previous) if value >= previous else 2 * (previous - value) - 1)
            previous = value
    nibbles += [0] * (-len(nibbles) % 8)
    hexadecimal = "".join(f"{nibble:x}" for nibble in nibbles)
    return b"".join(word(int(hexadecimal[each : each + 8], 16)) for each in range(0, len(nibbles), 8))


def images() -> Iterator[UInt16Array]:
    """Images of all kinds: few and many zeros, small and large steps, zeros and values at both ends."""
    rng = np.random.default_rng(7)
    for zeros in (0.0, 0.1, 0.5, 0.97):
        for limit in (2, 9, 500, 65536):
            for size in (1, 2, 7, 8, 9, 400):
                yield np.where(rng.random(size) < zeros, 0, rng.integers(1, limit, size)).astype(np.uint16)
    for pixels in ([0], [0, 0, 0], [5], [0, 5], [5, 0], [65535, 1, 65535], [0, 0, 3, 0, 4, 0, 0]):
        yield np.array(pixels, np.uint16)
    yield np.zeros(70_000, np.uint16)


def test_streams_are_byte_by_byte_those_of_the_paper() -> None:
    for pixels in images():
        assert encode_rvl(pixels) == write_slowly(pixels.tolist())


def test_a_reader_of_the_papers_logic_finds_every_pixel() -> None:
    for pixels in images():
        assert read_slowly(encode_rvl(pixels), len(pixels)) == pixels.tolist()


def test_streams_of_the_papers_logic_are_read() -> None:
    for pixels in images():
        assert np.array_equal(decode_rvl(write_slowly(pixels.tolist()), len(pixels)), pixels)


def test_a_stream_worked_out_by_hand() -> None:
    """Two zeros, three values 1 3 2, one zero: 2, 3, +1 +2 -1 as 2 4 1, then a run of 1 zero and no values."""
    stream = word(0x23241100)  # nibbles 2 3 2 4 1 1 0, and one to fill up the word
    image = np.array([[0, 0, 1], [3, 2, 0]], np.uint16)
    assert encode_rvl(image) == stream
    assert decode_rvl(stream, 6).tolist() == image.ravel().tolist()


@pytest.mark.parametrize(
    ("stream", "pixels", "problem"),
    [
        (b"", 4, "it has too few pixels"),
        (write_slowly([1, 2, 3]), 30, "it has (too few pixels|a run of wrong length)"),
        (write_slowly([1, 2, 3]), 2, "it has a run of wrong length"),
        (bytes(8), 4, "it has a run of wrong length"),
        (2 * word(0xFFFFFFFF), 4, "it has too few pixels"),
        (word(0xFFFFFFFF) + word(0xFFFFFF0F), 4, "it has a number beyond"),
        (word(0x01100000), 1, "it has a value beyond 16 bits"),
    ],
)
def test_a_damaged_stream_is_refused(stream: bytes, pixels: int, problem: str) -> None:
    with pytest.raises(ValueError, match=problem):
        decode_rvl(stream, pixels)
