"""Files of mapped arrays return what was written, read-only, aligned, and readable with numpy alone."""

from pathlib import Path

import numpy as np
import pytest

from simbev_ros.foundation.errors import NPZ_DAMAGE
from simbev_ros.foundation.files.mapped_arrays import map_arrays, write_arrays

ARRAYS = {
    "positions": np.arange(12.0).reshape(4, 3),
    "by_column": np.asfortranarray(np.arange(6, dtype=np.uint8).reshape(2, 3)),
    "none": np.zeros((0, 3), np.float32),
    "text": np.array("crosswalk"),
    "rows": np.array([(1, 2.5)], [("id", "<u4"), ("x", "<f8")]),
}


@pytest.fixture
def path(tmp_path: Path) -> Path:
    write_arrays(tmp_path / "arrays.npz", ARRAYS)
    return tmp_path / "arrays.npz"


def test_mapped_arrays_are_those_that_were_written(path: Path) -> None:
    mapped = map_arrays(path)
    path.unlink()
    assert list(mapped) == list(ARRAYS)
    for name, array in ARRAYS.items():
        assert (mapped[name].dtype, mapped[name].shape) == (array.dtype, array.shape)
        assert np.array_equal(mapped[name], array)
        assert mapped[name].ctypes.data % 64 == 0 and not mapped[name].flags.writeable


def test_numpy_reads_the_file(path: Path) -> None:
    with np.load(path, allow_pickle=False) as arrays:
        assert all(np.array_equal(arrays[name], array) for name, array in ARRAYS.items())


def test_a_file_has_the_same_bytes_each_time(path: Path) -> None:
    write_arrays(path.with_name("again.npz"), ARRAYS)
    assert path.read_bytes() == path.with_name("again.npz").read_bytes()


@pytest.mark.parametrize("kept", [0, 40, 400, -1])
def test_a_cut_file_counts_as_damaged(path: Path, kept: int) -> None:
    path.write_bytes(path.read_bytes()[:kept])
    with pytest.raises(NPZ_DAMAGE):
        map_arrays(path)


def test_python_objects_are_refused(path: Path) -> None:
    np.savez(path, objects=np.array([{}], object), allow_pickle=True)
    with pytest.raises(NPZ_DAMAGE):
        map_arrays(path)


def test_maps_hold_no_descriptor_and_end_with_their_last_array(tmp_path: Path) -> None:
    def descriptors() -> int:
        return len(list(Path("/proc/self/fd").iterdir()))

    def maps() -> int:
        return Path("/proc/self/maps").read_text().count(str(path))

    path = tmp_path / "arrays.npz"
    write_arrays(path, {"a": np.arange(5.0), "b": np.arange(3)})
    before = descriptors()
    arrays = map_arrays(path)
    assert descriptors() == before and maps() == 1
    kept = arrays.pop("b")[1:]
    arrays.clear()
    assert maps() == 1 and kept.tolist() == [1, 2] and not kept.flags.writeable
    del kept
    assert maps() == 0
