"""Datasets of several graphs in an object store: the same bytes as in a folder, also after kills and refusals."""

import os
import signal
from pathlib import Path

import psutil
import pytest
from generating import Simbev, files, generate, write
from store_server import BUCKET, StoreServer
from waiting import wait_until

from simbev_ros.dataset import open_dataset
from simbev_ros.dataset.fetched_check import verify_fetched_bag
from simbev_ros.dataset.index import indexed_bags, read_index
from simbev_ros.foundation.object_store.object_path import ObjectPath
from simbev_ros.foundation.object_store.transfers import list_objects, put_bytes

pytestmark = [pytest.mark.graph, pytest.mark.slow]

SET = ObjectPath(BUCKET, "sets/a")
WORKER = "simbev_ros.production.workers.worker_process"


def workers(driver: int) -> list[psutil.Process]:
    return [child for child in psutil.Process(driver).children() if WORKER in child.cmdline()]


def test_whatever_is_killed_the_dataset_in_the_store_is_that_of_a_folder(
    simbev: Simbev, store: StoreServer, tmp_path: Path
) -> None:
    config, folder = write(tmp_path, "{map: Blocks, train: 5}", has_lidar=False), tmp_path / "folder"
    generate(simbev, config, folder)
    store.refuse_every = 5
    arguments = ("generate", config, "--out", SET, "--workers", 2)
    command = simbev(*arguments)
    command.wait_for(lambda: len(read_index(SET)) >= 1)
    os.kill(workers(command.process.pid)[0].pid, signal.SIGKILL)
    command.wait_for(lambda: len(read_index(SET)) >= 2)
    orphans = workers(command.process.pid)
    command.process.kill()  # alone: its workers have to notice
    command.process.wait()
    wait_until(lambda: not any(orphan.is_running() for orphan in orphans))
    put_bytes(b"", SET / ".lock")  # instead of a minute's wait
    code, output = simbev(*arguments).finish(600)
    store.reset()
    assert code == 0, output
    found = {str(path.relative_to(SET)): path for path in list_objects(SET)}
    assert {key: path.read_bytes() for key, path in found.items() if key.endswith(".mcap")} == files(folder)
    assert found.keys() - {key for key in found if key.startswith("logs/")} == {
        *(str(path.relative_to(folder)) for path in folder.glob("scenes/*/*/*")),
        *(".lock", "index.parquet", "plan.json"),
    }
    for name in ("index.parquet", "plan.json"):
        assert found[name].read_bytes() == (folder / name).read_bytes()
    assert not [fault for bag, row in indexed_bags(SET).items() for fault in verify_fetched_bag(bag, row)]
    assert len(open_dataset(str(SET)).scenes) == 5
