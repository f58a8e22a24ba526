"""Datasets made from Python: what is made, what is left, what is reported, and what stays when something fails."""

import errno
from pathlib import Path
from typing import Any

import pytest
from fake_graph import FakeGraph, Scenarios

from simbev_ros.dataset.index import read_index
from simbev_ros.dataset.lock import DatasetLock
from simbev_ros.foundation.errors import DiskError, GraphError, InputError
from simbev_ros.production import DatasetResult, ProductionObserver, make_dataset, scene_log
from simbev_ros.production.events import (
    DatasetEnded,
    DatasetStarted,
    ProductionEvent,
    SceneEnded,
    SceneFailed,
    SceneMade,
    SceneProgressed,
    SceneRetried,
    SceneStarted,
)


class Diary(ProductionObserver):
    """Writes down the events of scenes and of the dataset, but not those of maps."""

    def __init__(self) -> None:
        self.lines: list[str] = []

    def notify(self, event: ProductionEvent) -> None:
        match event:
            case SceneStarted(spec):
                self.lines.append(f"start {spec.number}")
            case SceneProgressed(_, tick):
                self.lines.append(f"tick {tick}")
            case SceneEnded(scene, end):
                self.lines.append(f"end {int(scene[-4:])} {end and end.reason}")
            case DatasetStarted(scenes):
                self.lines.append(f"{scenes} scenes")
            case SceneRetried(entry, reason):
                self.lines.append(f"retry {entry.number}: {reason}")
            case SceneMade(entry, dataset_bytes):
                assert dataset_bytes > 0
                self.lines.append(f"made {entry.number}")
            case SceneFailed(entry, reason):
                self.lines.append(f"failed {entry.number}: {reason}")
            case DatasetEnded():
                self.lines.append("done")


def names(result: DatasetResult) -> tuple[list[str], list[str]]:
    return [entry.name for entry in result.made], [entry.name for entry in result.skipped]


