"""A worker's process: ``python -m simbev_ros.production.workers.worker_process DESCRIPTOR``.

In: settings, then scenes to make, through a socket. Out: events, heartbeats and how each scene ended. It ends, with
its graph, on SIGTERM and when the other end of the socket is closed, however that happened.
"""

import os
import signal
import sys
import threading
from contextlib import suppress
from multiprocessing.connection import Connection
from queue import SimpleQueue
from typing import TYPE_CHECKING, Any

from simbev_ros.foundation.errors import SimbevError
from simbev_ros.foundation.process_limits import ending_on_shortage
from simbev_ros.ros.graph.interrupts import Interrupted, raising_interrupts
from simbev_ros.ros.nodes.lifeline import wake_at_end_of_supervisor

if TYPE_CHECKING:
    from simbev_ros.dataset.plan import PlannedEntry
    from simbev_ros.production.workers.messages import Settings

_HEARTBEAT_S = 1.0


class _Line:
    """The worker's end of the socket; several threads send through it."""

    def __init__(self, descriptor: int) -> None:
        self._connection = Connection(descriptor)
        self._lock = threading.Lock()
        self.scenes: SimpleQueue[PlannedEntry] = SimpleQueue()

    def receive_settings(self) -> "Settings":
        """The first message."""
        return self._connection.recv()

    def send(self, message: Any) -> None:
        """Send a message, unless the other end is closed: then this process is about to end."""
        with self._lock, suppress(OSError):
            self._connection.send(message)

    def start_threads(self) -> None:
        """Begin to receive scenes and to send heartbeats."""
        threading.Thread(target=self._receive, daemon=True).start()
        threading.Thread(target=self._send_heartbeats, daemon=True).start()

    def _receive(self) -> None:
        with suppress(EOFError, OSError):
            while True:
                self.scenes.put(self._connection.recv())
        os.kill(os.getpid(), signal.SIGTERM)  # the driver is gone

    def _send_heartbeats(self) -> None:
        from simbev_ros.production.workers.messages import Signal

        wait = threading.Event()
        while not wait.wait(_HEARTBEAT_S):
            self.send(Signal.HEARTBEAT)


def run_worker(descriptor: int) -> None:
    """Make scenes until the other end of the socket is closed.

    Args:
        descriptor: File descriptor of the socket.
    """
    line = _Line(descriptor)
    settings = line.receive_settings()
    from simbev_ros.production.scene_maker import SceneMaker
    from simbev_ros.production.workers.messages import ReportingObserver, Signal

    with suppress(Interrupted), raising_interrupts():
        line.start_threads()
        observer = ReportingObserver(line.send)
        try:
            maker = SceneMaker(
                settings.scenario,
                settings.staging,
                observer,
                maps=settings.maps,
                rendering=settings.rendering,
                uploader=settings.uploader,
            )
        except SimbevError as error:
            line.send(error)
            return
        try:
            while True:
                line.send(Signal.READY)
                line.send(maker.make(line.scenes.get()))
        finally:
            maker.close()


if __name__ == "__main__":
    wake_at_end_of_supervisor()
    with ending_on_shortage():
        run_worker(int(sys.argv[1]))
