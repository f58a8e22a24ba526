"""A worker's process, played by a small program: how it is talked with, and how its end and its silence are noticed."""

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import psutil
import pytest
from waiting import PATIENCE_S, wait_until

from simbev_ros.config.scenario import Scenario
from simbev_ros.dataset.plan import PlannedEntry
from simbev_ros.production.replay.entry import ReplayedEntry
from simbev_ros.production.workers import local_worker
from simbev_ros.production.workers.local_worker import LocalWorker
from simbev_ros.production.workers.messages import Settings, Signal
from simbev_ros.production.workers.supervised_pool import WorkerLost
from simbev_ros.production.workers.worker_pool import Worker

ENTRY = PlannedEntry(number=3, map="Blocks", split="val")
PROGRAM = """#!{python}
import os, sys, time
from multiprocessing.connection import Connection
assert sys.argv[4] == "simbev_ros.production.workers.worker_process"
line = Connection(int(sys.argv[5]))
{body}
"""
ECHO = """
line.send(line.recv())
line.send(os.environ.get("ROS_DOMAIN_ID"))
try:
    while True:
        line.send(line.recv())
except EOFError:
    pass
"""
DEAF = "line.send('deaf')\nwhile True: time.sleep(1)"

Start = Callable[..., LocalWorker]


@pytest.fixture
def settings(tmp_path: Path) -> Settings:
    scenario = Scenario.model_validate({"scenes": [{"map": "Blocks", "train": 1}], "rig": {"sensors": []}})
    return Settings(scenario, tmp_path / "staging")


@pytest.fixture
def start(tmp_path: Path, settings: Settings, monkeypatch: pytest.MonkeyPatch) -> Iterator[Start]:
    """Function that starts a worker whose process runs a given program; it is killed at the end of the test."""
    workers: list[LocalWorker] = []

    def start(body: str) -> LocalWorker:
        path = tmp_path / "worker"
        path.write_text(PROGRAM.format(python=sys.executable, body=body))
        path.chmod(0o700)
        with monkeypatch.context() as patch:
            patch.setattr(sys, "executable", str(path))
            patch.setenv("PYTHONPATH", os.pathsep.join(sys.path))
            patch.setenv("ROS_DOMAIN_ID", "7")
            workers.append(LocalWorker(Worker("worker-1", "here"), settings))
        return workers[-1]

    yield start
    for worker in workers:
        worker.kill()


def pid_of(worker: LocalWorker) -> int:
    return worker._process.pid


def next_messages(worker: LocalWorker, count: int = 1) -> list[Any]:
    messages: list[Any] = []
    wait_until(lambda: messages.extend(worker.read()) or len(messages) >= count)
    return messages


def loss_of(worker: LocalWorker) -> str:
    """The message when the worker is lost."""
    with pytest.raises(WorkerLost) as loss:
        next_messages(worker, 1 << 30)
    return str(loss.value)


def test_settings_and_scenes_arrive_and_the_worker_has_no_ros_domain_yet(start: Start, settings: Settings) -> None:
    worker = start(ECHO)
    assert next_messages(worker, 2) == [settings, None]
    worker.submit(ENTRY)
    assert next_messages(worker) == [ENTRY]


def test_a_replay_arrives_with_its_bag(start: Start) -> None:
    worker = start(ECHO)
    next_messages(worker, 2)
    replay = ReplayedEntry(**ENTRY.model_dump(), bag=Path("/sets/first/scenes/val/Blocks-0003"))
    worker.submit(replay)
    assert next_messages(worker) == [replay]


def test_a_worker_that_is_told_to_end_ends_by_itself(start: Start) -> None:
    worker = start(ECHO)
    next_messages(worker, 2)
    worker.end()
    worker.join()
    assert worker._process.returncode == 0