def test_scenes_are_made_once_and_nothing_is_printed(
    graph: FakeGraph, scenario: Scenarios, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    diary = Diary()
    result = make_dataset(scenario(2), tmp_path / "set", observer=diary)
    assert names(result) == (["Blocks-0000", "Blocks-0001"], []) and result.is_complete
    assert [row["name"] for row in read_index(tmp_path / "set")] == ["Blocks-0000", "Blocks-0001"]
    assert graph.log == ["start", "Blocks-0000", "Blocks-0001", "close"]
    scene = ["start {0}", "tick None", "tick 1", "end {0} duration", "made {0}"]
    assert diary.lines == ["2 scenes", *(line.format(k) for k in (0, 1) for line in scene), "done"]
    again = make_dataset(scenario(3), tmp_path / "set")
    assert names(again) == (["Blocks-0002"], ["Blocks-0000", "Blocks-0001"])
    assert capfd.readouterr() == ("", "")


def test_some_scenes_are_made_again(graph: FakeGraph, scenario: Scenarios, tmp_path: Path) -> None:
    make_dataset(scenario(3), tmp_path / "set")
    result = make_dataset(scenario(3), str(tmp_path / "set"), replace=[0, range(2, 3)])
    assert names(result) == (["Blocks-0000", "Blocks-0002"], ["Blocks-0001"])
    with pytest.raises(InputError, match=r"^replace: the dataset has no scene 7; ") as refused:
        make_dataset(scenario(3), tmp_path / "set", replace=[7])
    assert refused.value.parameter == "replace"


def test_a_failed_graph_is_restarted_and_the_scene_tried_again(
    graph: FakeGraph, scenario: Scenarios, tmp_path: Path
) -> None:
    diary = Diary()
    graph.problems = {1: [GraphError("world died")]}
    result = make_dataset(scenario(2), tmp_path / "set", observer=diary)
    assert len(result.made) == 2 and result.is_complete
    assert graph.log == ["start", "Blocks-0000", "Blocks-0001", "close", "start", "Blocks-0001", "close"]
    assert "retry 1: world died" in diary.lines and "end 1 None" in diary.lines
    logs = tmp_path / "set/logs"
    assert "world died\n--- world\na line of the world node" in (logs / "Blocks-0001.failed-1.log").read_text()
    assert "duration after tick 1, " in (logs / "Blocks-0001.log").read_text()


def test_a_scene_that_fails_for_good_is_listed_and_the_others_are_made(
    graph: FakeGraph, scenario: Scenarios, tmp_path: Path
) -> None:
    diary = Diary()
    graph.problems = {0: [GraphError("first"), GraphError("second")], 1: [InputError("too large")]}
    result = make_dataset(scenario(3), tmp_path / "set", retries=1, observer=diary)
    assert names(result) == (["Blocks-0002"], []) and not result.is_complete
    assert result.failed == {"Blocks-0000": "second", "Blocks-0001": "too large"}
    assert [line for line in diary.lines if line.startswith("failed")] == ["failed 0: second", "failed 1: too large"]
    assert not (tmp_path / "set/.making").exists()
    assert graph.log.count("start") == graph.log.count("close") == 4, "each failure restarts the graph"


@pytest.mark.parametrize(
    ("scene", "problem"), [(0, InputError("no GPU")), (1, DiskError("full")), (1, KeyboardInterrupt())]
)
def test_what_ends_production_ends_the_graph_and_frees_the_dataset(
    graph: FakeGraph, scenario: Scenarios, tmp_path: Path, scene: int, problem: BaseException
) -> None:
    diary = Diary()
    graph.problems = {scene: [problem]}
    with pytest.raises(type(problem)):
        make_dataset(scenario(3), tmp_path / "set", observer=diary)
    assert graph.log[-1] == "close"
    assert diary.lines[-2:] == [f"end {scene} None", "done"]
    assert not (tmp_path / "set/.making").exists()
    with DatasetLock(tmp_path / "set"):
        assert len(read_index(tmp_path / "set")) == scene


def test_the_message_of_a_full_disk_says_what_is_kept(graph: FakeGraph, scenario: Scenarios, tmp_path: Path) -> None:
    graph.problems = {1: [DiskError("node recorder: the disk is full")]}
    with pytest.raises(DiskError, match=r"is full; finished scenes are in the dataset, nothing else is kept; given"):
        make_dataset(scenario(3), tmp_path / "set")
    assert [path.name for path in (tmp_path / "set/scenes/train").iterdir()] == ["Blocks-0000"]
    assert not (tmp_path / "set/.making").exists()
    assert names(make_dataset(scenario(3), tmp_path / "set"))[0] == ["Blocks-0001", "Blocks-0002"]


def test_a_log_that_finds_no_space_ends_production(
    graph: FakeGraph, scenario: Scenarios, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(path: Path, content: bytes) -> None:
        raise OSError(errno.ENOSPC, "No space left on device", str(path))

    monkeypatch.setattr(scene_log, "write_whole", fail)
    with pytest.raises(DiskError, match=r"Blocks-0000\.log: the disk is full; finished scenes are in the dataset"):
        make_dataset(scenario(1), tmp_path / "set")


def test_a_damaged_scene_is_neither_made_nor_counted(graph: FakeGraph, scenario: Scenarios, tmp_path: Path) -> None:
    make_dataset(scenario(2), tmp_path / "set")
    mcap = tmp_path / "set/scenes/train/Blocks-0001/Blocks-0001_0.mcap"
    mcap.write_bytes(mcap.read_bytes()[:-100])
    result = make_dataset(scenario(2), tmp_path / "set")
    assert names(result) == ([], ["Blocks-0000"]) and not result.is_complete
    assert result.failed == {} and list(result.damaged) == ["Blocks-0001"]


@pytest.mark.parametrize("wrong", ["nothing.yaml", "Atlantis"])
def test_bad_input_leaves_no_folder_behind(graph: FakeGraph, tmp_path: Path, wrong: str) -> None:
    config: Any = tmp_path / wrong
    if wrong == "Atlantis":
        config.write_text("scenes: [{map: Atlantis, train: 1}]\nrig: {sensors: []}\n")
    with pytest.raises(InputError, match=wrong):
        make_dataset(config, tmp_path / "set")
    assert not (tmp_path / "set").exists() and graph.log == []
