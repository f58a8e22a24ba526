"""The picture of a running graph in Rerun's viewer."""

import os
import time
from typing import TYPE_CHECKING

from rich.console import Console

from simbev_ros.cli.view.browser import show_address
from simbev_ros.ros.conventions.arguments import PLAIN, RosArguments
from simbev_ros.show.rerun.live.viewer_process import SHOWING

if TYPE_CHECKING:
    from simbev_ros.show.rerun.subject import Detail

_IDLE_S = 0.5


def show_graph(
    place: tuple[int, str],
    domain: int | None,
    rate_hz: float,
    detail: "Detail",
    *,
    agent: str | None = None,
    network: bool,
    opens: bool,
    console: Console,
    ros: RosArguments = PLAIN,
) -> None:
    """Show the graph of a domain, and the next one, until an interrupt.

    Args:
        place: Port and address to listen on.
        domain: ROS domain; None: that of the environment, or 0.
        rate_hz: Maximum number of frames per second of wall time.
        detail: How much is shown; beyond its limit of memory, the earliest is dropped.
        agent: Name of the agent that is shown; None: the first one of each scene.
        network: Whether the graph may be on another host.
        opens: Whether to open the browser.
        console: Where to print.
        ros: What the nodes of the graph are told, and its namespace.

    Raises:
        InputError: The port cannot be used, ROS_DOMAIN_ID is no domain, or a scene does not have the agent.
        SimbevError: Rerun's server does not start, or has ended by itself.
    """
    from simbev_ros.ros.graph.domain import domain_from_environment
    from simbev_ros.ros.graph.environment import graph_environment
    from simbev_ros.ros.graph.exposure import Exposure
    from simbev_ros.ros.nodes.lifeline import SUPERVISOR_VARIABLE, end_with_supervisor
    from simbev_ros.show.rerun.live.live_viewer import running_viewer

    end_with_supervisor()
    chosen = domain_from_environment() if domain is None else domain
    os.environ.update(graph_environment(chosen, Exposure(network=network)))
    printing = _Printing(chosen, console, is_alone=SUPERVISOR_VARIABLE not in os.environ)
    with running_viewer(place, rate_hz, detail, printing, ros, agent) as viewer:
        show_address(viewer.page_url, console, opens=opens)
        while True:
            viewer.require_running()
            time.sleep(_IDLE_S)


class _Printing:
    """Prints what happens; not whether there is a graph beside a command that runs it.

    Args:
        domain: ROS domain.
        console: Where to print.
        is_alone: Whether the graph belongs to somebody else.
    """

    def __init__(self, domain: int, console: Console, *, is_alone: bool) -> None:
        self._waiting = f"waiting for a graph in domain {domain}; Ctrl-C ends"
        self._console, self._is_alone, self._had_graph = console, is_alone, False

    def graph_noticed(self, is_there: bool) -> None:
        """Print that there is no graph."""
        if self._is_alone and not is_there:
            self._print(f"the graph has ended; {self._waiting}" if self._had_graph else self._waiting)
        self._had_graph = is_there

    def scene_shown(self, name: str) -> None:
        """Print the name."""
        self._print(f"{SHOWING}{name}")

    def messages_ignored(self, reason: str) -> None:
        """Print the reason."""
        self._print(f"warning: messages are not drawn: {reason}")

    def _print(self, line: str) -> None:
        self._console.print(line, soft_wrap=True, highlight=False)
