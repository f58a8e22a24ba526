"""Work in processes: order of results, progress, and behavior on interrupts and killed processes."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from waiting import PATIENCE_S, wait_until

from simbev_ros.dataset.parallel import map_in_processes, report_step
from simbev_ros.foundation.errors import SimbevError

_PROGRAM = """
import time
from simbev_ros.dataset.parallel import map_in_processes
from simbev_ros.ros.graph.interrupts import Interrupted, raising_interrupts

def slow(item):
    if item:
        time.sleep(60)
    return item

try:
    with raising_interrupts():
        for _ in map_in_processes(slow, range(9), 3):
            print("begun", flush=True)
except Interrupted:
    raise SystemExit(130)
"""


@pytest.fixture
def program():
    process = subprocess.Popen([sys.executable, "-c", _PROGRAM], stdout=subprocess.PIPE, text=True, process_group=0)
    assert process.stdout is not None and process.stdout.readline() == "begun\n"
    yield process
    process.kill()
    process.wait()
    process.stdout.close()


def _members(group: int) -> list[int]:
    """Processes of a group that are still running."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            state, _, its_group, *_ = stat.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(its_group) == group and state != "Z":
            found.append(int(stat.parent.name))
    return found


def _wait_until_gone(group: int) -> None:
    wait_until(lambda: not _members(group))


def test_ctrl_c_ends_running_work_at_once(program):
    assert len(_members(program.pid)) == 4
    os.killpg(program.pid, signal.SIGINT)  # as a terminal does
    assert program.wait(PATIENCE_S) == 130
    _wait_until_gone(program.pid)


def test_an_interrupt_of_the_parent_alone_ends_its_processes(program):
    program.send_signal(signal.SIGTERM)
    assert program.wait(PATIENCE_S) == 130
    _wait_until_gone(program.pid)


def test_processes_end_with_a_parent_that_was_killed(program):
    program.kill()
    program.wait()
    _wait_until_gone(program.pid)


def test_a_killed_process_is_reported():
    with pytest.raises(SimbevError, match="a process that read bags was killed"):
        list(map_in_processes(_die, range(3), 2))


def _die(_: int) -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def test_results_are_in_the_order_of_the_items_and_errors_are_passed_on():
    assert list(map_in_processes(_double, range(40), 3)) == [2 * item for item in range(40)]
    with pytest.raises(ZeroDivisionError):
        list(map_in_processes(_divide, [1, 0, 1], 2))


def _double(item: int) -> int:
    time.sleep(0.02 if item % 3 == 0 else 0.0)
    return 2 * item


def _divide(item: int) -> float:
    return 1 / item


def three_steps(item: tuple[int, Path]) -> int:
    """Report a step, and two more once the first one has been noticed."""
    number, noticed = item
    report_step()
    wait_until(noticed.exists)
    for _ in range(2):
        report_step()
    return -number


@pytest.mark.parametrize("workers", [1, 2])
def test_steps_are_reported_while_the_work_is_running(workers: int, tmp_path: Path) -> None:
    reported: list[int] = []
    results = []

    def report(steps: int) -> None:
        reported.append(steps)
        (tmp_path / "noticed").touch()

    items = [(number, tmp_path / "noticed") for number in range(2)]
    for result in map_in_processes(three_steps, items, workers, report):
        results.append(result)
        assert any(1 <= steps < 3 * workers for steps in reported), "nothing was reported before the first result"
    assert results == [0, -1]
    assert reported == sorted(reported) and reported[-1] <= 6
