"""Datasets in an object store read as those in folders do, with few requests, also from a busy store."""

import multiprocessing
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_up_scene import made_up_scene
from store_server import BUCKET, StoreServer, upload

from simbev_ros.dataset import Dataset, open_dataset
from simbev_ros.dataset.fetched_check import verify_fetched_bag
from simbev_ros.dataset.index import indexed_bags, read_index, update_index
from simbev_ros.dataset.parallel import Processes
from simbev_ros.dataset.plan import Plan
from simbev_ros.dataset.statistics import statistics_of
from simbev_ros.foundation.errors import BagError, InputError
from simbev_ros.foundation.object_store.connection import StoreError
from simbev_ros.foundation.object_store.object_path import ObjectPath
from simbev_ros.foundation.object_store.transfers import delete_tree, put_bytes
from simbev_ros.recording.bag_writer import SceneBagWriter
from simbev_ros.recording.indexed_bag import IndexedBag
from simbev_ros.recording.layout import scenes_of
from simbev_ros.recording.mcap.chunk_cache import ChunkCache
from simbev_ros.recording.qos import QosProfile
from simbev_ros.recording.reader import SceneBag
from simbev_ros.recording.verify import verify_bag

TICKS = 4
SCENES = ObjectPath(BUCKET, "sets/first/scenes/train")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    dataset = tmp_path_factory.mktemp("objects") / "first"
    for number in range(2):
        made_up_scene(dataset / f"scenes/train/Blocks-000{number}", number=number, ticks=TICKS)
    update_index(dataset, scenes_of(dataset))
    Plan.load(dataset).save(dataset)
    return dataset


@pytest.fixture
def url(folder: Path, store: StoreServer) -> str:
    address = upload(folder, "sets/first")
    store.reset()
    return address


def bytes_of_frames(dataset: Dataset) -> list[bytes]:
    return [pickle.dumps(frame.load()) for scene in dataset.scenes for frame in scene]


def test_frames_are_equal_to_the_byte(folder: Path, url: str) -> None:
    there, here = open_dataset(url), open_dataset(folder)
    assert [scene.name for scene in there.scenes] == [scene.name for scene in here.scenes]
    assert [scene.spec for scene in there.scenes] == [scene.spec for scene in here.scenes]
    assert bytes_of_frames(there) == bytes_of_frames(here)
    assert there.scenes[0].constants == here.scenes[0].constants


def test_frames_from_a_busy_store_are_equal_to_the_byte(folder: Path, url: str, store: StoreServer) -> None:
    store.refuse_every = 5
    assert bytes_of_frames(open_dataset(url)) == bytes_of_frames(open_dataset(folder))
    assert len(store.requests) > 10


def test_messages_in_order_are_those_of_the_file(folder: Path, url: str) -> None:
    with SceneBag(SCENES / "Blocks-0001") as there, SceneBag(folder / "scenes/train/Blocks-0001") as here:
        assert list(there.messages()) == list(here.messages())
        assert there.attachments == here.attachments and there.custom_data == here.custom_data
        assert there.finished


def test_opening_a_dataset_reads_only_its_index(folder: Path, url: str, store: StoreServer) -> None:
    dataset = open_dataset(url)
    assert [len(scene) for scene in dataset.scenes] == [TICKS] * 2
    assert len(store.requests) == 3
    assert store.sent_bytes == (folder / "index.parquet").stat().st_size


def large_bag(path: Path) -> int:
    """Write a bag of 40 chunks, and return an upper limit on their size."""
    rng = np.random.default_rng(2)
    with SceneBagWriter(path, chunk_bytes=400_000) as writer:
        writer.add_attachment("large.bin", "application/octet-stream", rng.bytes(3 << 20))
        writer.add_topic("/ego/noise", "sensor_msgs/msg/CompressedImage", QosProfile())
        for stamp_ns in range(40):
            writer.write("/ego/noise", stamp_ns, rng.bytes(500_000))
        writer.finish({})
    return 500_100


