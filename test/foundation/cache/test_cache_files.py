"""A cached file is written once for all, and whatever bit of it flips, what is read is what was written."""

import errno
import io
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Event

import numpy as np
import pytest

from simbev_ros.foundation.cache import seals
from simbev_ros.foundation.cache.files import read_cached
from simbev_ros.foundation.cache.folders import ensure_folder
from simbev_ros.foundation.errors import InputError
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


def test_a_file_that_many_miss_at_once_is_written_once(tmp_path: Path) -> None:
    path, is_read, writes = tmp_path / "entry/thing.npz", Event(), []

    def write_slowly(target: Path) -> None:
        writes.append(target)
        assert not is_read.wait(0.2), "nobody reads what is not there yet"
        write(target)

    def read_it(_: int) -> None:
        np.testing.assert_array_equal(read_cached(path, "things", read, write_slowly), THING)
        is_read.set()

    with ThreadPoolExecutor(4) as threads:
        list(threads.map(read_it, range(4)))
    assert len(writes) == 1
    assert {file.name for file in path.parent.iterdir()} == {"thing.npz", ".thing.npz.sha256"}


def test_what_a_process_cannot_open_or_hold_is_not_damage(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def run_out(*_: object) -> str:
        raise OSError(errno.EMFILE, "Too many open files")

    def never(_: Path) -> None:
        raise AssertionError("it is written again")

    path = tmp_path / "entry/thing.npz"
    path.parent.mkdir()
    np.testing.assert_array_equal(read_cached(path, "things", read, write), THING)
    folder = ensure_folder("things", "thing", b"1", b"", lambda made: write(made / "thing.npz"), tmp_path)
    with pytest.raises(OSError, match=r"Too many open files"):
        read_cached(path, "things", run_out, never)
    monkeypatch.setattr(seals, "_checked", set())
    monkeypatch.setattr(seals, "_digest", run_out)
    with pytest.raises(OSError, match=r"Too many open files"):
        ensure_folder("things", "thing", b"1", b"", never, tmp_path)
    assert (folder / "thing.npz").is_file() and path.is_file()


def test_a_file_that_is_missing_for_the_content_is_named(tmp_path: Path) -> None:
    def write_from_other(_: Path) -> None:
        (tmp_path / "colors.yaml").read_text()

    with pytest.raises(InputError, match=r"cache of things .*entry: cannot be written: .*colors\.yaml: No such file"):
        read_cached(tmp_path / "entry/thing.npz", "things", read, write_from_other)
