"""Starts node processes through a fork server, and follows them: the supervisor's end of ``ros.nodes.fork_server``."""

import json
import os
import select
import signal
import socket
import subprocess
import time
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Protocol

import psutil

from simbev_ros.foundation.installation.import_order import module_command
from simbev_ros.foundation.process_limits import low_limits
from simbev_ros.ros.nodes.fork_server import MAX_MESSAGE_BYTES
from simbev_ros.ros.nodes.lifeline import SUPERVISOR_VARIABLE, die_with_parent

_STOP_TIMEOUT_S, _END_TIMEOUT_S = 10.0, 8.0
"""Time that the server has to end, and its processes when it has died."""
_CRASHES = (-signal.SIGSEGV, -signal.SIGABRT, -signal.SIGBUS)
"""Exit codes of processes in which a library may have reached a limit."""


class RunningProcess(Protocol):
    """A process as the graph handles it, such as ``subprocess.Popen``."""

    @property
    def pid(self) -> int | None:
        """Process id; None before the process has been started."""

    def poll(self) -> int | None:
        """Exit code; None while the process runs, negative if a signal killed it."""

    def wait(self, timeout: float) -> int:
        """Wait for the end; ``subprocess.TimeoutExpired`` if it does not come in ``timeout`` seconds."""

    def send_signal(self, number: int) -> None:
        """Send a signal, if the process runs."""


class NodeStarter:
    """A fork server, which imports the code of the nodes once and forks for each node process.

    Args:
        kinds: Kinds of all nodes that will be started.
        folder: Folder for its log.
        environment: Variables added to the current ones, for the server and for all node processes.
    """

    def __init__(self, kinds: Iterable[str], folder: Path, environment: Mapping[str, str]) -> None:
        self._log = folder / "fork_server.log"
        self._waiting: list[ForkedProcess] = []
        self._running: dict[int, ForkedProcess] = {}
        self._failure: str | None = None
        self._channel, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        own = {SUPERVISOR_VARIABLE: str(os.getpid()), "SPT_NOENV": "1"}  # setproctitle leaves /proc/PID/environ alone
        with theirs, self._log.open("wb") as log:
            self._server = subprocess.Popen(
                module_command("simbev_ros.ros.nodes.fork_server", str(theirs.fileno()), *dict.fromkeys(kinds)),
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
                env={**os.environ, **environment, **own},
                pass_fds=[theirs.fileno()],
                start_new_session=True,
                preexec_fn=partial(die_with_parent, os.getpid()),
            )

    @property
    def pid(self) -> int:
        """Process id of the server."""
        return self._server.pid

    def start(self, arguments: Sequence[str], log: Path, *, is_command: bool = False) -> "ForkedProcess":
        """Start a process; return without waiting for it.

        Args:
            arguments: Arguments for ``ros.nodes.main``, or a command and its arguments.
            log: File for its output.
            is_command: Whether it is a command.
        """
        process = ForkedProcess(self)
        self._waiting.append(process)
        with suppress(OSError):  # the server has died, which the next read reports
            request = {"arguments": list(arguments), "log": str(log), "is_command": is_command}
            self._channel.send(json.dumps(request).encode())
        return process

    def handle_answers(self, timeout_s: float = 0.0) -> None:
        """Take what the server has reported; wait for the first report, at most ``timeout_s`` seconds."""
        while self._failure is None and select.select([self._channel], [], [], timeout_s)[0]:
            answer = self._receive()
            if not answer:
                self._note_death()
                return
            values = json.loads(answer)
            if "started" in values:
                process = self._waiting.pop(0)
                process.started(values["started"])
                self._running[values["started"]] = process
            else:
                self._running.pop(values["ended"]).ended(values["exit_code"])
            timeout_s = 0.0

    def failure(self) -> str | None:
        """How the server died, and with it its processes; None while it runs."""
        self.handle_answers()
        return self._failure

    def close(self) -> None:
        """End the server, and with it all processes that it has started."""
        self._channel.close()
        try:
            self._server.wait(_STOP_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            self._server.kill()
            self._server.wait()

    def _receive(self) -> bytes:
        with suppress(ConnectionError):
            return self._channel.recv(MAX_MESSAGE_BYTES)
        return b""

    def _note_death(self) -> None:
        """The server has died: the kernel has asked its processes to end, and their exit codes are lost."""
        code = self._server.wait()
        words = self._log.read_text(errors="replace").strip().splitlines()
        self._failure = f"the process that starts nodes died: {describe_exit(code, words)}"
        self._channel.close()
        _, alive = psutil.wait_procs([psutil.Process(p) for p in self._running if psutil.pid_exists(p)], _END_TIMEOUT_S)
        for each in alive:
            each.kill()
        for process in (*self._waiting, *self._running.values()):
            process.ended(code)
        self._waiting.clear()
        self._running.clear()


def describe_exit(code: int | None, output: Sequence[str]) -> str:
    """Describe how a process ended, with the last line of its output that is not empty."""
    reason = f"killed by {signal.Signals(-code).name}" if code is not None and code < 0 else f"exit code {code}"
    if code in _CRASHES and (limits := low_limits()):
        reason += f" ({'; '.join(limits)})"
    words = [line for line in output if line.strip()]
    return f"{reason}: {words[-1]}" if words else reason


class ForkedProcess:
    """A process that was started by a fork server."""

    def __init__(self, starter: NodeStarter) -> None:
        self._starter = starter
        self._pid: int | None = None
        self._exit_code: int | None = None

    def started(self, pid: int) -> None:
        """Note that the process has been started."""
        self._pid = pid

    def ended(self, exit_code: int) -> None:
        """Note that the process has ended."""
        self._exit_code = exit_code

    @property
    def pid(self) -> int | None:
        """Process id; None before the process has been started."""
        if self._pid is None:
            self._starter.handle_answers()
        return self._pid

    def await_start(self) -> int:
        """Wait until the process has been started; return its id, or 0 if it could not be started."""
        while self._pid is None and self._exit_code is None:
            self._starter.handle_answers(1.0)
        return self._pid or 0

    def poll(self) -> int | None:
        """Exit code; None while the process runs, negative if a signal killed it."""
        if self._exit_code is None:
            self._starter.handle_answers()
        return self._exit_code

    def wait(self, timeout: float) -> int:
        """Wait for the end; ``subprocess.TimeoutExpired`` if it does not come in ``timeout`` seconds."""
        end_s = time.monotonic() + timeout
        while (code := self.poll()) is None:
            left_s = end_s - time.monotonic()
            if left_s <= 0:
                raise subprocess.TimeoutExpired(f"process {self._pid}", timeout)
            self._starter.handle_answers(left_s)
        return code

    def send_signal(self, number: int) -> None:
        """Send a signal, if the process runs; wait until it does."""
        if self.poll() is None and (pid := self.await_start()):
            with suppress(ProcessLookupError):
                os.kill(pid, number)
