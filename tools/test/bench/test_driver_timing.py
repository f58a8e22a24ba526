"""The driver of a production with workers that copy a scene, for ``python -m tools.bench production``."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from fake_ray import install_fake_ray
from made_up_scene import made_up_scene

from simbev_ros.config.scenario import Scenario
from simbev_ros.dataset.index import update_index
from simbev_ros.dataset.plan import PlannedEntry, bag_of
from simbev_ros.foundation.errors import DiskError, InputError
from simbev_ros.production.cluster.node_check import Code
from simbev_ros.production.scene_ending import FailedScene, MadeScene
from simbev_ros.production.workers.messages import Settings, Signal
from tools.bench.production import driver_timing
from tools.bench.production.copying_workers import CopyingPool, RecordedScene, copying_actor
from tools.bench.production.driver_timing import require_space, timed_production

ENTRY = PlannedEntry(number=7, map="Blocks", split="val")


@pytest.fixture
def recorded(tmp_path: Path) -> RecordedScene:
    """A scene of the split val."""
    made_up_scene(tmp_path / "set/scenes/val/Blocks-0000", split="val", ticks=1, sensors=[])
    return RecordedScene.first_of(tmp_path / "set")


@pytest.fixture
def place(tmp_path: Path) -> Path:
    """An empty folder."""
    folder = tmp_path / "place"
    folder.mkdir()
    return folder


def test_a_copy_has_the_name_of_its_scene_and_the_content_of_the_recorded_one(
    recorded: RecordedScene, place: Path
) -> None:
    ending = recorded.copy(place, ENTRY)
    bag = bag_of(place, ENTRY)
    assert isinstance(ending, MadeScene)
    assert sorted(path.name for path in bag.iterdir()) == ["Blocks-0007_0.mcap", "metadata.yaml"]
    assert (bag / "Blocks-0007_0.mcap").read_bytes() == (recorded.bag / "Blocks-0000_0.mcap").read_bytes()


def test_the_row_of_a_copy_is_that_of_the_recorded_scene_but_for_its_names(
    recorded: RecordedScene, place: Path
) -> None:
    ending = recorded.copy(place, ENTRY)
    assert isinstance(ending, MadeScene)
    names = {"number": 7, "name": "Blocks-0007", "path": "scenes/val/Blocks-0007"}
    assert ending.row == {**recorded.row, **names}


def test_a_copy_that_cannot_be_written_is_a_failed_scene(recorded: RecordedScene, place: Path) -> None:
    (place / "scenes").touch()
    ending = recorded.copy(place, ENTRY)
    assert isinstance(ending, FailedScene) and "cannot be written" in str(ending.error)


def test_a_dataset_without_scenes_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=rf"^{tmp_path}: has no finished scene to copy$"):
        RecordedScene.first_of(tmp_path)


def test_more_copies_than_the_disk_has_space_for_are_refused(recorded: RecordedScene, place: Path) -> None:
    require_space(place, recorded, 10)
    with pytest.raises(DiskError, match=rf"^{place}: the copies take \d+\.\d GB, and \d+\.\d GB are free$"):
        require_space(place, recorded, 10**12)


def test_workers_in_one_process_copy_in_the_order_of_their_scenes(recorded: RecordedScene, place: Path) -> None:
    with CopyingPool(recorded, place, 2) as pool:
        first, second = pool.idle()
        pool.submit(first, ENTRY)
        pool.submit(second, ENTRY.model_copy(update={"number": 8}))
        assert not pool.idle()
        [(worker, entry, _)] = pool.wait(0.0)
        assert (worker, entry) == (first, ENTRY) and pool.idle() == [first] and pool.copying_s > 0.0


def test_an_actor_copies_what_it_is_given(
    recorded: RecordedScene, place: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    install_fake_ray(monkeypatch)
    scenario = Scenario.model_validate({"scenes": [{"map": "Blocks", "train": 1}], "rig": {"sensors": []}})
    actor = copying_actor(recorded)("worker-1", Settings(scenario, place), Code("0.1.0", {}), {})
    assert actor.poll().messages == [Signal.READY]
    actor.submit(ENTRY)
    made, ready = actor.poll().messages
    assert made.row["name"] == "Blocks-0007" and ready is Signal.READY and bag_of(place, ENTRY).is_dir()


@pytest.mark.slow
def test_each_number_of_scenes_is_made_and_removed(recorded: RecordedScene, place: Path) -> None:
    done: list[int] = []
    timing = timed_production(recorded, [3, 30], folder=place, workers=2, ray=None, advance=lambda: done.append(1))
    assert [run.scenes for run in timing.runs] == [3, 30] and len(done) == 2
    assert [run.index_writes for run in timing.runs] == [3, 25], "after each of the first 20, then every second scene"
    for run in timing.runs:
        assert 0.0 < run.copying_s < run.making_s and 0.0 < run.index_s < run.making_s
        assert run.reopening_s > 0.0 and 50.0 < run.peak_mib < 500.0
        assert 0.0 < run.late_ms_per_scene * run.scenes / 2 < (run.making_s - run.copying_s) * 1e3 + 1.0
    assert [len(row) for row in timing.rows()] == [8, 8]
    assert not list(place.iterdir())


def test_the_dataset_of_copies_is_complete(recorded: RecordedScene, place: Path) -> None:
    driver_timing._make(recorded, 5, place, 2, None)
    bags = sorted((place / "scenes/val").iterdir())
    table, damaged = update_index(place, bags)
    assert table["number"].to_pylist() == list(range(5)) and not damaged
    assert not (place / ".making").exists() and len(list((place / "logs").iterdir())) == 5


@pytest.fixture
def address() -> Iterator[str]:
    """Address of a cluster of one node."""
    pytest.importorskip("ray", reason="Ray is not installed: pip install -e .[cluster]")
    from ray_nodes import RayNodes

    nodes = RayNodes(1)
    yield nodes.address
    nodes.close()


@pytest.mark.slow
def test_actors_on_a_cluster_make_the_same_dataset(recorded: RecordedScene, place: Path, address: str) -> None:
    timing = timed_production(recorded, [30], folder=place, workers=1, ray=address)
    [run] = timing.runs
    assert (run.scenes, run.index_writes, run.copying_s) == (30, 25, 0.0) and run.making_s > 0.0
    assert not list(place.iterdir()) and timing.pool == "actors on a Ray cluster"
