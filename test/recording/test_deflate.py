"""Compressed bytes depend on nothing but the content, and other implementations read them."""

import threading
import zlib

import numpy as np
import pytest

from simbev_ros.recording.deflate import deflate

RNG = np.random.default_rng(8)
WINDOW = 32768
"""A match is at most this far away; hashes refer to positions modulo this."""
STACKS = 100


def sensitive_content() -> memoryview:
    """Content whose bytes by ISA-L alone differ for one in thirty of the hashes that may refer to position 2.

    The string at position 2 of each window is not entered in the hash table, as a match of zeros ends in it, and
    occurs once more. There it has a match only if its hash refers to position 2.
    """
    windows = np.zeros((300, WINDOW), np.uint8)
    strings = RNG.integers(1, 256, (len(windows), 4), np.uint8)
    windows[:, 4:8] = windows[:, 504:508] = strings
    windows[:, 500:502] = RNG.integers(1, 256, (len(windows), 2), np.uint8)
    return windows.data


@pytest.mark.parametrize("level", [1, 2])
def test_bytes_do_not_depend_on_the_address_of_the_stack(level: int) -> None:
    content, found, all_there = sensitive_content(), set(), threading.Barrier(STACKS)

    def work() -> None:
        found.add(deflate(content, level))
        all_there.wait()  # so that no two threads have the same stack

    threads = [threading.Thread(target=work) for _ in range(STACKS)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(found) == 1


@pytest.mark.parametrize("level", range(4))
@pytest.mark.parametrize("size", [0, 1, 17, 288, 289, 290, 600, 100_000])
def test_zlib_reads_what_is_compressed(size: int, level: int) -> None:
    content = RNG.integers(0, 4, size, np.uint8).tobytes()
    assert zlib.decompress(deflate(content, level)) == content
    assert zlib.decompress(deflate(content, level, wbits=-15), wbits=-15) == content


def test_compressed_contents_are_small() -> None:
    assert len(deflate(sensitive_content(), 1)) < 0.01 * 300 * WINDOW
