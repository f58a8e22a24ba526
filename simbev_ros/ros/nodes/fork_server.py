"""Starts node processes as forks of one process that has imported their code.

Most of what the nodes import is the same, and importing it in each of seven processes takes longer than all else at the
start of a graph. A fork takes milliseconds, and the processes share the memory of what was imported.

Usage: ``python -m simbev_ros.ros.nodes.fork_server DESCRIPTOR KIND …``; ``ros.graph.node_starter`` is the other end of
the socket. Each request names the arguments of ``ros.nodes.main``, or another command, and a file for the output.
Answers are the pid of a started process, and later how it ended. The server ends with the socket, which the kernel
closes when the supervisor dies, and then ends its processes and all that they have started.
"""

import atexit
import gc
import inspect
import json
import os
import select
import signal
import socket
import sys
import time
import traceback
import warnings
from contextlib import suppress
from typing import NoReturn

from setproctitle import setproctitle, setthreadtitle

from simbev_ros.foundation.process_limits import ending_on_shortage
from simbev_ros.ros.msgs.signing import KEY_VARIABLE
from simbev_ros.ros.nodes import main as nodes
from simbev_ros.ros.nodes.lifeline import SUPERVISOR_VARIABLE, end_with_supervisor, wake_at_end_of_supervisor

MAX_MESSAGE_BYTES = 1 << 16
"""Length of the longest request or answer."""

_STOP_TIMEOUT_S = 15.0
"""Time that processes have to end after the death of the supervisor, before they are killed."""


def main() -> None:
    """Serve until the other end of the socket is closed; in each forked process, run nodes instead."""
    wake_at_end_of_supervisor()
    channel = socket.socket(fileno=int(sys.argv[1]))
    for kind in sys.argv[2:]:
        nodes.node_class(kind)
    inspect.getmodule(inspect.currentframe())  # fills a table of all modules, which the first log message needs
    gc.collect()
    gc.freeze()  # a collection would copy the pages that all processes share
    arguments = _ForkServer(channel).serve()
    if arguments is not None:
        _run_nodes(arguments)


def _run_nodes(arguments: list[str]) -> NoReturn:
    """Run nodes and end the process, without the destructors of libraries.

    That of LTTng, which tracetools loads, would cancel threads that a fork does not have.
    """
    code = 1
    try:
        code = nodes.main(arguments)
    except Exception:
        traceback.print_exc()
    finally:
        atexit._run_exitfuncs()
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


class _ForkServer:
    def __init__(self, channel: socket.socket) -> None:
        self._channel = channel
        self._running: set[int] = set()
        self._child_ended, self._waking = socket.socketpair()
        self._child_ended.setblocking(False)
        self._waking.setblocking(False)
        signal.signal(signal.SIGCHLD, lambda *_: None)
        signal.set_wakeup_fd(self._waking.fileno(), warn_on_full_buffer=False)

    def serve(self) -> list[str] | None:
        """Handle requests; return None when the supervisor is gone, and in a forked process the arguments for nodes.

        A process for another command does not return.
        """
        while True:
            ready, _, _ = select.select([self._channel, self._child_ended], [], [])
            if self._child_ended in ready:
                self._child_ended.recv(MAX_MESSAGE_BYTES)
                self._report_ended()
            if self._channel in ready:
                request = self._receive()
                if not request:
                    self._end_all()
                    return None
                fields = json.loads(request)
                if self._fork(fields.pop("log")):
                    return _become(**fields)

    def _receive(self) -> bytes:
        """The next request; empty when the supervisor is gone."""
        with suppress(ConnectionResetError):  # it was killed before it had read the last answer
            return self._channel.recv(MAX_MESSAGE_BYTES)
        return b""

    def _fork(self, log: str) -> bool:
        """Fork; return whether this is the new process."""
        server = os.getpid()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)  # of threads: LTTng has some, which wait for a tracer
            pid = os.fork()
        if pid == 0:
            self._leave(log)
            os.environ[SUPERVISOR_VARIABLE] = str(server)
            return True
        self._running.add(pid)
        self._answer(started=pid)
        return False

    def _leave(self, log: str) -> None:
        """Give the new process its own session, output and signals, as if it had been started directly."""
        os.setsid()
        signal.set_wakeup_fd(-1)
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)
        for each in (self._channel, self._child_ended, self._waking):
            each.close()
        output = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
        for descriptor in (sys.stdout.fileno(), sys.stderr.fileno()):
            os.dup2(output, descriptor)
        os.close(output)

    def _report_ended(self) -> None:
        while self._running:
            pid, status = os.waitpid(-1, os.WNOHANG)
            if pid == 0:
                return
            if pid not in self._running:  # LTTng forks a process that looks for its shared memory
                continue
            self._running.remove(pid)
            _signal_group(pid, signal.SIGKILL)  # what it has started and left
            self._answer(ended=pid, exit_code=os.waitstatus_to_exitcode(status))

    def _answer(self, **values: int) -> None:
        with suppress(OSError):  # the supervisor is gone, which the next read reports
            self._channel.send(json.dumps(values).encode())

    def _end_all(self) -> None:
        """Ask all processes to end, also those that are stopped; kill the ones that do not, and what they left."""
        self._signal(signal.SIGTERM)
        self._signal(signal.SIGCONT)
        end_s = time.monotonic() + _STOP_TIMEOUT_S
        while self._running and time.monotonic() < end_s:
            select.select([self._child_ended], [], [], 0.1)
            self._report_ended()
        self._signal(signal.SIGKILL)

    def _signal(self, number: signal.Signals) -> None:
        for pid in self._running:
            if not _signal_group(pid, number):  # it has been forked so recently that it leads no group yet
                os.kill(pid, number)


def _signal_group(leader: int, number: signal.Signals) -> bool:
    """Signal a group of processes; return whether there is one."""
    try:
        os.killpg(leader, number)
    except ProcessLookupError:
        return False
    return True


def _become(arguments: list[str], *, is_command: bool) -> list[str]:
    """Return the arguments for ``ros.nodes.main``, with a title for the process; or run another command."""
    if not is_command:
        words = ["simbev_ros.ros.nodes.main", *arguments]
        setproctitle(" ".join(words))  # as if it had been started by hand
        setthreadtitle(arguments[0].partition(":")[2].rpartition("/")[2])
        return words
    for name in (KEY_VARIABLE, "SPT_NOENV", "PYTHONSAFEPATH"):
        os.environ.pop(name, None)
    end_with_supervisor()
    try:
        os.execvp(arguments[0], arguments)
    except OSError as error:
        print(f"{arguments[0]}: {error.strerror}", file=sys.stderr, flush=True)
        os._exit(os.EX_OSERR)


if __name__ == "__main__":
    with ending_on_shortage():
        main()
