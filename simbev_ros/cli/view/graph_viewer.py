"""Starts the viewer for a graph that plays scenes, and prints what it says; the graph does not depend on it."""

import sys
import time
from collections.abc import Mapping
from contextlib import ExitStack
from threading import Thread
from typing import Self

from rich.console import Console

from simbev_ros.cli.view.browser import show_address
from simbev_ros.production.events import GraphStarted, ProductionEvent, SceneProgressed
from simbev_ros.production.observer import ProductionObserver
from simbev_ros.ros.conventions.arguments import PLAIN, RosArguments
from simbev_ros.ros.graph.interrupts import Interrupted
from simbev_ros.ros.graph.node_starter import describe_exit
from simbev_ros.ros.graph.resources import GraphResources
from simbev_ros.show.rerun.live.viewer_process import ADDRESS, SHOWING, ViewerProcess

_PRINTING_TIMEOUT_S = 2.0
_STEP_S = 0.5


class GraphViewer(ProductionObserver):
    """Starts the viewer when the graph has started, and ends it with the context.

    Args:
        port: Port of the viewer's page; 0: any free one.
        console: Where to print.
        wanted: Whether to start it at all.
        network: Whether the graph takes part in the network.
        ros: ROS arguments for all nodes of the graph and for the viewer.
    """

    def __init__(self, port: int, console: Console, *, wanted: bool, network: bool, ros: RosArguments = PLAIN) -> None:
        self._port, self._console, self._wanted, self._network, self._ros = port, console, wanted, network, ros
        self._process: ViewerProcess | None = None
        self._stack = ExitStack()
        self._is_ending = False

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._is_ending = True
        self._stack.close()

    def notify(self, event: ProductionEvent) -> None:
        """Start the viewer with the graph, and note its files while a scene is played."""
        if isinstance(event, GraphStarted) and self._wanted:
            self._start(event.domain_id, event.security_variables)
        elif isinstance(event, SceneProgressed):
            self._note_files()

    def _start(self, domain_id: int, security_variables: Mapping[str, str]) -> None:
        self._resources = GraphResources()
        self._stack.callback(self._resources.remove, keep_logs=False)
        self._process = ViewerProcess(
            domain_id,
            self._port,
            self._resources.folder,
            security_variables,
            network=self._network,
            ros=self._ros,
        )
        printing = Thread(target=self._print, args=(self._process,), daemon=True)
        printing.start()
        self._stack.callback(printing.join, _PRINTING_TIMEOUT_S)
        self._stack.enter_context(self._process)

    def stay(self) -> None:
        """If standard input is a terminal, wait until the user ends the viewer."""
        if self._process is None or not sys.stdin.isatty() or self._process.exit_code is not None:
            return
        self._console.print("the viewer stays open; Ctrl-C ends it")
        try:
            while self._process.exit_code is None:
                self._note_files()
                time.sleep(_STEP_S)
        except Interrupted:
            return

    def _note_files(self) -> None:
        """Note the files that the viewer has in shared memory, which are removed if it is killed."""
        if self._process is not None:
            self._resources.note([self._process.pid])

    def _print(self, process: ViewerProcess) -> None:
        """Print the address and what else the viewer prints, and that it has died if it does."""
        for line in process.lines():
            if line.startswith(ADDRESS):
                show_address(line.removeprefix(ADDRESS), self._console, opens=True)
            elif not (self._is_ending or line.startswith(SHOWING)):
                self._console.print(f"viewer: {line}", soft_wrap=True, highlight=False)
        if not self._is_ending:
            how = describe_exit(process.exit_code, ())
            self._console.print(f"the viewer has ended, {how}; the graph continues", soft_wrap=True, highlight=False)
