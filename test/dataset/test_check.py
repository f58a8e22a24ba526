"""An index that does not say what is there is found out."""

from pathlib import Path

import pytest

from simbev_ros.dataset.check import index_faults
from simbev_ros.dataset.index import read_index, sha256_of, write_index


@pytest.fixture
def dataset(tmp_path: Path) -> Path:
    rows = []
    for number in range(3):
        bag = tmp_path / f"scenes/train/Blocks-000{number}"
        bag.mkdir(parents=True)
        file = bag / f"{bag.name}_0.mcap"
        file.write_bytes(bytes([number]) * 100)
        rows.append({"path": str(bag.relative_to(tmp_path)), "number": number, "sha256": sha256_of(file), "bytes": 100})
    write_index(tmp_path, rows)
    assert index_faults(tmp_path) == []
    return tmp_path


def problems(dataset: Path) -> list[str]:
    return [f"{fault.bag.name} {fault.place}: {fault.problem}" for fault in index_faults(dataset)]


def test_a_changed_a_missing_and_an_unknown_scene_are_found(dataset: Path) -> None:
    scenes = dataset / "scenes/train"
    (scenes / "Blocks-0000/Blocks-0000_0.mcap").write_bytes(b"x" * 100)
    (scenes / "Blocks-0001").rename(scenes / "Blocks-0007")
    (dataset / ".making").mkdir()
    assert problems(dataset) == [
        "Blocks-0000 Blocks-0000_0.mcap: it is not the file that the index knows: its SHA-256 is another",
        "Blocks-0001 : the index has this scene, but it is not there",
        "Blocks-0007 index.parquet: the index does not have this scene",
        f"{dataset.name} .making: a scene was being made; generate makes it again",
    ]


def test_a_damaged_index_is_found_and_none_is_no_fault(dataset: Path) -> None:
    (dataset / "index.parquet").write_bytes(b"PAR1")
    assert "index.parquet" in problems(dataset)[0]
    (dataset / "index.parquet").unlink()
    assert problems(dataset) == []


def test_rows_are_kept_in_order_with_what_is_not_known_left_empty(dataset: Path) -> None:
    rows = read_index(dataset)
    write_index(dataset, reversed(rows))
    assert read_index(dataset) == rows
    assert [row["number"] for row in rows] == [0, 1, 2] and rows[0]["final_cloudiness"] is None
