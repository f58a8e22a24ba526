"""Entries of other versions are evicted when they are old, or disk space is low, and no process uses them."""

import os
import subprocess
import sys
import time
from pathlib import Path
from unittest.mock import Mock

import pytest

from simbev_ros.foundation.cache import entries
from simbev_ros.foundation.cache.entries import KEPT_S, SPARE_BYTES, entry_path, evict_unused, hold_entry
from simbev_ros.foundation.cache.folders import ensure_folder
from simbev_ros.foundation.errors import InputError


@pytest.fixture(autouse=True)
def disk_usage(monkeypatch: pytest.MonkeyPatch) -> Mock:
    """Stands for ``shutil.disk_usage``; the disk has much free space."""
    usage = Mock(return_value=Mock(free=SPARE_BYTES))
    monkeypatch.setattr(entries.shutil, "disk_usage", usage)
    return usage


def entry(cache: Path, name: str, version: bytes, *, unused_s: float) -> Path:
    folder = entry_path(cache / "maps", name, version, b"")
    folder.mkdir(parents=True)
    (folder / "net").write_text(name)
    return aged(folder, unused_s)


def aged(folder: Path, unused_s: float) -> Path:
    os.utime(folder, (time.time() - unused_s, time.time() - unused_s))
    return folder


def written(cache: Path) -> Path:
    """A new entry of version 2."""
    return ensure_folder("maps", "New", b"2", os.urandom(4), lambda work: (work / "net").touch(), cache)


def test_only_old_entries_of_other_versions_go(tmp_path: Path) -> None:
    old = entry(tmp_path, "Old", b"1", unused_s=KEPT_S + 60)
    kept = [entry(tmp_path, "Young", b"1", unused_s=KEPT_S - 60), entry(tmp_path, "Mine", b"2", unused_s=2 * KEPT_S)]
    (tmp_path / "maps/.Town-killed").mkdir()  # of a build that was killed
    aged(tmp_path / "maps/.Town-killed", 2 * KEPT_S)
    (tmp_path / "maps/Town-84de7e876f2f15e4e297").mkdir()  # names had no version once
    aged(tmp_path / "maps/Town-84de7e876f2f15e4e297", 2 * KEPT_S)
    new = written(tmp_path)
    assert not old.exists() and sorted((tmp_path / "maps").iterdir()) == sorted([*kept, new])
    assert (tmp_path / "maps").is_dir() and (kept[0] / "net").read_text() == "Young"


def test_low_disk_space_evicts_entries_of_other_versions_by_last_use_until_enough_is_free(
    tmp_path: Path, disk_usage: Mock
) -> None:
    last, middle, first = (entry(tmp_path, f"Unused{hours}h", b"1", unused_s=3600.0 * hours) for hours in (1, 2, 3))
    held, mine = entry(tmp_path, "Held", b"1", unused_s=0), entry(tmp_path, "Mine", b"2", unused_s=KEPT_S / 2)
    hold_entry(held)
    aged(held, KEPT_S / 2)
    building = tmp_path / "maps/.Town-building"  # by another process
    building.mkdir()
    disk_usage.side_effect = lambda folder: Mock(free=SPARE_BYTES - 1 if middle.exists() else SPARE_BYTES)
    new = written(tmp_path)
    assert not first.exists()
    assert sorted((tmp_path / "maps").iterdir()) == sorted([last, held, mine, building, new])


def test_an_entry_in_use_stays_as_long_as_the_process_lives(tmp_path: Path) -> None:
    folder = entry(tmp_path, "Old", b"1", unused_s=2 * KEPT_S)
    program = "import sys, pathlib; from simbev_ros.foundation.cache.entries import hold_entry; "
    program += f"hold_entry(pathlib.Path({str(folder)!r})); print('used', flush=True); sys.stdin.read()"
    command = [sys.executable, "-c", program]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as user:
        assert user.stdout is not None and user.stdout.readline() == "used\n"
        assert time.time() - folder.stat().st_mtime < 60
        aged(folder, 2 * KEPT_S)
        written(tmp_path)
        assert (folder / "net").is_file()
    written(tmp_path)
    assert not folder.exists()


def test_an_entry_that_is_taken_into_use_at_the_last_moment_stays(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, remove = entry(tmp_path, "Old", b"1", unused_s=2 * KEPT_S), entries._evict

    def late(old: Path, last_use_s: float) -> None:
        os.utime(folder)
        remove(old, last_use_s)

    monkeypatch.setattr(entries, "_evict", late)
    written(tmp_path)
    assert (folder / "net").is_file()


def test_a_found_entry_counts_as_used_and_one_that_is_gone_is_no_error(tmp_path: Path) -> None:
    found = written(tmp_path)
    aged(found, 2 * KEPT_S)
    key = b"the same"
    again = ensure_folder("maps", "New", b"2", key, lambda work: None, tmp_path)
    aged(again, 2 * KEPT_S)
    assert ensure_folder("maps", "New", b"2", key, lambda work: pytest.fail("built again"), tmp_path) == again
    assert time.time() - again.stat().st_mtime < 60 < time.time() - found.stat().st_mtime
    hold_entry(tmp_path / "gone")
    evict_unused(found)


@pytest.mark.parametrize("name", ["../x", "/x", "a/../../x"])
def test_entries_stay_in_the_cache(tmp_path: Path, name: str) -> None:
    with pytest.raises(InputError, match="leads out of"):
        ensure_folder("maps", name, b"1", b"", lambda work: None, tmp_path / "cache")
    assert list(tmp_path.iterdir()) == []


def test_the_entries_used_last_are_held_and_descriptors_do_not_run_out(tmp_path: Path) -> None:
    held = 64
    folders = [entry(tmp_path, f"Map{index}", b"1", unused_s=0) for index in range(3 * held)]
    descriptors = Path("/proc/self/fd")
    before = len(list(descriptors.iterdir()))
    for folder in folders:
        hold_entry(folder)
        hold_entry(folders[0])  # used again and again
    assert len(list(descriptors.iterdir())) - before <= held
    for folder in folders:
        aged(folder, 2 * KEPT_S)
    written(tmp_path)  # and holds it
    assert [folder for folder in folders if folder.exists()] == [folders[0], *folders[2 - held :]]
