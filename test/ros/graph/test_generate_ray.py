"""Datasets made on a Ray cluster: the bytes are those of one graph, whatever dies, and nothing is left on any node."""

import os
import random
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest
from commands import Find, remove_leftovers
from generating import Simbev, files, generate, write

from simbev_ros.dataset.index import read_index
from simbev_ros.production.scene_log import scene_logs
from simbev_ros.recording.layout import scenes_of
from simbev_ros.recording.verify import verify_bag
from simbev_ros.ros.graph.shared_memory import middleware_files

pytest.importorskip("ray", reason="Ray is not installed: pip install -e .[cluster]")

from ray_nodes import RayNodes
from store_server import BUCKET, StoreServer

from simbev_ros.foundation.object_store.object_path import AnyPath, ObjectPath
from simbev_ros.foundation.object_store.transfers import list_objects

pytestmark = [pytest.mark.graph, pytest.mark.slow]

WORKER, NODE, ACTOR = "simbev_ros.production.workers.worker_process", "simbev_ros.ros.nodes.main", "ray::WorkerActor"


@pytest.fixture
def nodes(find: Find, store: StoreServer) -> Iterator[RayNodes]:
    """Three nodes with two CPUs each, whose environment leads to the object store."""
    cluster = RayNodes(3)
    yield cluster
    cluster.close()


TOWNS = ", ".join(f"{{map: {name}, train: 6}}" for name in ("Blocks", "Town01", "Town02", "Town07"))
"""24 scenes."""


def leftovers(dataset: Path) -> list[str]:
    """Names in a dataset's folder that do not belong there."""
    expected = {".lock", "index.parquet", "logs", "plan.json", "scenes"}
    return sorted({path.name for path in dataset.iterdir()} - expected)


def all_but_logs(dataset: AnyPath) -> dict[str, bytes]:
    """Content of all files or objects of a dataset but logs and lock, by path."""
    found = list_objects(dataset) if isinstance(dataset, ObjectPath) else [p for p in dataset.rglob("*") if p.is_file()]
    paths = {str(path.relative_to(dataset)): path for path in found}
    return {name: path.read_bytes() for name, path in paths.items() if not name.startswith(("logs/", ".lock"))}


def report(dataset: AnyPath, folder: Path) -> dict[str, bytes]:
    """Content of all files of a dataset's report, without the dataset's address."""
    command = [sys.executable, "-m", "simbev_ros.cli.main", "info", str(dataset), "--report", str(folder)]
    subprocess.run(command, check=True, capture_output=True)
    paths = sorted(path for path in folder.rglob("*") if path.is_file())
    return {str(path.relative_to(folder)): path.read_bytes().replace(str(dataset).encode(), b"SET") for path in paths}


def test_one_graph_two_workers_and_a_cluster_with_a_folder_and_with_a_store_make_the_same(
    simbev: Simbev, find: Find, nodes: RayNodes, store: StoreServer, tmp_path: Path
) -> None:
    config, bucket = write(tmp_path, TOWNS), ObjectPath(BUCKET, "sets/set")
    store.refuse_every = 5
    ways: dict[AnyPath, tuple[object, ...]] = {
        tmp_path / "one/set": (),
        tmp_path / "workers/set": ("--workers", 2),
        tmp_path / "cluster/set": ("--ray", nodes.address),
        bucket: ("--ray", nodes.address),
    }
    for out, options in ways.items():
        generate(simbev, config, out, *options)
    store.refuse_every = 0
    first, *others = map(all_but_logs, ways)
    assert len([name for name in first if name.endswith(".mcap")]) == 24
    assert [other == first for other in others] == [True] * 3
    pages = [report(out, tmp_path / f"page{k}") for k, out in enumerate(ways)]
    assert [page == pages[0] for page in pages] == [True] * 4


def test_a_cluster_makes_the_same_dataset_and_an_interrupt_ends_it(
    simbev: Simbev, find: Find, nodes: RayNodes, tmp_path: Path
) -> None:
    config = write(tmp_path, "{map: Blocks, train: 3}, {map: Town01, val: 3}", has_lidar=False)
    one, cluster, stopped = (tmp_path / name for name in ("one", "cluster", "stopped"))
    generate(simbev, config, one)
    generate(simbev, config, cluster, "--ray", nodes.address)
    assert files(cluster) == files(one) and not leftovers(cluster)
    assert [(cluster / name).read_bytes() == (one / name).read_bytes() for name in ("index.parquet", "plan.json")]
    command = simbev("generate", config, "--out", stopped, "--ray", nodes.address)
    command.wait_for(lambda: len(files(stopped)) > 0)
    command.process.send_signal(signal.SIGINT)
    code, output = command.finish()
    assert code == 130, output
    assert not find(WORKER) and not find(NODE) and not leftovers(stopped)
    assert len(read_index(stopped)) == len(scenes_of(stopped))


def test_whatever_dies_the_dataset_is_complete_and_the_same(
    simbev: Simbev, find: Find, nodes: RayNodes, tmp_path: Path
) -> None:
    config = write(tmp_path, TOWNS)
    one, two, before = tmp_path / "one", tmp_path / "two", set(middleware_files())
    generate(simbev, config, one)
    arguments = ("generate", config, "--out", two, "--ray", nodes.address)
    command, chance = simbev(*arguments), random.Random(3)

    def is_working(scenes: int) -> bool:
        return len(files(two)) >= scenes and all(map(find, (ACTOR, WORKER, NODE)))

    for victim in ("raylet", ACTOR, WORKER, NODE, "driver", "node stopped", "stopped", WORKER, "driver", ACTOR):
        made = len(files(two))
        command.wait_for(partial(is_working, made + 1))
        time.sleep(chance.uniform(0.0, 1.0))
        if victim == "driver":
            command.process.kill()
            command.process.wait()
            command = simbev(*arguments)
        elif victim == "raylet":
            nodes.kill_raylet(chance.randrange(len(nodes.others)))
            nodes.add()
        elif victim == "node stopped":
            nodes.stop(chance.randrange(len(nodes.others)))
            nodes.add()
        elif victim == "stopped":
            os.kill(chance.choice(find(WORKER)), signal.SIGSTOP)
        else:
            os.kill(chance.choice(find(victim)), signal.SIGKILL)
    nodes.resume()
    code, output = command.finish(600)
    assert code == 0, output
    assert files(two) == files(one) and read_index(two) == read_index(one) and not leftovers(two)
    assert (two / "plan.json").read_bytes() == (one / "plan.json").read_bytes()
    assert not [fault for bag in scenes_of(two) for fault in verify_bag(bag)]
    failures = "".join(path.read_text() for bag in scenes_of(two) for path in scene_logs(two, bag.name)[:-1])
    for folder in re.findall(r"^logs: (/.*)$", failures, re.MULTILINE):
        shutil.rmtree(folder, ignore_errors=True)  # which a failed graph leaves
    remove_leftovers(before)
