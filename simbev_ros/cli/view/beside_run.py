"""The viewer of a command that plays scenes: its options, and the context in which it runs."""

import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from simbev_ros.cli.view.options import LOOPBACK, RERUN_PORT
from simbev_ros.cli.view.recorded import require_rerun
from simbev_ros.foundation.errors import InputError
from simbev_ros.ros.conventions.arguments import PLAIN, RosArguments

if TYPE_CHECKING:
    from simbev_ros.cli.view.graph_viewer import GraphViewer

ViewOption = Annotated[bool, typer.Option("--view", help="Show the graph in Rerun's viewer.")]
ViewPortOption = Annotated[
    int | None,
    typer.Option(
        help=f"Port of the viewer; 0: any free one; default: {RERUN_PORT}.", min=0, max=65535, show_default=False
    ),
]


@contextmanager
def viewer_beside(
    port: int | None, console: Console, *, wanted: bool, network: bool = False, ros: RosArguments = PLAIN
) -> Iterator["GraphViewer"]:
    """A viewer of the graph that is started in this context, if one is wanted; it ends with the context.

    If standard input is a terminal, the viewer stays until Ctrl-C after the scenes.

    Args:
        port: Port of the viewer's page; None: the default.
        console: Where to print.
        wanted: Whether there is a viewer.
        network: Whether the graph takes part in the network.
        ros: ROS arguments for all nodes of the graph.

    Raises:
        InputError: Rerun is not installed, the port is taken, or there is a port without a viewer.
    """
    from simbev_ros.cli.view.graph_viewer import GraphViewer

    if not wanted and port is not None:
        raise InputError(f"--view-port {port}: is for --view")
    chosen = RERUN_PORT if port is None else port
    if wanted:
        require_rerun()
        _require_free(chosen)
    viewer = GraphViewer(chosen, console, wanted=wanted, network=network, ros=ros)
    with viewer:
        yield viewer
        viewer.stay()


def _require_free(port: int) -> None:
    """Raise InputError if something else listens on the viewer's port."""
    try:
        socket.create_server((LOOPBACK, port)).close()
    except OSError as error:
        words = os.strerror(error.errno or 0).lower()
        raise InputError(
            f"--view-port: {LOOPBACK}:{port} cannot be listened on: {words}; 0 takes any free port"
        ) from None
