"""Measured costs of processes that do a known amount of work."""

import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import psutil
import pytest
from waiting import PATIENCE_S

from simbev_ros.production import scene_cost
from simbev_ros.production.scene_cost import CostMeter, SceneCost, free_memory_mib

BURN = """
import time
input()
end_s = time.process_time() + 0.4
while time.process_time() < end_s:
    pass
print("done", flush=True)
input()
"""
SHARE = """
import os
block = bytearray(os.urandom(1 << 20)) * 96
child = os.fork()
if child == 0:
    import time
    time.sleep(60)
print(child, flush=True)
input()
os.kill(child, 9)
os.wait()
"""

Started = Callable[[str], subprocess.Popen[str]]


@pytest.fixture
def start() -> Iterator[Started]:
    """Function that starts a Python program, which waits for lines; it ends with the test."""
    processes: list[subprocess.Popen[str]] = []

    def start(program: str) -> subprocess.Popen[str]:
        command = [sys.executable, "-c", program]
        processes.append(subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True))
        return processes[-1]

    yield start
    for process in processes:
        process.communicate("\n\n", timeout=PATIENCE_S)


def next_line(process: subprocess.Popen[str]) -> str:
    assert process.stdout is not None
    return process.stdout.readline().strip()


def go_on(process: subprocess.Popen[str]) -> None:
    assert process.stdin is not None
    process.stdin.write("\n")
    process.stdin.flush()


def test_processor_time_since_the_start_of_the_scene_counts(start: Started) -> None:
    process = start(BURN)
    meter = CostMeter([process.pid])
    go_on(process)
    assert next_line(process) == "done"
    cost = meter.cost([process.pid], 7)
    assert 0.38 <= cost.cpu_s <= 0.7 and cost.frames == 7
    assert cost.wall_s >= 0.4 and cost.cores == pytest.approx(cost.cpu_s / cost.wall_s)
    assert CostMeter([process.pid]).cost([process.pid], 7).cpu_s < 0.1, "that was before"


def test_pages_that_processes_share_count_once(start: Started) -> None:
    process = start(SHARE)
    pids = [process.pid, int(next_line(process))]
    cost = CostMeter(pids).cost(pids, 1)
    resident_mib = sum(psutil.Process(pid).memory_info().rss for pid in pids) / 2**20
    assert 96 <= cost.memory_mib <= 140 < 192 <= resident_mib


def test_the_peak_of_the_memory_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    times_s, looks = [100.0], iter([300.0, 900.0, 500.0])
    monkeypatch.setattr(scene_cost.time, "monotonic", lambda: times_s[-1])
    monkeypatch.setattr(scene_cost, "_memory_mib", lambda _: next(looks))
    meter = CostMeter([])
    for time_s in (100.0, 104.0, 105.0, 124.0, 125.0, 130.0):
        times_s.append(time_s)
        meter.look([1])
    assert meter.cost([1], 1).memory_mib == 900.0 and next(looks, None) is None, "looks are 20 s apart"


def test_processes_that_have_ended_cost_nothing(start: Started) -> None:
    process = start("")
    process.wait(PATIENCE_S)
    assert CostMeter([process.pid]).cost([process.pid], 1) == SceneCost(
        wall_s=pytest.approx(0.0, abs=0.5), cpu_s=0.0, memory_mib=0.0, frames=1
    )


@pytest.mark.parametrize(
    ("limit", "used", "free_mib"), [("1073741824", "268435456", 768.0), ("100", "200", 0.0), ("max", "5", 4096.0)]
)
def test_a_limit_of_the_control_group_counts(
    monkeypatch: pytest.MonkeyPatch, limit: str, used: str, free_mib: float
) -> None:
    files = {"/sys/fs/cgroup/memory.max": limit, "/sys/fs/cgroup/memory.current": used}
    monkeypatch.setattr(Path, "read_text", lambda path: files[str(path)])
    monkeypatch.setattr(psutil, "virtual_memory", lambda: type("Memory", (), {"available": 4096 << 20}))
    assert free_memory_mib() == free_mib
