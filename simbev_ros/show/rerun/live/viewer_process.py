"""``simbev view live`` as a process of its own."""

import os
import signal
import subprocess
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Self

from simbev_ros.foundation.installation.import_order import module_command
from simbev_ros.ros.conventions.arguments import PLAIN, RosArguments
from simbev_ros.ros.nodes.lifeline import SUPERVISOR_VARIABLE

ADDRESS, SHOWING = "viewer: ", "showing "
"""Beginnings of the lines in which it prints its address, and the scene whose first frame is shown."""
_END_TIMEOUT_S = 8.0
_NICENESS, _MAX_NICENESS = 10, 19


class ViewerProcess:
    """Runs the viewer with low priority; it ends with the context, or when this process dies.

    Args:
        domain: ROS domain of the graph.
        port: Port of the viewer's page; 0: any free one.
        folder: Folder for its temporary files.
        environment: Further environment variables.
        network: Whether the graph may be on another host.
        ros: ROS arguments for all nodes of the graph.
    """

    def __init__(
        self,
        domain: int,
        port: int,
        folder: Path,
        environment: Mapping[str, str],
        *,
        network: bool = False,
        ros: RosArguments = PLAIN,
    ) -> None:
        words = ["view", "live", "--no-open", "--domain", str(domain), "--port", str(port)]
        words += ["--network"] if network else []
        own = {SUPERVISOR_VARIABLE: str(os.getpid()), "TMPDIR": str(folder), "PYTHONUNBUFFERED": "1"}
        self._process = subprocess.Popen(
            module_command("simbev_ros.cli.main", *words, *ros.command()),
            env={**os.environ, **environment, **own},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,  # Ctrl-C in the terminal ends it through this process
        )
        own_niceness = os.getpriority(os.PRIO_PROCESS, 0)
        with suppress(OSError):  # a sandbox may forbid it
            os.setpriority(os.PRIO_PROCESS, self.pid, min(own_niceness + _NICENESS, _MAX_NICENESS))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """End it, with time to end Rerun's server."""
        pids = self.pids()
        self._process.send_signal(signal.SIGTERM)
        for pid in pids:
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGCONT)  # a stopped process would never receive the request
        try:
            self._process.wait(_END_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    @property
    def pid(self) -> int:
        """Process id."""
        return self._process.pid

    @property
    def exit_code(self) -> int | None:
        """Exit code; None while it runs."""
        return self._process.poll()

    def pids(self) -> list[int]:
        """Ids of the viewer's process and of Rerun's server, if they run."""
        import psutil

        with suppress(psutil.NoSuchProcess):
            if self.exit_code is None:
                return [self.pid, *(child.pid for child in psutil.Process(self.pid).children())]
        return []

    def lines(self) -> Iterator[str]:
        """Lines that it prints, until it ends."""
        assert self._process.stdout is not None
        with self._process.stdout:
            for line in self._process.stdout:
                yield line.rstrip("\n")
        self._process.wait()
