"""A scene moves into a dataset in an object store: killed before any step, the driver leaves it there or missing."""

from contextlib import AbstractContextManager, closing, nullcontext
from dataclasses import dataclass
from pathlib import Path

import pytest
from bucket_content import DieAfter, Killed, files, objects
from made_up_scene import made_up_scene
from store_server import BUCKET, StoreServer, upload

from simbev_ros.dataset import growing_index
from simbev_ros.dataset.index import read_index, update_index
from simbev_ros.dataset.index_row import Row, index_row
from simbev_ros.dataset.plan import Plan, PlannedEntry, bag_of
from simbev_ros.dataset.stored_index import StoredIndex, load_stored_index
from simbev_ros.foundation.object_store.connection import StoreError
from simbev_ros.foundation.object_store.object_path import ObjectPath
from simbev_ros.foundation.object_store.transfers import list_objects
from simbev_ros.production.dataset_storage import lock_dataset, open_storage
from simbev_ros.recording.layout import scenes_of

SET = ObjectPath(BUCKET, "sets/a")
ENTRY = PlannedEntry(number=1, map="Blocks", split="train")
BAG = "scenes/train/Blocks-0001"


@dataclass
class Made:
    """A scene in a worker's folder, and the dataset before and after its commit."""

    folder: Path
    before: Path
    after: dict[str, bytes]
    row: Row

    def commit(self, dataset: ObjectPath, death: AbstractContextManager[None] | None = None) -> None:
        """Have it uploaded and committed; ``death`` befalls the driver that commits it."""
        bag = bag_of(self.folder, ENTRY)
        with lock_dataset(dataset) as lock:
            storage = open_storage(dataset, lock, [], 0)
            uploader = storage.uploader_for("worker-1")
            assert uploader is not None
            uploader.upload(bag, ENTRY)
            with death or nullcontext(), closing(storage):
                storage.commit("worker-1", ENTRY, self.row)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Made:
    """A dataset of two scenes. The one to replace is larger, has a second file without messages, and another bag."""
    folder = tmp_path_factory.mktemp("commit")
    for number, ticks in enumerate((2, 3)):
        made_up_scene(folder / f"before/scenes/train/Blocks-000{number}", number=number, ticks=ticks, sensors=[])
    made_up_scene(folder / "made" / BAG, number=1, ticks=2, sensors=[])
    (folder / "before" / BAG / "Blocks-0001_1.mcap").touch()
    update_index(folder / "before", scenes_of(folder / "before"))
    after = files(folder / "before")
    after = {key: content for key, content in after.items() if not key.startswith(BAG)} | files(folder / "made")
    after = {**after, ".lock": b""}
    del after["index.parquet"]
    (folder / f"before/{BAG}.rear").mkdir()
    (folder / f"before/{BAG}.rear/Blocks-0001.rear_0.mcap").write_bytes(b"2")
    return Made(folder / "made", folder / "before", after, index_row(folder / "made" / BAG, folder / "made"))


def state(dataset: ObjectPath, made: Made) -> str:
    """Which scene there is, all of whose objects must be there."""
    rows = {row["number"]: row for row in load_stored_index(dataset).to_pylist()}
    assert 0 in rows
    if ENTRY.number not in rows:
        return "missing"
    there = {key: content for key, content in objects(dataset).items() if key.startswith(f"{BAG}/")}
    old = {key: content for key, content in files(made.before).items() if key.startswith(f"{BAG}/")}
    expected = {"old": old, "new": files(made.folder)}
    found = next(name for name, content in expected.items() if content == there)
    assert rows[1]["bytes"] == sum(len(content) for key, content in there.items() if key.endswith(".mcap"))
    return found


@pytest.mark.slow
@pytest.mark.parametrize(
    "growth",
    [
        pytest.param(20, id="the index is written at once", marks=pytest.mark.slow),
        pytest.param(0, id="rows wait as objects"),
    ],
)
def test_a_driver_killed_at_any_step_leaves_the_old_scene_or_none_or_the_new_one(
    made: Made, store: StoreServer, die_after: DieAfter, monkeypatch: pytest.MonkeyPatch, growth: int
) -> None:
    monkeypatch.setattr(growing_index, "_GROWTH", growth)
    seen, writes = list[str](), 0
    while True:
        dataset = ObjectPath(BUCKET, f"sets/{writes}")
        upload(made.before, dataset.key)
        try:
            made.commit(dataset, die_after(writes))
            break
        except Killed:
            seen.append(state(dataset, made))
        if seen[-1] == "missing":
            made.commit(dataset)
        elif seen[-1] == "new":
            with lock_dataset(dataset) as lock:
                open_storage(dataset, lock, [], 0).close()
        if seen[-1] != "old":
            found = objects(dataset)
            assert [row["number"] for row in read_index(dataset)] == [0, 1]
            assert {key: found[key] for key in found.keys() - {"index.parquet"}} == made.after
        writes += 1
    assert list(dict.fromkeys(seen)) == ["old", "missing", "new"] and len(seen) > 6


def test_what_a_lost_worker_has_uploaded_is_removed(made: Made, store: StoreServer) -> None:
    with lock_dataset(SET) as lock, closing(open_storage(SET, lock, [], 0)) as storage:
        for worker in ("worker-1", "worker-2"):
            uploader = storage.uploader_for(worker)
            assert uploader is not None
            uploader.upload(bag_of(made.folder, ENTRY), ENTRY)
        storage.discard("worker-1")
        assert {path.key.split("/")[4] for path in list_objects(SET / ".making")} == {"worker-2"}
    assert not list_objects(SET / ".making")


def test_a_scene_of_which_a_part_is_missing_is_not_committed(made: Made, store: StoreServer) -> None:
    with lock_dataset(SET) as lock, closing(open_storage(SET, lock, [], 0)) as storage:
        with pytest.raises(StoreError, match=rf"Blocks-0001: 0 of {made.row['bytes']:,} bytes exist; the rest was"):
            storage.commit("worker-1", ENTRY, made.row)
        assert len(storage.index) == 0


def test_a_row_waits_as_an_object_until_the_index_is_written(
    made: Made, store: StoreServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    upload(made.before, SET.key)
    monkeypatch.setattr(growing_index, "_GROWTH", 0)
    entries = [PlannedEntry(number=number, map="Blocks", split="train") for number in range(4)]
    Plan().with_entries(entries).save(SET)
    rows, index, row = SET / ".rows", StoredIndex(SET), read_index(SET)[1]
    index.add({**row, "number": 2, "name": "Blocks-0002", "path": "scenes/train/Blocks-0002"})
    assert [path.name for path in list_objects(rows)] == ["2.parquet"]
    assert [row["number"] for row in read_index(SET)] == [0, 1]
    assert Plan.load(SET).finished_entries(SET) == entries[:3]
    index.write()
    assert not list_objects(rows) and [row["number"] for row in read_index(SET)] == [0, 1, 2]


def test_rows_that_a_killed_driver_left_are_in_the_next_index(
    made: Made, store: StoreServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    upload(made.before, SET.key)
    monkeypatch.setattr(growing_index, "_GROWTH", 0)
    row = read_index(SET)[1]
    StoredIndex(SET).add({**row, "number": 2, "name": "Blocks-0002", "path": "scenes/train/Blocks-0002"})
    index = StoredIndex(SET)
    assert len(index) == 3 and 2 in index and index.total_bytes == sum(row["bytes"] for row in read_index(SET))
    assert not list_objects(SET / ".rows") and [row["number"] for row in read_index(SET)] == [0, 1, 2]