def test_a_worker_that_does_not_end_is_killed(start: Start, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(local_worker, "_END_TIMEOUT_S", 0.2)
    worker = start(DEAF)
    next_messages(worker)
    worker.end()
    worker.join()
    assert worker._process.returncode == -signal.SIGKILL


def test_the_end_of_a_process_is_described_with_what_it_has_printed(start: Start) -> None:
    worker = start("line.recv()\nprint('out of cheese', flush=True)\nsys.exit(3)")
    loss = loss_of(worker)
    assert loss.startswith("worker-1 died: ") and "3" in loss and "out of cheese" in loss


def test_messages_of_a_process_that_has_died_still_arrive(start: Start) -> None:
    worker = start("line.recv()\nline.send('last words')\nos.kill(os.getpid(), 9)")
    worker._process.wait(PATIENCE_S)
    assert worker.read() == ["last words"]
    assert "SIGKILL" in loss_of(worker)


def test_a_scene_for_a_process_that_has_died_is_no_error_before_the_next_read(start: Start) -> None:
    worker = start("")
    worker._process.wait(PATIENCE_S)
    worker.submit(ENTRY)
    assert loss_of(worker).startswith("worker-1 died: ")


class Clock:
    """A clock that stands still unless the test moves it."""

    def __init__(self) -> None:
        self.now_s = 1000.0

    def monotonic(self) -> float:
        return self.now_s


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    made = Clock()
    monkeypatch.setattr(local_worker, "time", made)
    return made


def test_a_stopped_process_is_lost_when_it_has_been_silent_for_too_long(start: Start, clock: Clock) -> None:
    worker = start("line.recv()\nwhile True: line.send('alive'); time.sleep(0.1)")
    for _ in range(3):  # longer than the patience, but not silent
        next_messages(worker)
        clock.now_s += 59.0
    process = psutil.Process(pid_of(worker))
    process.suspend()
    wait_until(lambda: process.status() == psutil.STATUS_STOPPED and not worker.read())
    clock.now_s += 60.1
    assert loss_of(worker) == "worker-1 has been silent for 60 s"
    worker.kill()
    assert not psutil.pid_exists(pid_of(worker))


def test_a_process_has_longer_to_start_than_to_send_signs_of_life(start: Start, clock: Clock) -> None:
    worker = start("line.recv()\nline.recv()\nline.send('alive')\ntime.sleep(600)")
    clock.now_s += 179.0
    assert worker.read() == []
    worker.submit(ENTRY)
    assert next_messages(worker) == ["alive"]
    clock.now_s += 60.1
    assert "silent" in loss_of(worker)


STARTER = """
import time
from pathlib import Path
from simbev_ros.config.scenario import Scenario
from simbev_ros.production.workers.worker_pool import Worker
from simbev_ros.production.workers.local_worker import LocalWorker
from simbev_ros.production.workers.messages import Settings
scenario = Scenario.model_validate({{"scenes": [{{"map": "Blocks", "train": 1}}], "rig": {{"sensors": []}}}})
worker = LocalWorker(Worker("worker-1", "here"), Settings(scenario, Path({staging!r})))
print(worker._process.pid, flush=True)
time.sleep(600)
"""


def test_a_real_worker_ends_when_its_driver_is_killed(tmp_path: Path) -> None:
    program = STARTER.format(staging=str(tmp_path / "staging"))
    driver = subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True)
    assert driver.stdout is not None
    worker = psutil.Process(int(driver.stdout.readline()))
    driver.kill()
    driver.communicate()
    _, alive = psutil.wait_procs([worker], timeout=PATIENCE_S)
    assert not alive


def test_a_real_worker_gets_ready_gives_signs_of_life_and_ends(settings: Settings) -> None:
    worker = LocalWorker(Worker("worker-1", "here"), settings)
    try:
        assert set(next_messages(worker, 3)) == {Signal.READY, Signal.HEARTBEAT}
    finally:
        worker.end()
        worker.join()
    assert worker._process.returncode == 0
