"""Small files are read up to a limit; paths that no file can have are paths where nothing is."""

import os
from pathlib import Path

import pytest

from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.files.input_file import is_file, is_folder, path_exists, read_small_file


def test_a_file_is_read_up_to_the_limit(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(bytes(2 << 20))
    assert read_small_file(tmp_path / "a", 2 << 20) == bytes(2 << 20)
    with pytest.raises(InputError, match="a: is larger than 1 MiB"):
        read_small_file(tmp_path / "a", 1 << 20)


def test_errors_name_the_path(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for path, words in ((tmp_path / "pipe", "is not a file"), (Path("/proc/self/mem"), "cannot be read: Input/output")):
        with pytest.raises(InputError, match=f"{path}: {words}"):
            read_small_file(path, 1 << 20)
    with pytest.raises(InputError, match="x: cannot be read: File name too long"):
        read_small_file(Path("x" * 5000), 1 << 20)


def test_impossible_paths_do_not_exist(tmp_path: Path) -> None:
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    for path in (Path("x" * 5000), tmp_path / "loop"):
        assert not (path_exists(path) or is_file(path) or is_folder(path))
    assert path_exists(tmp_path) and is_folder(tmp_path) and not is_file(tmp_path)
