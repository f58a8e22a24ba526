"""A process ends when native code does not let it, and runs on when that was fast enough."""

import subprocess
import sys
import time

import pytest

WAITING = """
import ctypes, sys
from simbev_ros.ros.nodes.lifeline import exiting_after
with exiting_after(float(sys.argv[1]), int(sys.argv[2])):
    ctypes.PyDLL(None).usleep(int(sys.argv[3]))  # keeps Python's lock
sys.exit(5)
"""


@pytest.mark.parametrize(("code", "sleep_s", "expected"), [(0, 500, 0), (2, 500, 2), (2, 0, 5)])
def test_a_process_exits_while_native_code_keeps_pythons_lock(code: int, sleep_s: int, expected: int) -> None:
    command = [sys.executable, "-c", WAITING, "0.2", str(code), str(sleep_s * 1_000_000)]
    assert subprocess.run(command, check=False, timeout=400).returncode == expected


def test_a_block_runs_on_a_system_without_timers() -> None:
    limited = f"import resource; resource.setrlimit(resource.RLIMIT_SIGPENDING, (0, 0)); {WAITING.strip()}"
    assert subprocess.run([sys.executable, "-c", limited, "0.2", "2", "0"], check=False, timeout=400).returncode == 5


def test_a_block_that_was_fast_enough_leaves_no_timer() -> None:
    from simbev_ros.ros.nodes.lifeline import exiting_after

    for _ in range(3):
        with exiting_after(0.05, 3):
            pass
    time.sleep(0.2)  # the test run would end
