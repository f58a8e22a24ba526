"""A worker on this machine: a process of its own, which ends on request or with the driver."""

import os
import socket
import subprocess
import tempfile
import time
from contextlib import suppress
from multiprocessing.connection import Connection
from typing import Any

from simbev_ros.dataset.plan import PlannedEntry
from simbev_ros.foundation.installation.arithmetic import rounding_variables
from simbev_ros.foundation.installation.import_order import module_command
from simbev_ros.foundation.threads import CORES_VARIABLE
from simbev_ros.production.workers.messages import Settings
from simbev_ros.production.workers.supervised_pool import WorkerLost
from simbev_ros.production.workers.worker_pool import Worker
from simbev_ros.ros.graph.node_starter import describe_exit
from simbev_ros.ros.nodes.lifeline import SUPERVISOR_VARIABLE

_START_TIMEOUT_S, HEARTBEAT_TIMEOUT_S = 180.0, 60.0
"""Maximum time without a message, before the first one and later; heartbeats come every second."""
_END_TIMEOUT_S = 20.0
"""Maximum time to end in; a graph takes up to 8 s."""


class LocalWorker:
    """Starts a worker's process and talks with it.

    Args:
        worker: Its name and machine.
        settings: What it needs to begin.
        cores: Number of cores that it plans its graph with; None: all.
    """

    def __init__(self, worker: Worker, settings: Settings, cores: int | None = None) -> None:
        self.worker = worker
        self._log = tempfile.TemporaryFile(prefix="simbev_ros-worker-")  # noqa: SIM115
        ours, theirs = socket.socketpair()
        inherited = {name: value for name, value in os.environ.items() if name != "ROS_DOMAIN_ID"}
        with theirs:
            self._process = subprocess.Popen(
                module_command("simbev_ros.production.workers.worker_process", str(theirs.fileno())),
                stdin=subprocess.DEVNULL,
                stdout=self._log,
                stderr=subprocess.STDOUT,
                env={
                    "OPENBLAS_NUM_THREADS": "1",
                    **rounding_variables(inherited),
                    **inherited,
                    **({} if cores is None else {CORES_VARIABLE: str(cores)}),
                    SUPERVISOR_VARIABLE: str(os.getpid()),
                },
                pass_fds=[theirs.fileno()],
                start_new_session=True,  # Ctrl-C reaches it through the driver
            )
        self.connection = Connection(ours.detach())
        self._send(settings)
        self._deadline_s = time.monotonic() + _START_TIMEOUT_S

    def submit(self, entry: PlannedEntry) -> None:
        """Send a scene to make."""
        self._send(entry)

    def read(self) -> list[Any]:
        """Messages that have arrived.

        Raises:
            WorkerLost: The process has died, or has been silent for too long.
        """
        messages = []
        try:
            while self.connection.poll():
                messages.append(self.connection.recv())
        except (EOFError, OSError):
            if not messages:
                raise WorkerLost(f"{self.worker.name} died: {self._describe_end()}") from None
        now_s = time.monotonic()
        if messages:
            self._deadline_s = now_s + HEARTBEAT_TIMEOUT_S
        elif now_s > self._deadline_s:
            raise WorkerLost(f"{self.worker.name} has been silent for {HEARTBEAT_TIMEOUT_S:g} s")
        return messages

    def end(self) -> None:
        """Ask the process to end, by closing the connection; return at once."""
        self.connection.close()

    def kill(self) -> None:
        """End the process at once; its graph notices and ends by itself."""
        self._process.kill()
        self._process.wait()
        self.connection.close()
        self._log.close()

    def join(self) -> None:
        """Wait for the end of the process, which is killed if it takes too long."""
        try:
            self._process.wait(_END_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._log.close()

    def _send(self, message: Any) -> None:
        with suppress(OSError):  # it has died, which the next read reports
            self.connection.send(message)

    def _describe_end(self) -> str:
        code = self._process.wait()
        self._log.seek(0)
        return describe_exit(code, self._log.read().decode(errors="replace").splitlines())
