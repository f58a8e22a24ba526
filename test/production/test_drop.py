"""Scenes that are dropped: they are gone, do not come back, and others take their places."""

from pathlib import Path

import pytest
from fake_graph import FakeGraph, Scenarios

from simbev_ros.dataset.index import read_index
from simbev_ros.dataset.plan import Plan
from simbev_ros.foundation.errors import InputError
from simbev_ros.production import make_dataset
from simbev_ros.production.drop import drop_scenes


def test_a_dropped_scene_does_not_come_back_and_another_takes_its_place(
    graph: FakeGraph, scenario: Scenarios, tmp_path: Path
) -> None:
    made = tmp_path / "set"
    make_dataset(scenario(3), made)
    additional = made / "scenes/train/Blocks-0002.stack"
    additional.mkdir()
    (additional / "Blocks-0002_0.mcap").write_bytes(b"")
    assert [entry.name for entry in drop_scenes(made, [2, range(1)])] == ["Blocks-0000", "Blocks-0002"]
    assert [path.name for path in (made / "scenes/train").iterdir()] == ["Blocks-0001"]
    assert [row["number"] for row in read_index(made)] == [1]
    again = make_dataset(scenario(3), made)
    assert [entry.name for entry in again.made] == ["Blocks-0003", "Blocks-0004"]
    assert [entry.number for entry in Plan.load(made).dropped] == [0, 2]


def test_an_interrupted_drop_is_finished_by_the_same_call(
    graph: FakeGraph, scenario: Scenarios, tmp_path: Path
) -> None:
    made = tmp_path / "set"
    make_dataset(scenario(2), made)
    plan = Plan.load(made)
    plan.without(plan.scenes[:1]).save(made)  # the drop was killed before it removed anything
    drop_scenes(made, [0])
    assert [path.name for path in (made / "scenes/train").iterdir()] == ["Blocks-0001"]


def test_what_cannot_be_dropped_is_refused(graph: FakeGraph, scenario: Scenarios, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"nothing: no such file or folder$"):
        drop_scenes(tmp_path / "nothing", [0])
    assert not (tmp_path / "nothing").exists()
    make_dataset(scenario(1), tmp_path / "set")
    with pytest.raises(InputError, match=r"^the dataset has no scene 7; its numbers are 0 to 0$"):
        drop_scenes(tmp_path / "set", [7])
