"""Datasets made in an object store: the bytes of a folder's, whatever fails or is killed, and nothing else is left."""

import errno
from contextlib import suppress
from pathlib import Path

import pytest
from bucket_content import DieAfter, Killed, files, objects
from fake_graph import FakeGraph, Scenarios
from store_server import BUCKET, StoreServer

from simbev_ros.dataset.index import read_index
from simbev_ros.foundation.errors import DiskError, GraphError, InputError
from simbev_ros.foundation.object_store.connection import StoreError
from simbev_ros.foundation.object_store.object_lock import ObjectLock
from simbev_ros.foundation.object_store.object_path import ObjectPath
from simbev_ros.foundation.object_store.transfers import list_objects, put_bytes
from simbev_ros.production import make_dataset, object_upload

SET = ObjectPath(BUCKET, "sets/a")


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
    assert objects(SET) == folder
    assert [path.name for path in (SET / "logs").iterdir()] == ["Blocks-0000.log", "Blocks-0001.log"]
    assert not list(temporary.iterdir())


@pytest.mark.slow
def test_a_whole_bucket_can_be_a_dataset(folder: dict[str, bytes], scenario: Scenarios, store: StoreServer) -> None:
    assert make_dataset(scenario(2), f"s3://{BUCKET}").is_complete
    assert objects(ObjectPath(BUCKET)) == folder


@pytest.mark.slow
def test_existing_scenes_count(graph: FakeGraph, scenario: Scenarios, store: StoreServer) -> None:
    make_dataset(scenario(1), SET)
    result = make_dataset(scenario(2), SET)
    assert [entry.number for entry in result.made] == [1] and [entry.number for entry in result.skipped] == [0]
    assert [row["number"] for row in read_index(SET)] == [0, 1]


@pytest.mark.slow
def test_a_driver_killed_at_any_moment_leaves_what_the_next_one_completes(
    graph: FakeGraph, scenario: Scenarios, store: StoreServer, die_after: DieAfter, tmp_path: Path
) -> None:
    make_dataset(scenario(1), tmp_path / "set")
    for writes in range(0, 99, 5):
        dataset = ObjectPath(BUCKET, f"sets/{writes}")
        with suppress(Killed), die_after(writes):
            make_dataset(scenario(1), dataset)
            break
        make_dataset(scenario(1), dataset)
        assert objects(dataset) == files(tmp_path / "set"), f"killed after {writes} writes"
    assert writes > 12


