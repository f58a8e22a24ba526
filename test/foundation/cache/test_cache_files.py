"""Whatever bit of a cached file flips, what is read is what was written."""

import io
from pathlib import Path

import numpy as np

from simbev_ros.foundation.cache.files import read_cached
from simbev_ros.foundation.types import AnyArray

THING = np.arange(40, dtype=np.float32)


def read(path: Path) -> AnyArray:
    with path.open("rb") as stream, np.load(stream, allow_pickle=False) as arrays:
        thing: AnyArray = arrays["thing"]
    return thing


def write(path: Path) -> None:
    np.savez_compressed(path, thing=THING)


def test_a_cached_file_with_a_flipped_bit_is_written_again(tmp_path: Path) -> None:
    file = io.BytesIO()
    np.savez_compressed(file, thing=THING)
    content, path = file.getvalue(), tmp_path / "entry/thing.npz"
    path.parent.mkdir()
    for bit in range(0, 8 * len(content), 5):  # 5 has no factor in common with 8: any position within a byte
        damaged = bytearray(content)
        damaged[bit // 8] ^= 1 << bit % 8
        path.write_bytes(damaged)
        np.testing.assert_array_equal(read_cached(path, "things", read, write), THING)
