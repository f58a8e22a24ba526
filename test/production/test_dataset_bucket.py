"""Datasets made in an object store: the bytes of a folder's, whatever fails or is killed, and nothing else is left."""

import errno
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from fake_graph import FakeGraph, Scenarios
from made_up_scene import made_up_scene
from store_server import BUCKET, StoreServer, upload

from simbev_ros.dataset import growing_index
from simbev_ros.dataset.index import read_index, update_index
from simbev_ros.errors import DiskError, GraphError, InputError
from simbev_ros.object_store import object_lock
from simbev_ros.object_store.connection import StoreError, connection
from simbev_ros.object_store.object_lock import ObjectLock
from simbev_ros.object_store.object_path import ObjectPath
from simbev_ros.object_store.transfers import list_objects, put_bytes
from simbev_ros.production import make_dataset, object_delivery
from simbev_ros.recording.layout import scenes_of

SET = ObjectPath(BUCKET, "sets/a")
_WRITES = ("open_output_stream", "copy_file", "delete_dir", "delete_file")


class Killed(BaseException):
    """The driver was killed: nothing of it can write any more."""


@pytest.fixture
def die_after(monkeypatch: pytest.MonkeyPatch) -> Callable[[int], None]:
    """Function that lets this process write, copy or delete a number of times, and then never again."""

    def arrange(writes: int) -> None:
        files, left = connection().files, iter(range(writes))

        class Files:
            def __getattr__(self, name: str) -> Any:
                if name in _WRITES and next(left, None) is None:
                    raise Killed
                return getattr(files, name)

        monkeypatch.setattr(connection(), "files", Files())

    return arrange


@pytest.fixture
def revive(monkeypatch: pytest.MonkeyPatch) -> Callable[[], None]:
    """Function after which the process writes again, a minute later."""

    def arrange() -> None:
        monkeypatch.undo()
        monkeypatch.setattr(object_lock, "_EXPIRY_S", 0.0)

    return arrange


def objects(dataset: ObjectPath = SET) -> dict[str, bytes]:
    """Content of the objects of a dataset, except for logs."""
    found = {str(path.relative_to(dataset)): path.read_bytes() for path in list_objects(dataset)}
    return {key: content for key, content in found.items() if not key.startswith("logs/")}


def files(dataset: Path) -> dict[str, bytes]:
    found = {str(path.relative_to(dataset)): path.read_bytes() for path in dataset.rglob("*") if path.is_file()}
    return {key: content for key, content in found.items() if not key.startswith("logs/")}


@pytest.fixture
def folder(graph: FakeGraph, scenario: Scenarios, tmp_path: Path) -> dict[str, bytes]:
    """Files of two scenes made into a folder."""
    make_dataset(scenario(2), tmp_path / "set")
    return files(tmp_path / "set")