@pytest.mark.slow
def test_an_upload_that_fails_is_tried_again_with_its_scene(
    folder: dict[str, bytes], graph: FakeGraph, scenario: Scenarios, store: StoreServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    problems, put_file = [StoreError("s3://made-up/x: SLOW_DOWN")], object_upload.put_file

    def put(source: Path, target: ObjectPath) -> None:
        put_file(source, target)
        if problems and source.suffix == ".yaml":
            raise problems.pop()

    monkeypatch.setattr(object_upload, "put_file", put)
    assert make_dataset(scenario(2), SET).is_complete and objects(SET) == folder
    failed = (SET / "logs/Blocks-0000.failed-1.log").read_bytes().decode()
    assert "\nBlocks-0000 was made, but could not be uploaded: s3://made-up/x: SLOW_DOWN\n" in failed


@pytest.mark.slow
def test_an_upload_that_fails_for_good_is_listed_with_its_scene(
    graph: FakeGraph, scenario: Scenarios, store: StoreServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    def put(source: Path, target: ObjectPath) -> None:
        raise StoreError("s3://made-up/x: SLOW_DOWN")

    monkeypatch.setattr(object_upload, "put_file", put)
    result = make_dataset(scenario(2), SET, retries=1)
    problem = "was made, but could not be uploaded: s3://made-up/x: SLOW_DOWN"
    assert result.failed == {f"Blocks-000{number}": f"Blocks-000{number} {problem}" for number in (0, 1)}
    assert graph.log.count("Blocks-0000") == 2
    assert sorted(objects(SET)) == [".lock", "index.parquet", "plan.json"]


@pytest.mark.slow
def test_a_full_local_disk_ends_production_and_keeps_finished_scenes(
    graph: FakeGraph, scenario: Scenarios, store: StoreServer, monkeypatch: pytest.MonkeyPatch, temporary: Path
) -> None:
    def put(source: Path, target: ObjectPath) -> None:
        raise OSError(errno.ENOSPC, "No space left on device", str(source))

    make_dataset(scenario(1), SET)
    monkeypatch.setattr(object_upload, "put_file", put)
    with pytest.raises(DiskError, match="the disk is full; finished scenes are in the dataset"):
        make_dataset(scenario(2), SET)
    assert [row["number"] for row in read_index(SET)] == [0] and not list(temporary.iterdir())
    assert not list_objects(SET / ".making")


def test_what_dead_runs_have_left_is_removed(graph: FakeGraph, scenario: Scenarios, store: StoreServer) -> None:
    put_bytes(b"1", SET / ".making/dead/worker-1/scenes/train/Blocks-0000/Blocks-0000_0.mcap")
    graph.problems = {0: [GraphError("died")] * 3}
    make_dataset(scenario(1), SET)
    assert not list_objects(SET / ".making")


@pytest.mark.slow
def test_objects_of_another_size_are_reported_as_damage(
    graph: FakeGraph, scenario: Scenarios, store: StoreServer
) -> None:
    make_dataset(scenario(1), SET)
    before = len(objects(SET)["scenes/train/Blocks-0000/Blocks-0000_0.mcap"])
    put_bytes(b"123", SET / "scenes/train/Blocks-0000/Blocks-0000_0.mcap")
    result = make_dataset(scenario(1), SET)
    problem = f"its MCAP files have 3 bytes, and {before:,} according to the index"
    assert result.damaged == {"Blocks-0000": problem} and not result.skipped
    assert make_dataset(scenario(1), SET, replace=[0]).is_complete


def test_a_driver_whose_dataset_was_taken_over_touches_nothing_more(
    graph: FakeGraph, scenario: Scenarios, store: StoreServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    put_file = object_upload.put_file

    def put(source: Path, target: ObjectPath) -> None:
        put_file(source, target)
        put_bytes(b'{"host": "other", "pid": 7, "token": "x"}', SET / ".lock")

    monkeypatch.setattr(object_upload, "put_file", put)
    with pytest.raises(
        InputError, match=r"^s3://made-up/sets/a: process 7 on other has taken over; this process stops"
    ):
        make_dataset(scenario(1), SET)
    assert sorted(objects(SET)) == [".lock", "index.parquet", "plan.json"] and read_index(SET) == []
    assert b"other" in objects(SET)[".lock"]


def test_an_interrupt_leaves_finished_scenes_and_frees_the_dataset(
    folder: dict[str, bytes], graph: FakeGraph, scenario: Scenarios, store: StoreServer, temporary: Path
) -> None:
    graph.problems = {1: [KeyboardInterrupt()]}
    with pytest.raises(KeyboardInterrupt):
        make_dataset(scenario(2), SET)
    assert {key for key in objects(SET) if "/" in key} == {key for key in folder if "/Blocks-0000/" in key}
    assert [row["number"] for row in read_index(SET)] == [0] and not list(temporary.iterdir())
    assert make_dataset(scenario(2), SET).is_complete and objects(SET) == folder


def test_a_second_driver_is_refused(graph: FakeGraph, scenario: Scenarios, store: StoreServer) -> None:
    with ObjectLock(SET), pytest.raises(InputError, match="is writing into it"):
        make_dataset(scenario(1), SET)
    assert sorted(objects(SET)) == [".lock"] and graph.log == []


def test_a_damaged_row_is_refused_before_anything_is_written(
    graph: FakeGraph, scenario: Scenarios, store: StoreServer
) -> None:
    put_bytes(b"x", SET / ".rows/0.parquet")
    with pytest.raises(InputError, match=r"^s3://made-up/sets/a/\.rows/0\.parquet: "):
        make_dataset(scenario(1), SET)
    assert sorted(objects(SET)) == [".rows/0.parquet"] and graph.log == []
