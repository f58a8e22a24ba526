"""``simbev view --live`` as a process of low priority beside a graph, which does not depend on it."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Mapping
from contextlib import ExitStack
from threading import Thread
from typing import Self

from rich.console import Console

from simbev_ros.cli.view.browser import show_address
from simbev_ros.graph.interrupts import Interrupted
from simbev_ros.graph.node_starter import describe_exit
from simbev_ros.graph.traces import Traces
from simbev_ros.nodes.lifeline import SUPERVISOR_VARIABLE
from simbev_ros.production.observer import ProductionObserver
from simbev_ros.scene.spec import SceneSpec

_NICENESS, _MAX_NICENESS = 10, 19
_END_TIMEOUT_S = 8.0
_STEP_S = 0.5
_ADDRESS = "viewer: "
"""Beginning of the line in which the viewer prints its address."""


class ViewerProcess(ProductionObserver):
    """Starts ``simbev view --live`` when the graph has started, and ends it with the context.

    Args:
        port: Port of the viewer's page; 0: any free one.
        console: Where to print.
        wanted: Whether to start it at all.
        network: Whether the graph takes part in the network.
    """

    def __init__(self, port: int, console: Console, *, wanted: bool, network: bool) -> None:
        self._port, self._console, self._wanted, self._network = port, console, wanted, network
        self._process: subprocess.Popen[str] | None = None
        self._stack = ExitStack()
        self._is_ending = False

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._is_ending = True
        self._stack.close()

    def graph_started(self, domain_id: int, security_variables: Mapping[str, str]) -> None:
        """Start the viewer."""
        if not self._wanted:
            return
        self._traces = Traces()
        self._stack.callback(self._traces.remove, keep_logs=False)
        environment = {
            **os.environ,
            **security_variables,
            SUPERVISOR_VARIABLE: str(os.getpid()),
            "TMPDIR": str(self._traces.folder),
        }
        self._process = process = subprocess.Popen(
            [
                *(sys.executable, "-m", "simbev_ros.cli.main", "view", "--live", "--no-open"),
                *("--domain", str(domain_id), "--port", str(self._port), *(["--network"] if self._network else [])),
            ],
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,  # Ctrl-C ends it through this process
        )
        os.setpriority(os.PRIO_PROCESS, process.pid, min(os.getpriority(os.PRIO_PROCESS, 0) + _NICENESS, _MAX_NICENESS))
        printing = Thread(target=self._print, args=(process,), daemon=True)
        printing.start()
        self._stack.callback(printing.join, _END_TIMEOUT_S)
        self._stack.callback(_end, process)

    def scene_progressed(self, spec: SceneSpec, tick: int | None) -> None:
        """Note the files that the viewer has in shared memory, which are removed if it is killed."""
        self._note_files()

    def stay(self) -> None:
        """If a person sits at the terminal, wait until they end the viewer."""
        if self._process is None or not sys.stdin.isatty() or self._process.poll() is not None:
            return
        self._console.print("the viewer stays open; Ctrl-C ends it")
        try:
            while self._process.poll() is None:
                self._note_files()
                time.sleep(_STEP_S)
        except Interrupted:
            return

    def _note_files(self) -> None:
        if self._process is not None:
            self._traces.note([self._process.pid])

    def _print(self, process: subprocess.Popen[str]) -> None:
        """Print the address and what else the viewer prints, and that it has died if it does."""
        assert process.stdout is not None
        with process.stdout:
            for line in process.stdout:
                if line.startswith(_ADDRESS):
                    show_address(line.removeprefix(_ADDRESS).strip(), self._console, opens=True)
                elif not self._is_ending:
                    self._console.print(f"viewer: {line.strip()}", soft_wrap=True, highlight=False)
        code = process.wait()
        if not self._is_ending:
            self._console.print(f"the viewer has ended, {describe_exit(code, ())}", soft_wrap=True, highlight=False)


def _end(process: subprocess.Popen[str]) -> None:
    """End the viewer's process, with time to end Rerun's server."""
    process.send_signal(signal.SIGTERM)
    process.send_signal(signal.SIGCONT)  # a stopped process would never receive the request
    try:
        process.wait(_END_TIMEOUT_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
