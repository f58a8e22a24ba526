"""The driver of production with several workers: who tries what again where, and what ends production."""

from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest
from fake_pool import FakePool

from simbev_ros.dataset.index import read_index
from simbev_ros.dataset.plan import PlannedEntry, bag_of
from simbev_ros.foundation.errors import DiskError, GraphError, InputError, SimbevError
from simbev_ros.production import ProductionObserver
from simbev_ros.production.dataset_maker import DatasetMaker, Outcome
from simbev_ros.production.events import ProductionEvent, SceneRetried
from simbev_ros.production.folder_storage import FolderStorage
from simbev_ros.production.observer import SILENT
from simbev_ros.production.replay.storage import ReplayStorage
from simbev_ros.production.scene_ending import FailedScene, LostScene
from simbev_ros.recording.layout import bytes_of, scenes_folder


@pytest.fixture
def folder(tmp_path: Path) -> Iterator[FolderStorage]:
    scenes_folder(tmp_path / "set").mkdir(parents=True)
    with closing(FolderStorage(tmp_path / "set", [], 0)) as folder:
        yield folder


def entries(count: int) -> list[PlannedEntry]:
    return [PlannedEntry(number=number, map="Blocks", split="train") for number in range(count)]


def make(
    folder: FolderStorage, pool: FakePool, scenes: int, retries: int = 0, observer: ProductionObserver | None = None
) -> Outcome:
    return DatasetMaker(folder, pool, retries=retries, observer=observer or SILENT).make(entries(scenes))


def failures(*errors: SimbevError) -> list[FailedScene | LostScene]:
    return [FailedScene(error, {"world": "a line"}) for error in errors]


def attempts(pool: FakePool, scene: int) -> list[str]:
    """Machines of the attempts at a scene."""
    return [machine for number, machine in pool.given if number == scene]


def test_several_workers_make_each_scene_once(folder: FolderStorage, tmp_path: Path) -> None:
    pool = FakePool(folder.staging, "a", "a", "a")
    outcome = make(folder, pool, 7)
    assert sorted(entry.number for entry in outcome.made) == list(range(7)) and not outcome.failed
    assert sorted(number for number, _ in pool.given) == list(range(7))
    folder.close()
    assert [row["number"] for row in read_index(tmp_path / "set")] == list(range(7))
    assert not folder.staging.parent.exists()


def test_a_failed_scene_is_tried_on_another_machine_first(folder: FolderStorage) -> None:
    pool = FakePool(folder.staging, "a", "a", "b")
    pool.endings = {0: failures(GraphError("world died"))}
    outcome = make(folder, pool, 6)
    assert attempts(pool, 0) == ["a", "b"] and len(outcome.made) == 6
    assert pool.given.index((3, "a")) < pool.given.index((0, "b")), "the first machine continues with other scenes"


def test_a_scene_that_failed_on_all_machines_is_tried_again_up_to_the_number_of_retries(folder: FolderStorage) -> None:
    pool = FakePool(folder.staging, "a", "b")
    pool.endings = {0: failures(*(GraphError(f"problem {k}") for k in range(9)))}
    assert make(folder, pool, 3, retries=3).failed == {"Blocks-0000": "problem 3"}
    assert len(attempts(pool, 0)) == 4 and set(attempts(pool, 0)[:2]) == {"a", "b"}


def test_the_log_of_each_attempt_names_its_worker(folder: FolderStorage, tmp_path: Path) -> None:
    pool = FakePool(folder.staging, "a", "b")
    pool.endings = {0: failures(GraphError("world died"))}
    make(folder, pool, 1)
    failed, made = ((tmp_path / f"set/logs/Blocks-0000{kind}.log").read_text() for kind in (".failed-1", ""))
    assert failed.startswith("Blocks-0000, attempt 1 on worker-1, a, began ") and "--- world\na line\n" in failed
    assert made.startswith("Blocks-0000, attempt 2 on worker-2, b, began ")


def test_nine_lost_workers_are_no_failure_of_their_scene(folder: FolderStorage) -> None:
    pool = FakePool(folder.staging, "a")
    pool.endings = {0: [LostScene("killed")] * 9}
    outcome = make(folder, pool, 2)
    assert [entry.number for entry in outcome.made] == [0, 1] and not outcome.failed


def test_the_tenth_lost_worker_is_one(folder: FolderStorage) -> None:
    pool = FakePool(folder.staging, "a")
    pool.endings = {0: [LostScene("killed")] * 10}
    outcome = make(folder, pool, 2, retries=5)
    assert outcome.failed == {"Blocks-0000": "10 workers were lost while they made it; the last one: killed"}
    assert [entry.number for entry in outcome.made] == [1]


def test_losses_leave_the_retries_for_failures(folder: FolderStorage) -> None:
    pool = FakePool(folder.staging, "a")
    pool.endings = {0: [LostScene("killed"), LostScene("killed"), *failures(GraphError("world died"))]}
    assert len(make(folder, pool, 1, retries=1).made) == 1 and len(attempts(pool, 0)) == 4


def test_the_folder_of_a_lost_worker_is_removed_before_its_scene_is_made_again(
    folder: FolderStorage, tmp_path: Path
) -> None:
    left: list[list[str]] = []

    class Looking(ProductionObserver):
        def notify(self, event: ProductionEvent) -> None:
            if isinstance(event, SceneRetried):
                left.append(sorted(path.name for path in folder.staging.iterdir()))

    pool = FakePool(folder.staging, "a", "a")
    pool.endings = {0: [LostScene("worker-1 died: killed")]}
    make(folder, pool, 2, observer=Looking())
    assert left == [["worker-2"]]
    assert "\nworker-1 died: killed\n" in (tmp_path / "set/logs/Blocks-0000.failed-1.log").read_text()


