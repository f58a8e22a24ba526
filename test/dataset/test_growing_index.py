"""The index of a dataset that grows: the same file as one written at once, written seldom, and small in memory."""

import tracemalloc
from pathlib import Path

import pytest
import recorded_scene as written
from index_files import write_index

from simbev_ros.dataset import growing_index
from simbev_ros.dataset.growing_index import GrowingIndex
from simbev_ros.dataset.index import index_table, load_index, read_index, save_index
from simbev_ros.dataset.index_row import Row, index_row
from simbev_ros.foundation.errors import InputError


@pytest.fixture(scope="module")
def row(tmp_path_factory: pytest.TempPathFactory) -> Row:
    dataset = tmp_path_factory.mktemp("one")
    bag = dataset / "scenes/train/Blocks-0000"
    written.record(bag, written.spec(0), only=["/ego/odom", "/clock"])
    return index_row(bag, dataset)


@pytest.fixture
def writes(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Numbers of rows of the files that were written."""
    numbers: list[int] = []

    def save(dataset: Path, table: growing_index.pa.Table) -> None:
        numbers.append(len(table))
        save_index(dataset, table)

    monkeypatch.setattr(growing_index, "save_index", save)
    return numbers


def numbered(row: Row, number: int, size: int = 1000) -> Row:
    name = f"Blocks-{number:04d}"
    return {**row, "number": number, "name": name, "path": f"scenes/train/{name}", "bytes": size}


def test_the_file_is_that_of_all_rows_written_at_once(row: Row, tmp_path: Path) -> None:
    rows = [numbered(row, number) for number in range(150)]
    (tmp_path / "once").mkdir()
    write_index(tmp_path / "once", rows)
    write_index(tmp_path, rows[:40])
    index = GrowingIndex(tmp_path, load_index(tmp_path))
    for new in reversed(rows[40:]):
        index.add(new)
    index.write()
    assert (tmp_path / "index.parquet").read_bytes() == (tmp_path / "once/index.parquet").read_bytes()
    assert len(index) == 150 and index.total_bytes == 150_000


def test_a_crash_loses_at_most_a_twentieth_of_the_rows(row: Row, tmp_path: Path) -> None:
    index = GrowingIndex(tmp_path, index_table([]))
    for number in range(100):
        index.add(numbered(row, number))
        assert len(load_index(tmp_path)) >= (number + 1) * 0.95


def test_the_number_of_writes_grows_with_the_logarithm_of_the_scenes(
    row: Row, tmp_path: Path, writes: list[int]
) -> None:
    index = GrowingIndex(tmp_path, index_table([]))
    for number in range(1600):
        index.add(numbered(row, number))
    assert writes[:20] == list(range(1, 21)), "the first ones are written at once"
    added = [sum(first <= length < 2 * first for length in writes) for first in (100, 200, 400, 800)]
    assert max(added) <= 15, "each doubling takes as many: ln 2 / ln 1.05"
    assert sum(writes) < 25 * 1600, "the rows written in all are linear in the scenes"


def test_a_write_without_new_rows_writes_nothing(row: Row, tmp_path: Path, writes: list[int]) -> None:
    index = GrowingIndex(tmp_path, index_table([]))
    index.write()
    assert not writes and not (tmp_path / "index.parquet").exists()
    index.add(numbered(row, 0))
    index.write()
    assert writes == [1]


def test_a_replaced_row_takes_the_place_of_the_old_one(row: Row, tmp_path: Path) -> None:
    index = GrowingIndex(tmp_path, index_table([numbered(row, number) for number in range(30)]))
    index.add(numbered(row, 7, size=5000))
    index.add(numbered(row, 7, size=400))  # before the first one is on the disk
    assert (len(index), index.total_bytes, index.largest_bytes) == (30, 29_400, 5000)
    index.write()
    rows = read_index(tmp_path)
    assert [each["number"] for each in rows] == list(range(30)) and rows[7]["bytes"] == 400


def test_a_row_takes_little_memory(row: Row, tmp_path: Path) -> None:
    index = GrowingIndex(tmp_path, index_table([]))
    tracemalloc.start()
    try:
        for number in range(500):
            index.add(numbered(row, number))
        held_bytes, _ = tracemalloc.get_traced_memory()
        rows = index._table.to_pylist()
        with_rows_bytes, _ = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert len(rows) > 470 and held_bytes + index._table.nbytes < (with_rows_bytes - held_bytes) / 2


def test_a_text_that_is_not_utf_8_is_refused(row: Row, tmp_path: Path) -> None:
    write_index(tmp_path, [{**row, "ended": "duration here"}])
    file = tmp_path / "index.parquet"
    content = file.read_bytes()
    file.write_bytes(content.replace(b"duration here", b"duration \xff\xff\xff\xff"))
    assert file.read_bytes() != content
    with pytest.raises(InputError, match=r"index\.parquet: .*rebuilds it"):
        load_index(tmp_path)