def test_a_message_costs_one_request_of_its_chunk(tmp_path: Path, store: StoreServer) -> None:
    chunk_bytes = large_bag(tmp_path / "large")
    upload(tmp_path / "large", "large")
    store.reset()
    bag = IndexedBag(ObjectPath(BUCKET, "large"), ChunkCache(1 << 20))
    assert len(store.requests) <= 3 + 41, "a list, a size, the end, and the indexes of messages after each chunk"
    assert store.sent_bytes < 300_000, "the attachment is not read"
    store.reset()
    payload = bag.payload(bag.topics["/ego/noise"].locations[17])
    assert len(store.requests) == 1 and len(payload) < store.sent_bytes < chunk_bytes


def test_one_bag_can_be_opened_by_its_folder_and_by_its_file(folder: Path, url: str) -> None:
    here = pickle.dumps(open_dataset(folder / "scenes/train/Blocks-0001").scenes[0][1].load())
    for address in (f"{url}/scenes/train/Blocks-0001", f"{url}/scenes/train/Blocks-0001/Blocks-0001_0.mcap"):
        assert pickle.dumps(open_dataset(address).scenes[0][1].load()) == here


def _load(scene_and_tick: tuple[Any, int]) -> bytes:
    scene, tick = scene_and_tick
    return pickle.dumps(scene[tick].load())


def test_forked_processes_read_pickled_scenes(folder: Path, url: str) -> None:
    dataset = open_dataset(url)
    bytes_of_frames(dataset)  # this process has its connections before it forks
    work = [(scene, tick) for scene in dataset.scenes for tick in range(TICKS)]
    with multiprocessing.get_context("fork").Pool(2) as pool:
        assert pool.map_async(_load, work).get(30) == bytes_of_frames(open_dataset(folder))


def test_statistics_are_those_of_the_folder(folder: Path, url: str) -> None:
    there, here = (statistics_of(open_dataset(path, threads=1), Processes(2)) for path in (url, folder))
    assert [fact.boxes for fact in there.scenes] == [fact.boxes for fact in here.scenes]
    for name, counts in here.tally.counts.items():
        np.testing.assert_array_equal(there.tally.counts[name], counts)


def test_only_scenes_in_the_index_exist(folder: Path, url: str) -> None:
    put_bytes(b"being written", SCENES / "Blocks-0002/Blocks-0002_0.mcap")
    assert [scene.name for scene in open_dataset(url).scenes] == ["Blocks-0000", "Blocks-0001"]
    assert [bag.name for bag in indexed_bags(ObjectPath(BUCKET, "sets/first"))] == ["Blocks-0000", "Blocks-0001"]


def test_plan_and_index_are_those_of_the_folder(folder: Path, url: str) -> None:
    dataset = ObjectPath(BUCKET, "sets/first")
    assert Plan.load(dataset) == Plan.load(folder)
    assert read_index(dataset) == read_index(folder)
    put_bytes(b"{}", dataset / "plan.json")
    assert [entry.name for entry in Plan.load(dataset).scenes] == ["Blocks-0000", "Blocks-0001"]


def test_a_damaged_index_is_named(url: str) -> None:
    put_bytes(b"PAR1 this is none", ObjectPath(BUCKET, "sets/first/index.parquet"))
    with pytest.raises(InputError, match=rf"{url}/index.parquet: .*rebuilds it"):
        open_dataset(url)