def test_workers_of_another_run_have_other_folders(folder: FolderStorage, tmp_path: Path) -> None:
    other = FolderStorage(tmp_path / "set", [], 0)
    assert folder.staging != other.staging and folder.staging.parent == other.staging.parent == tmp_path / "set/.making"


def test_bad_input_on_one_machine_is_tried_on_the_other(folder: FolderStorage) -> None:
    pool = FakePool(folder.staging, "a", "b")
    pool.endings = {0: failures(InputError("no GPU")), 2: failures(InputError("no GPU"))}
    outcome = make(folder, pool, 4)
    assert len(outcome.made) == 4 and set(attempts(pool, 0)) == set(attempts(pool, 2)) == {"a", "b"}


@pytest.mark.parametrize("machines", ["a", "aa", "ab"])
def test_the_first_scene_that_fails_everywhere_by_bad_input_ends_production(
    folder: FolderStorage, machines: str
) -> None:
    pool = FakePool(folder.staging, *machines)
    pool.endings = {number: failures(*(InputError(f"bad {number}"),) * 2) for number in range(5)}
    with pytest.raises(InputError, match="bad 0"):
        make(folder, pool, 5)
    assert set(attempts(pool, 0)) == set(machines)


def test_bad_input_of_a_later_scene_is_listed_even_if_none_is_made_yet(folder: FolderStorage) -> None:
    pool = FakePool(folder.staging, "a", "a")
    pool.latest_first = True
    pool.endings = {1: failures(InputError("no map"))}
    outcome = make(folder, pool, 3)
    assert outcome.failed == {"Blocks-0001": "no map"} and len(outcome.made) == 2


def test_a_full_disk_of_one_machine_is_left_to_the_other(folder: FolderStorage) -> None:
    pool = FakePool(folder.staging, "a", "b")
    pool.endings = {1: failures(DiskError("full"))}
    assert len(make(folder, pool, 3).made) == 3 and len(attempts(pool, 1)) == 2


def test_a_disk_that_is_full_everywhere_ends_production(folder: FolderStorage, tmp_path: Path) -> None:
    pool = FakePool(folder.staging, "a", "b")
    pool.endings = {2: failures(DiskError("full"), DiskError("full"))}
    with pytest.raises(DiskError, match="full; finished scenes are in the dataset"):
        make(folder, pool, 9, retries=5)
    assert len(attempts(pool, 2)) == 2
    made = {path.name for path in scenes_folder(tmp_path / "set").glob("*/*")}
    assert made >= {"Blocks-0000", "Blocks-0001"}


def test_scenes_with_one_number_in_different_splits_have_histories_of_their_own(tmp_path: Path) -> None:
    replays = [PlannedEntry(number=0, map="Blocks", split=split) for split in ("train", "val")]
    targets = {entry: bag_of(tmp_path / "set", entry) for entry in replays}
    with closing(ReplayStorage(tmp_path / "set", targets, [], 0)) as storage:
        pool = FakePool(storage.staging, "a", "a")
        pool.endings = {0: failures(GraphError("world died"), GraphError("world died"))}
        outcome = DatasetMaker(storage, pool, retries=1).make(replays)
    assert not outcome.failed and all(target.is_dir() for target in targets.values())


def test_replays_are_tried_elsewhere_after_a_failure_and_again_after_a_loss(tmp_path: Path) -> None:
    replays = entries(3)
    targets = {entry: bag_of(tmp_path, entry).with_suffix(".rear") for entry in replays}
    with closing(ReplayStorage(tmp_path, targets, [], 0)) as storage:
        pool = FakePool(storage.staging, "a", "b")
        pool.endings = {0: failures(GraphError("world died")), 1: [LostScene("killed")]}
        outcome = DatasetMaker(storage, pool, retries=0).make(replays)
        assert storage.total_bytes == sum(bytes_of(target) for target in targets.values()) > 0
    assert len(outcome.made) == 3 and set(attempts(pool, 0)) == {"a", "b"} and len(attempts(pool, 1)) == 2
    assert sorted(path.name for path in tmp_path.iterdir()) == ["logs", "scenes"]
    logs = {path.name for path in (tmp_path / "logs").iterdir()}
    assert {"Blocks-0000.rear.failed-1.log", "Blocks-0000.rear.log", "Blocks-0001.rear.failed-1.log"} <= logs


def test_a_replay_does_not_take_the_place_of_a_bag_that_has_appeared_meanwhile(tmp_path: Path) -> None:
    (entry,) = entries(1)
    target = bag_of(tmp_path, entry)
    with closing(ReplayStorage(tmp_path, {entry: target}, [], 0)) as storage:
        target.mkdir(parents=True)
        (target / "precious").touch()
        with pytest.raises(InputError, match=r"Blocks-0000: cannot be written: Directory not empty$"):
            DatasetMaker(storage, FakePool(storage.staging, "a"), retries=0).make([entry])
    assert [path.name for path in target.iterdir()] == ["precious"]


def test_space_is_required_for_all_scenes_in_the_making(folder: FolderStorage, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[int] = []
    monkeypatch.setattr(folder, "check_space", asked.append)
    make(folder, FakePool(folder.staging, "a", "a", "a"), 5)
    assert asked == [1, 2, 3, 3, 3]
