"""Replays recorded from Python: what is recorded where, what is left alone, and what stays when something fails."""

import shutil
from collections.abc import Sequence
from pathlib import Path

import pytest
from fake_graph import FakeGraph, Scenarios
from fake_ray import FakeRay, install_fake_ray
from replayable_scene import replayable_scene

from simbev_ros.config.evaluation import Evaluation
from simbev_ros.config.scenario import Scenario
from simbev_ros.dataset.index import read_index, update_index
from simbev_ros.dataset.lock import DatasetLock
from simbev_ros.foundation.errors import DiskError, GraphError, InputError
from simbev_ros.production import ProductionObserver, ReplayResult, replay_bags
from simbev_ros.production.cluster import node_check
from simbev_ros.production.events import LeftoverRemoved, ProductionEvent
from simbev_ros.recording.layout import partial_of


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A dataset of two scenes and an index."""
    dataset = tmp_path_factory.mktemp("recorded")
    update_index(dataset, [replayable_scene(dataset, number) for number in (0, 1)])
    return dataset


@pytest.fixture
def dataset(recorded: Path, tmp_path: Path) -> Path:
    shutil.copytree(recorded, tmp_path / "first")
    return tmp_path / "first"


@pytest.fixture
def rig(scenario: Scenarios) -> Scenario:
    """The configuration to replay with."""
    return scenario(1)


@pytest.fixture
def ray(monkeypatch: pytest.MonkeyPatch) -> FakeRay:
    """A cluster of one node."""
    fake = install_fake_ray(monkeypatch)
    fake.add_node("aaaaaaaa")
    fake.answers["_reap_on_node", "aaaaaaaa"] = None
    return fake


def names(bags: Sequence[Path]) -> list[str]:
    return [bag.name for bag in bags]


def content(folder: Path) -> list[str]:
    """Paths of the files in a dataset, without its lock."""
    return sorted(
        str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file() and path.name != ".lock"
    )


def scenes_in(dataset: Path) -> list[str]:
    return sorted(path.name for path in dataset.glob("scenes/*/*"))


def test_each_scene_is_replayed_from_its_bag_into_a_dataset(
    graph: FakeGraph, rig: Scenario, dataset: Path, tmp_path: Path
) -> None:
    result = replay_bags(rig, [dataset], out=tmp_path / "night")
    bags = [dataset / f"scenes/train/Blocks-000{number}" for number in (0, 1)]
    assert result == ReplayResult(tuple(tmp_path / "night" / bag.relative_to(dataset) for bag in bags), (), {})
    assert result.is_complete and graph.replays == bags
    scenes = [f"scenes/train/{bag.name}/{name}" for bag in bags for name in (f"{bag.name}_0.mcap", "metadata.yaml")]
    assert content(tmp_path / "night") == [
        "index.parquet",
        *(f"logs/{bag.name}.log" for bag in bags),
        "plan.json",
        *scenes,
    ]


def test_of_a_dataset_only_what_is_not_recorded_yet_is_replayed(
    graph: FakeGraph, rig: Scenario, dataset: Path, tmp_path: Path
) -> None:
    replay_bags(rig, [dataset / "scenes/train/Blocks-0000"], out=tmp_path / "night")
    result = replay_bags(rig, [dataset], out=tmp_path / "night")
    assert (names(result.recorded), names(result.existing)) == (["Blocks-0001"], ["Blocks-0000"])
    result = replay_bags(rig, [dataset], out=tmp_path / "night")
    assert (names(result.recorded), names(result.existing)) == ([], ["Blocks-0000", "Blocks-0001"])


def test_additional_bags_are_beside_their_scenes_and_change_no_index(
    graph: FakeGraph, rig: Scenario, dataset: Path
) -> None:
    index, before = read_index(dataset), content(dataset)
    result = replay_bags(rig, [dataset], merge="rear")
    assert names(result.recorded) == ["Blocks-0000.rear", "Blocks-0001.rear"]
    assert scenes_in(dataset) == ["Blocks-0000", "Blocks-0000.rear", "Blocks-0001", "Blocks-0001.rear"]
    added = set(content(dataset)) - set(before)
    assert {name for name in added if not name.startswith("scenes/")} == {
        *("logs/Blocks-0000.rear.log", "logs/Blocks-0001.rear.log")
    }
    assert read_index(dataset) == index and not (dataset / ".making").exists()
    assert replay_bags(rig, [dataset], merge="rear").recorded == ()


@pytest.mark.parametrize("merge", [None, "rear"], ids=["out", "merge"])
def test_interrupted_it_leaves_nothing_half_and_continues(
    graph: FakeGraph, rig: Scenario, dataset: Path, tmp_path: Path, merge: str | None
) -> None:
    out = tmp_path / "night" if merge is None else None
    place = out or dataset
    graph.problems = {1: [KeyboardInterrupt()]}
    with pytest.raises(KeyboardInterrupt):
        replay_bags(rig, [dataset], out=out, merge=merge)
    assert not (place / ".making").exists() and not list(place.glob("scenes/*/*.partial"))
    result = replay_bags(rig, [dataset], out=out, merge=merge)
    suffix = "" if merge is None else ".rear"
    assert (names(result.recorded), names(result.existing)) == ([f"Blocks-0001{suffix}"], [f"Blocks-0000{suffix}"])


def test_a_replay_that_fails_is_tried_again_then_listed_and_the_others_follow(
    graph: FakeGraph, rig: Scenario, dataset: Path, tmp_path: Path
) -> None:
    graph.problems = {0: [GraphError(f"world died {k}") for k in range(2)]}
    result = replay_bags(rig, [dataset], out=tmp_path / "night", retries=1)
    assert result.failed == {"Blocks-0000": "world died 1"} and not result.is_complete
    assert scenes_in(tmp_path / "night") == ["Blocks-0001"]
    logs = sorted(path.name for path in (tmp_path / "night/logs").iterdir())
    assert logs == ["Blocks-0000.failed-1.log", "Blocks-0000.failed-2.log", "Blocks-0001.log"]


def test_a_full_disk_ends_it_and_leaves_what_is_recorded(
    graph: FakeGraph, rig: Scenario, dataset: Path, tmp_path: Path
) -> None:
    graph.problems = {1: [DiskError("the disk is full")]}
    with pytest.raises(DiskError, match=r"is full; finished scenes are in the dataset, nothing else is kept; given"):
        replay_bags(rig, [dataset], out=tmp_path / "night")
    assert scenes_in(tmp_path / "night") == ["Blocks-0000"] and not (tmp_path / "night/.making").exists()


def test_what_a_killed_replay_of_one_graph_has_left_is_removed(
    graph: FakeGraph, rig: Scenario, dataset: Path, tmp_path: Path
) -> None:
    removed = []

    class Removed(ProductionObserver):
        def notify(self, event: ProductionEvent) -> None:
            if isinstance(event, LeftoverRemoved):
                removed.append(event.scene)

    partial_of(tmp_path / "night/scenes/train/Blocks-0001").mkdir(parents=True)
    (tmp_path / "night/.making/0abc/worker-1").mkdir(parents=True)
    replay_bags(rig, [dataset], out=tmp_path / "night", observer=Removed())
    assert scenes_in(tmp_path / "night") == ["Blocks-0000", "Blocks-0001"] and removed == ["Blocks-0001"]
    assert not (tmp_path / "night/.making").exists()


def test_a_scene_that_is_there_is_not_overwritten(
    graph: FakeGraph, rig: Scenario, dataset: Path, tmp_path: Path
) -> None:
    bag = dataset / "scenes/train/Blocks-0000"
    replay_bags(rig, [bag], out=tmp_path / "night")
    with pytest.raises(InputError, match=r"Blocks-0000: exists already; nothing was overwritten"):
        replay_bags(rig, [bag], out=tmp_path / "night")
    replay_bags(rig, [bag], merge="rear")
    with pytest.raises(InputError, match=r"Blocks-0000.rear: exists already; nothing was overwritten"):
        replay_bags(rig, [bag], merge="rear")


def test_two_bags_of_a_scene_are_refused_before_anything_is_written(
    graph: FakeGraph, rig: Scenario, dataset: Path, tmp_path: Path
) -> None:
    with pytest.raises(InputError, match=r"^Blocks-0001: two of the bags are of this scene"):
        replay_bags(rig, [dataset, dataset / "scenes/train/Blocks-0001"], out=tmp_path / "night")
    assert not (tmp_path / "night").exists() and graph.log == []


def test_while_another_process_writes_nothing_is_touched(
    graph: FakeGraph, rig: Scenario, dataset: Path, tmp_path: Path
) -> None:
    for place, where in ((dataset, {"merge": "rear"}), (tmp_path / "night", {"out": str(tmp_path / "night")})):
        with DatasetLock(place), pytest.raises(InputError, match=r"process \d+ is writing into it"):
            replay_bags(rig, [dataset], **where)  # type: ignore[arg-type]
    assert graph.log == []


def test_a_stack_in_the_configuration_is_refused(graph: FakeGraph, rig: Scenario, dataset: Path) -> None:
    evaluated = rig.model_copy(update={"evaluation": Evaluation()})
    with pytest.raises(InputError, match=r"^evaluation: several graphs evaluate no stack; remove the section"):
        replay_bags(evaluated, [dataset], merge="rear")


@pytest.mark.parametrize("where", [{}, {"out": "x", "merge": "rear"}], ids=["nowhere", "twice"])
def test_replays_are_recorded_in_one_place(rig: Scenario, dataset: Path, where: dict[str, str]) -> None:
    with pytest.raises(InputError, match=r": give out or merge$"):
        replay_bags(rig, [dataset], **where)  # type: ignore[arg-type]


@pytest.mark.parametrize("merge", [None, "rear"], ids=["out", "merge"])
def test_a_node_that_does_not_see_the_bags_is_refused_before_anything_is_written(
    ray: FakeRay,
    rig: Scenario,
    dataset: Path,
    tmp_path: Path,
    merge: str | None,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked = list[object]()
    answer = f"does not see {dataset} as this machine does"
    monkeypatch.setattr(node_check, "node_problem", lambda *question: asked.extend(question) or answer)
    before, bag = content(tmp_path), dataset / "scenes/train/Blocks-0000/Blocks-0000_0.mcap"
    with pytest.raises(InputError, match=rf"^node aaaaaa at 10\.0\.0\.1: {answer}$"):
        replay_bags(rig, [dataset], out=None if merge else tmp_path / "night", merge=merge, ray="auto")
    assert str(bag) in repr(asked)
    assert content(tmp_path) == before and not (tmp_path / "night").exists() and not ray.is_open