@pytest.fixture
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder for temporary files."""
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "temporary"))
    return tmp_path / "temporary"


@pytest.mark.parametrize("refuse_every", [0, 5])
def test_the_bytes_are_those_of_a_folder(
    folder: dict[str, bytes], scenario: Scenarios, store: StoreServer, temporary: Path, refuse_every: int
) -> None:
    store.refuse_every = refuse_every
    result = make_dataset(scenario(2), str(SET))
    store.reset()
    assert result.path == SET and result.is_complete and len(result.made) == 2
    assert objects() == folder
    assert [path.name for path in (SET / "logs").iterdir()] == ["Blocks-0000.log", "Blocks-0001.log"]
    assert not list(temporary.iterdir())


def test_existing_scenes_count(graph: FakeGraph, scenario: Scenarios, store: StoreServer) -> None:
    make_dataset(scenario(1), SET)
    result = make_dataset(scenario(2), SET)
    assert [entry.number for entry in result.made] == [1] and [entry.number for entry in result.skipped] == [0]
    assert [row["number"] for row in read_index(SET)] == [0, 1]


def test_a_driver_killed_before_any_write_loses_no_scene_and_leaves_no_half_of_one(
    graph: FakeGraph,
    scenario: Scenarios,
    store: StoreServer,
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    die_after: Callable[[int], None],
) -> None:
    make_dataset(scenario(2), tmp_path / "set")
    monkeypatch.setattr(growing_index, "_GROWTH", 0)  # rows stay objects of their own until the end
    monkeypatch.setattr(object_lock, "_EXPIRY_S", 0.0)
    files_of_store, has_ended, writes = connection().files, False, 0
    while not has_ended:
        dataset = ObjectPath(BUCKET, f"sets/{writes}")
        die_after(writes)
        try:
            make_dataset(scenario(2), dataset)
            has_ended = True
        except Killed:
            pass
        monkeypatch.setattr(connection(), "files", files_of_store)
        before = len(read_index(dataset)) + len(list_objects(dataset / ".rows"))
        result = make_dataset(scenario(2), dataset)
        assert len(result.made) == 2 - min(before, 2), f"killed after {writes} writes"
        assert objects(dataset) == files(tmp_path / "set"), f"killed after {writes} writes"
        writes += 1
    assert writes > 20


def old_dataset(folder: Path) -> None:
    """Two scenes, the second of which is larger than the one that replaces it, in two files, and has another bag."""
    for number, ticks in enumerate((2, 3)):
        made_up_scene(folder / f"scenes/train/Blocks-000{number}", number=number, ticks=ticks)
    bag = folder / "scenes/train/Blocks-0001"
    (bag / "Blocks-0001_1.mcap").write_bytes(b"1")
    update_index(folder, scenes_of(folder))
    bag.with_name("Blocks-0001.rear").mkdir()
    (bag.with_name("Blocks-0001.rear") / "Blocks-0001.rear_0.mcap").write_bytes(b"2")


def test_a_replaced_scene_is_the_old_one_or_missing_or_the_new_one(
    folder: dict[str, bytes],
    scenario: Scenarios,
    store: StoreServer,
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    die_after: Callable[[int], None],
) -> None:
    old_dataset(tmp_path / "old")
    old = {key: content for key, content in files(tmp_path / "old").items() if "/Blocks-0001/" in key}
    new = {key: content for key, content in folder.items() if "/Blocks-0001/" in key}
    monkeypatch.setattr(object_lock, "_EXPIRY_S", 0.0)
    files_of_store, has_ended, writes, seen = connection().files, False, 0, []
    while not has_ended:
        dataset = ObjectPath(BUCKET, f"sets/{writes}")
        upload(tmp_path / "old", dataset.key)
        die_after(writes)
        try:
            make_dataset(scenario(2), dataset, replace=[1])
            has_ended = True
        except Killed:
            pass
        monkeypatch.setattr(connection(), "files", files_of_store)
        rows = [row for row in read_index(dataset) if row["number"] == 1]
        there = {
            key: content for key, content in objects(dataset).items() if key.startswith("scenes/train/Blocks-0001/")
        }
        if rows:
            size = sum(len(content) for key, content in there.items() if key.endswith(".mcap"))
            assert there in (old, new) and rows[0]["bytes"] == size, f"killed after {writes} writes"
        seen.append("missing" if not rows else "old" if there == old else "new")
        make_dataset(scenario(2), dataset, replace=[1] if seen[-1] == "old" else [])
        assert objects(dataset) == folder, f"killed after {writes} writes"
        writes += 1
    assert list(dict.fromkeys(seen)) == ["old", "missing", "new"]


def test_rows_of_a_killed_driver_count_as_scenes_in_the_plan(
    graph: FakeGraph, scenario: Scenarios, store: StoreServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(growing_index, "_GROWTH", 0)
    graph.problems = {1: [Killed()]}
    monkeypatch.setattr(growing_index.GrowingIndex, "write", lambda _: None)
    with pytest.raises(Killed):
        make_dataset(scenario(2), SET)


def test_an_upload_that_fails_is_tried_again_with_its_scene(
    folder: dict[str, bytes], graph: FakeGraph, scenario: Scenarios, store: StoreServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    problems, put_file = [StoreError("s3://made-up/x: SLOW_DOWN")], object_delivery.put_file

    def put(source: Path, target: ObjectPath) -> None:
        put_file(source, target)
        if problems and source.suffix == ".yaml":
            raise problems.pop()

    monkeypatch.setattr(object_delivery, "put_file", put)
    assert make_dataset(scenario(2), SET).is_complete and objects() == folder
    failed = (SET / "logs/Blocks-0000.failed-1.log").read_bytes().decode()
    assert "\nBlocks-0000 was made, but could not be uploaded: s3://made-up/x: SLOW_DOWN\n" in failed


def test_an_upload_that_fails_for_good_is_listed_with_its_scene(
    graph: FakeGraph, scenario: Scenarios, store: StoreServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    def put(source: Path, target: ObjectPath) -> None:
        raise StoreError("s3://made-up/x: SLOW_DOWN")

    monkeypatch.setattr(object_delivery, "put_file", put)
    result = make_dataset(scenario(2), SET, retries=1)
    problem = "was made, but could not be uploaded: s3://made-up/x: SLOW_DOWN"
    assert result.failed == {f"Blocks-000{number}": f"Blocks-000{number} {problem}" for number in (0, 1)}
    assert graph.log.count("Blocks-0000") == 2
    assert sorted(objects()) == [".lock", "index.parquet", "plan.json"]


def test_a_full_local_disk_ends_production_and_keeps_finished_scenes(
    graph: FakeGraph, scenario: Scenarios, store: StoreServer, monkeypatch: pytest.MonkeyPatch, temporary: Path
) -> None:
    def put(source: Path, target: ObjectPath) -> None:
        raise OSError(errno.ENOSPC, "No space left on device", str(source))

    make_dataset(scenario(1), SET)
    monkeypatch.setattr(object_delivery, "put_file", put)
    with pytest.raises(DiskError, match="the disk is full; finished scenes are in the dataset"):
        make_dataset(scenario(2), SET)
    assert [row["number"] for row in read_index(SET)] == [0] and not list(temporary.iterdir())
    assert not list_objects(SET / ".making")


def test_what_dead_runs_have_left_is_removed(graph: FakeGraph, scenario: Scenarios, store: StoreServer) -> None:
    put_bytes(b"1", SET / ".making/dead/worker-1/scenes/train/Blocks-0000/Blocks-0000_0.mcap")
    graph.problems = {0: [GraphError("died")] * 3}
    make_dataset(scenario(1), SET)
    assert not list_objects(SET / ".making")


def test_objects_of_another_size_are_reported_as_damage(
    graph: FakeGraph, scenario: Scenarios, store: StoreServer
) -> None:
    make_dataset(scenario(2), SET)
    before = len(objects()["scenes/train/Blocks-0001/Blocks-0001_0.mcap"])
    put_bytes(b"123", SET / "scenes/train/Blocks-0001/Blocks-0001_0.mcap")
    result = make_dataset(scenario(2), SET)
    problem = f"its MCAP files have 3 bytes, and {before:,} according to the index"
    assert result.damaged == {"Blocks-0001": problem} and [entry.number for entry in result.skipped] == [0]
    assert make_dataset(scenario(2), SET, replace=[1]).is_complete


def test_a_driver_whose_dataset_was_taken_over_touches_nothing_more(
    graph: FakeGraph, scenario: Scenarios, store: StoreServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    put_file = object_delivery.put_file

    def put(source: Path, target: ObjectPath) -> None:
        put_file(source, target)
        put_bytes(b'{"host": "other", "pid": 7, "token": "x"}', SET / ".lock")

    monkeypatch.setattr(object_delivery, "put_file", put)
    with pytest.raises(InputError, match=r"^s3://made-up/sets/a: process 7 on other has begun to write into it"):
        make_dataset(scenario(1), SET)
    assert sorted(objects()) == [".lock", "index.parquet", "plan.json"] and read_index(SET) == []
    assert b"other" in objects()[".lock"]


def test_a_second_driver_is_refused(graph: FakeGraph, scenario: Scenarios, store: StoreServer) -> None:
    with ObjectLock(SET), pytest.raises(InputError, match="is writing into it"):
        make_dataset(scenario(1), SET)
    assert sorted(objects()) == [".lock"] and graph.log == []


def test_a_damaged_row_is_refused_before_anything_is_written(
    graph: FakeGraph, scenario: Scenarios, store: StoreServer
) -> None:
    put_bytes(b"x", SET / ".rows/0.parquet")
    with pytest.raises(InputError, match=r"^s3://made-up/sets/a/\.rows/0\.parquet: "):
        make_dataset(scenario(1), SET)
    assert sorted(objects()) == [".rows/0.parquet"] and graph.log == []
