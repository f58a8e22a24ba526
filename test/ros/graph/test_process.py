"""Processes of a graph end by themselves or by force, without an error of their own."""

import signal
import subprocess
import sys
from pathlib import Path
from unittest.mock import Mock

import pytest

from simbev_ros.foundation.errors import GraphError, InputError
from simbev_ros.ros.graph import node_starter
from simbev_ros.ros.graph.node_starter import describe_exit
from simbev_ros.ros.graph.process import GraphProcess, StackProcess


class Stubborn:
    """A process that ends some waits after it has been killed."""

    pid, exit_code = 1, None

    def __init__(self, waits: int) -> None:
        self.signals: list[int] = []
        self._waits = waits

    def poll(self) -> int | None:
        return None

    def wait(self, timeout: float) -> int:
        if signal.SIGKILL not in self.signals or self._waits * 10.0 > timeout:
            raise subprocess.TimeoutExpired("process 1", timeout)
        return -signal.SIGKILL

    def send_signal(self, number: int) -> None:
        self.signals.append(number)


def join(process: Stubborn, tmp_path: Path) -> bool:
    return GraphProcess("camera", "node camera", process, tmp_path / "camera.log").join(0.1)


def test_a_killed_process_has_seconds_to_end_even_if_the_graph_has_no_more_time(tmp_path: Path) -> None:
    process = Stubborn(waits=2)
    assert not join(process, tmp_path)
    assert process.signals == [signal.SIGKILL]


def test_a_process_that_the_system_cannot_end_is_given_up(tmp_path: Path) -> None:
    assert not join(Stubborn(waits=100), tmp_path)


def test_a_stack_runs_python_where_the_shell_has_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As on Debian; the commands of the user's shell come first."""
    starter = Mock()
    monkeypatch.setenv("PATH", str(tmp_path))
    StackProcess(starter, "stack", ["python", "my_stack.py"], tmp_path)
    own = str(Path(sys.executable).with_name("python"))
    assert starter.start.call_args.args[0] == (own, "my_stack.py")
    (tmp_path / "python").write_text("#!/bin/sh\n")
    (tmp_path / "python").chmod(0o755)
    StackProcess(starter, "stack", ["python", "my_stack.py"], tmp_path)
    assert starter.start.call_args.args[0] == (str(tmp_path / "python"), "my_stack.py")
    with pytest.raises(InputError, match=r"^evaluation.stack: there is no command 'pithon'$"):
        StackProcess(starter, "stack", ["pithon"], tmp_path)


NODE = """
import errno, sys
from simbev_ros.ros.nodes import main
def init(**_):
    raise OSError(errno.EMFILE, "Too many open files")
main.rclpy.init = init
sys.exit(main.main(["simbev_node", "imu:imu"]))
"""


def test_a_node_whose_machine_refuses_something_says_so_in_one_line(tmp_path: Path) -> None:
    log = tmp_path / "imu.log"
    with log.open("w") as output:
        done = subprocess.run([sys.executable, "-c", NODE], stderr=output, check=False)
    process = Mock(poll=lambda: done.returncode)
    refusal = GraphProcess("imu", "node imu", process, log).refusal()
    assert isinstance(refusal, GraphError)
    assert str(refusal).startswith("node imu: too many files are open: ulimit -n allows "), log.read_text()


def test_a_crash_is_reported_with_low_limits_which_may_be_the_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(node_starter, "low_limits", lambda: ["ulimit -u allows 200 processes and threads"])
    crash = describe_exit(-signal.SIGABRT, ["  what():  Invalid argument"])
    assert crash == "killed by SIGABRT (ulimit -u allows 200 processes and threads):   what():  Invalid argument"
    assert describe_exit(-signal.SIGKILL, []) == "killed by SIGKILL"
