"""The picture of a running graph in Rerun's viewer."""

import os
import time
from typing import TYPE_CHECKING

from rich.console import Console

from simbev_ros.cli.view.browser import show_address

if TYPE_CHECKING:
    from simbev_ros.viewer.live.live_viewer import LiveOptions

_IDLE_S = 0.5


def show_graph(
    place: tuple[int, str],
    domain: int | None,
    memory_bytes: int,
    options: "LiveOptions",
    *,
    network: bool,
    opens: bool,
    console: Console,
) -> None:
    """Show the graph of a domain, and the next one, until an interrupt.

    Args:
        place: Port and address to listen on.
        domain: ROS domain; None: that of the environment, or 0.
        memory_bytes: Maximum size of what the viewer keeps.
        options: What is shown, and how often.
        network: Whether the graph may be on another host.
        opens: Whether to open the browser.
        console: Where to print.

    Raises:
        InputError: The port cannot be used, or ROS_DOMAIN_ID is no domain.
        SimbevError: Rerun's server does not start, or has ended by itself.
    """
    from simbev_ros.graph.domain import domain_of_environment
    from simbev_ros.graph.environment import graph_environment
    from simbev_ros.graph.exposure import Exposure
    from simbev_ros.nodes.lifeline import SUPERVISOR_VARIABLE, end_with_supervisor
    from simbev_ros.viewer.live.live_viewer import running_viewer

    end_with_supervisor()
    chosen = domain_of_environment() if domain is None else domain
    os.environ.update(graph_environment(chosen, Exposure(network=network)))
    had_graph = False

    def report_graph(is_there: bool) -> None:
        nonlocal had_graph
        if not is_there and SUPERVISOR_VARIABLE not in os.environ:  # else the graph comes and goes with the supervisor
            waiting = f"waiting for a graph in domain {chosen}; Ctrl-C ends"
            console.print(f"the graph has ended; {waiting}" if had_graph else waiting, soft_wrap=True, highlight=False)
        had_graph = is_there

    def report(line: str) -> None:
        console.print(f"warning: {line}", soft_wrap=True)

    with running_viewer(place, memory_bytes, options, report_graph, report) as viewer:
        show_address(viewer.page_url, console, opens=opens)
        while True:
            viewer.require_running()
            time.sleep(_IDLE_S)
