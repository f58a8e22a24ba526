"""Datasets of several graphs side by side: the bytes are those of one graph, whatever dies, and nothing is left."""

import os
import re
import shutil
import signal
from pathlib import Path

import pytest
from commands import Find
from generating import Simbev, files, generate, write

from simbev_ros.dataset.index import read_index
from simbev_ros.production.scene_log import scene_logs
from simbev_ros.recording.layout import is_dataset, scenes_of
from simbev_ros.recording.verify import verify_bag

pytestmark = [pytest.mark.graph, pytest.mark.slow]

WORKER, NODE = "simbev_ros.production.workers.worker_process", "simbev_ros.ros.nodes.main"


def test_a_second_writer_is_refused_and_an_interrupt_ends_all_workers_before_the_command_ends(
    simbev: Simbev, find: Find, tmp_path: Path
) -> None:
    config, dataset = write(tmp_path, "{map: Blocks, train: 40}", has_lidar=False), tmp_path / "set"
    command = simbev("generate", config, "--out", dataset, "--workers", 2)
    command.wait_for(lambda: is_dataset(dataset))
    assert not scenes_of(dataset), "the folder is a dataset before it has a scene"
    code, output = simbev("generate", config, "--out", dataset).finish()
    assert code == 2 and f"process {command.process.pid} is writing into it" in output
    command.wait_for((dataset / "logs").is_dir)  # a scene is there, and then its log
    assert len(find(WORKER)) == 2
    command.process.send_signal(signal.SIGINT)
    code, output = command.finish()
    assert code == 130, output
    assert not find("")
    assert sorted(path.name for path in dataset.iterdir()) == [
        *(".lock", "index.parquet", "logs", "plan.json", "scenes")
    ]
    assert [row["path"] for row in read_index(dataset)] == [str(bag.relative_to(dataset)) for bag in scenes_of(dataset)]
    assert not [fault for bag in scenes_of(dataset) for fault in verify_bag(bag)]


def test_whatever_is_killed_the_dataset_is_that_of_one_graph(simbev: Simbev, find: Find, tmp_path: Path) -> None:
    config = write(tmp_path, "{map: Blocks, train: 10}, {map: Town01, val: 10}", has_lidar=False)
    one, two = tmp_path / "one", tmp_path / "two"
    generate(simbev, config, one)
    arguments = ("generate", config, "--out", two, "--workers", 2)
    command = simbev(*arguments)
    command.wait_for(lambda: len(files(two)) >= 2)
    os.kill(find(WORKER)[0], signal.SIGKILL)
    command.wait_for(lambda: len(files(two)) >= 5 and len(find(WORKER)) == 2)
    os.kill(find(NODE)[-1], signal.SIGKILL)  # the newest: others may still be ending with their worker
    command.wait_for(lambda: len(files(two)) >= 9)
    command.process.kill()  # alone: its workers have to notice
    command.process.wait()
    code, output = simbev(*arguments).finish(600)
    assert code == 0, output
    assert files(two) == files(one) and read_index(two) == read_index(one)
    assert (two / "plan.json").read_bytes() == (one / "plan.json").read_bytes()
    assert {path.name for path in two.iterdir()} == {path.name for path in one.iterdir()}
    assert not [fault for bag in scenes_of(two) for fault in verify_bag(bag)]
    failures = "".join(path.read_text() for bag in scenes_of(two) for path in scene_logs(two, bag.name)[:-1])
    assert "worker-" in failures and "died" in failures and "node " in failures
    for folder in re.findall(r"^logs: (/.*)$", failures, re.MULTILINE):
        shutil.rmtree(folder)  # which a failed graph leaves