def test_an_index_that_is_replaced_while_it_is_read_is_read_again(
    folder: Path, url: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = (folder / "index.parquet").read_bytes()
    answers = iter([whole[:-9], whole])
    monkeypatch.setattr(ObjectPath, "read_bytes", lambda *_: next(answers))
    assert read_index(ObjectPath(BUCKET, "sets/first")) == read_index(folder)


@pytest.mark.parametrize("size", [0, 5, 4000, -100])
def test_a_cut_off_object_is_refused_without_reading_it(folder: Path, url: str, store: StoreServer, size: int) -> None:
    name = "scenes/train/Blocks-0001/Blocks-0001_0.mcap"
    put_bytes((folder / name).read_bytes()[:size], SCENES / "Blocks-0001/Blocks-0001_0.mcap")
    with pytest.raises(BagError, match=rf"{url}/{name}: not an MCAP file, or cut off"):
        open_dataset(url).scenes[1][0]
    store.reset()
    with pytest.raises(BagError, match=rf"{url}/{name}: not an MCAP file, or cut off"):
        open_dataset(f"{url}/{name}").scenes[0][0]
    assert store.sent_bytes <= 256 << 10


@pytest.mark.parametrize(
    ("url", "kind", "problem"),
    [
        (f"s3://{BUCKET}/none", BagError, "there is no dataset and no bag: no index.parquet, no .mcap file"),
        (f"s3://{BUCKET}/none.mcap", BagError, "cannot be read: no such object"),
        ("s3://nobody/none", StoreError, "there is no bucket 'nobody'"),
        ("ftp://host/none", InputError, "URLs with ftp:// are not supported"),
    ],
)
def test_a_url_without_a_dataset_is_refused(store: StoreServer, url: str, kind: type, problem: str) -> None:
    with pytest.raises(kind, match=f"{url}: {problem}"):
        open_dataset(url).scenes[0][0]


def test_an_unreachable_store_is_given_up(monkeypatch: pytest.MonkeyPatch, store: StoreServer) -> None:
    monkeypatch.setattr("simbev_ros.foundation.object_store.store_client.MAX_ATTEMPTS", 2)
    monkeypatch.setenv("AWS_ENDPOINT_URL_S3", "http://127.0.0.1:1")
    with pytest.raises(StoreError, match=r"s3://made-up/x/index.parquet: http://127.0.0.1:1 cannot be reached: Could"):
        open_dataset(f"s3://{BUCKET}/x")


def test_verification_finds_what_it_finds_in_the_folder(folder: Path, url: str, tmp_path: Path) -> None:
    rows = indexed_bags(ObjectPath(BUCKET, "sets/first"))
    for bag, row in rows.items():
        here = folder / row["path"]
        expected = [(bag, fault.place, fault.problem) for fault in verify_bag(here)]
        assert [(fault.bag, fault.place, fault.problem) for fault in verify_fetched_bag(bag, row)] == expected
        assert [fault.problem for fault in verify_fetched_bag(bag / f"{bag.name}_0.mcap")] == [e[2] for e in expected]


def test_verification_reads_each_byte_once(folder: Path, url: str, store: StoreServer) -> None:
    bag = folder / "scenes/train/Blocks-0001"
    verify_fetched_bag(SCENES / "Blocks-0001", read_index(folder)[1])
    size = sum(file.stat().st_size for file in bag.iterdir())
    assert size < store.sent_bytes < size + 4000  # and a listing


def test_verification_finds_a_flipped_byte_a_missing_bag_and_another_row(folder: Path, url: str) -> None:
    file, row = SCENES / "Blocks-0001/Blocks-0001_0.mcap", read_index(folder)[1]
    content = bytearray((folder / row["path"] / file.name).read_bytes())
    content[len(content) // 2] ^= 1
    put_bytes(bytes(content), file)
    problems = [fault.problem for fault in verify_fetched_bag(SCENES / "Blocks-0001", row)]
    assert any("CRC" in problem for problem in problems)
    assert "it is not the file in the index: its SHA-256 differs" in problems
    delete_tree(SCENES / "Blocks-0001")
    (fault,) = verify_fetched_bag(SCENES / "Blocks-0001", row)
    assert fault.problem == "the index lists this scene, but its bag is missing"
    (*_, fault) = verify_fetched_bag(SCENES / "Blocks-0000", read_index(folder)[0] | {"objects": -1})
    assert fault.problem.startswith("objects is -1, but ")
