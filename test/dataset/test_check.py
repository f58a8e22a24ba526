"""An index that does not match the bags is found, and is rebuilt from all bags that can be read."""

import shutil
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import recorded_scene as written
from index_files import write_index
from peak_memory import at_most

from simbev_ros.dataset.check import dataset_faults
from simbev_ros.dataset.index import read_index, update_index
from simbev_ros.dataset.opened import open_dataset
from simbev_ros.foundation.errors import InputError
from simbev_ros.recording.layout import scenes_of


@pytest.fixture(scope="module")
def intact(tmp_path_factory: pytest.TempPathFactory) -> Path:
    dataset = tmp_path_factory.mktemp("intact")
    for number in range(3):
        written.record(dataset / f"scenes/train/Blocks-000{number}", written.spec(number), only=["/ego/odom", "/clock"])
    assert update_index(dataset, scenes_of(dataset))[1] == {}
    assert dataset_faults(dataset) == []
    return dataset


@pytest.fixture
def dataset(intact: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(intact, tmp_path / "set"))


def problems(dataset: Path) -> list[str]:
    return [f"{fault.bag.name} {fault.place}: {fault.problem}" for fault in dataset_faults(dataset)]


def test_changed_missing_empty_and_unknown_scenes_are_found(dataset: Path) -> None:
    scenes = dataset / "scenes/train"
    (scenes / "Blocks-0000/Blocks-0000_0.mcap").write_bytes(b"x" * 100)
    (scenes / "Blocks-0001").rename(scenes / "Blocks-0007")
    (scenes / "Blocks-0002/Blocks-0002_0.mcap").unlink()
    (dataset / ".making").mkdir()
    assert problems(dataset) == [
        "Blocks-0002 : there is no .mcap file in it",
        "set .making: a scene was interrupted; generate records it again",
        "Blocks-0000 Blocks-0000_0.mcap: it is not the file in the index: its SHA-256 differs",
        "Blocks-0001 : the index lists this scene, but its bag is missing",
        "Blocks-0007 index.parquet: the index does not list this scene",
    ]


def test_every_cell_of_the_index_is_compared_with_the_bag(dataset: Path) -> None:
    rows = read_index(dataset)
    rows[0]["split"], rows[1]["boxes_car"], rows[2]["simbev_ros"] = "val", 7, "another version"
    write_index(dataset, rows)
    assert problems(dataset) == [
        "Blocks-0000 index.parquet: split is 'val', but 'train' in the bag",
        "Blocks-0001 index.parquet: boxes_car is 7, but 0 in the bag",
    ]


def test_a_damaged_index_is_a_fault_and_a_missing_one_only_with_a_plan(dataset: Path) -> None:
    index = dataset / "index.parquet"
    index.write_bytes(b"PAR1")
    assert problems(dataset)[0].startswith("set index.parquet: Parquet file size is 4 bytes")
    pq.write_table(pa.table({"path": ["a"]}), index)
    with pytest.raises(InputError, match=r"it is not an index of this version, .*; delete it, and simbev generate"):
        read_index(dataset)
    index.unlink()
    assert problems(dataset) == []
    (dataset / "plan.json").write_text("{}")
    assert problems(dataset) == ["set index.parquet: it is missing; generate rebuilds it"]


def test_an_index_is_rebuilt_and_names_bags_that_cannot_be_in_it(dataset: Path) -> None:
    before, bags = read_index(dataset), scenes_of(dataset)
    (dataset / "index.parquet").unlink()
    table, damaged = update_index(dataset, bags)
    assert (table.to_pylist(), damaged) == (before, {}) and read_index(dataset) == before
    cut_off, moved = bags[0] / "Blocks-0000_0.mcap", bags[1].with_name("Blocks-0009")
    cut_off.write_bytes(cut_off.read_bytes()[:-30])
    bags[1].rename(moved)
    _, damaged = update_index(dataset, [bags[0], moved, bags[2]])
    assert damaged == {bags[0]: "it is cut off", moved: "it holds scene train/Blocks-0001"}
    assert read_index(dataset) == before[2:]


def test_rows_are_sorted_and_unknown_values_are_none(dataset: Path) -> None:
    rows = read_index(dataset)
    write_index(dataset, reversed(rows))
    assert read_index(dataset) == rows
    assert [row["number"] for row in rows] == [0, 1, 2] and rows[0]["final_cloudiness"] is None


@pytest.mark.parametrize(
    ("column", "value"), [("recorded_ticks", 1 << 62), ("ticks", -1), ("number", 500_001), ("vehicles", None)]
)
def test_an_index_with_impossible_numbers_is_refused(dataset: Path, column: str, value: int | None) -> None:
    write_index(dataset, [{**row, column: value} for row in read_index(dataset)[:1]])
    with pytest.raises(InputError, match=rf"index\.parquet: {column}: .*; delete it, and simbev generate rebuilds it"):
        open_dataset(dataset)


def test_an_index_of_more_rows_than_scenes_is_refused_before_it_is_read(dataset: Path) -> None:
    index = dataset / "index.parquet"
    table = pq.read_table(index)
    pq.write_table(table.slice(0, 1).take(pa.array(np.zeros(500_002, np.int8))), index)
    assert index.stat().st_size < 1 << 18
    with at_most(8), pytest.raises(InputError, match=r"it has 500,002 rows; a dataset has at most 500,001 scenes"):
        read_index(dataset)
