"""Processes of a graph end by themselves or by force, without an error of their own."""

import signal
import subprocess
import sys
from pathlib import Path
from unittest.mock import Mock

import pytest

from simbev_ros.foundation.errors import InputError
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
