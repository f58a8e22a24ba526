"""Processes of a graph end by themselves or by force, without an error of their own."""

import signal
import subprocess
from pathlib import Path

from simbev_ros.ros.graph.process import GraphProcess


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
