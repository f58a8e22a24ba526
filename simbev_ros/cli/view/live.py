"""``simbev view live``: a running graph in Rerun's viewer."""

import os
import time
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from simbev_ros.cli.agent_option import AgentOption
from simbev_ros.cli.console import make_console
from simbev_ros.cli.ros_options import NamespaceOption, ros_arguments
from simbev_ros.cli.view.browser import show_address
from simbev_ros.cli.view.options import (
    BROWSER_WIDTH_PX,
    LOOPBACK,
    RERUN_PORT,
    Bind,
    Domain,
    ImageWidth,
    Memory,
    Network,
    Open,
    Points,
    Port,
    RunningGraph,
    detail,
)
from simbev_ros.cli.view.recorded import require_rerun

if TYPE_CHECKING:
    from simbev_ros.show.rerun.subject import Detail

_IDLE_S = 0.5


def live(
    context: typer.Context,
    agent: AgentOption = None,
    domain: Domain = None,
    network: Network = False,
    namespace: NamespaceOption = None,
    rate: Annotated[float, typer.Option(help="Frames that are shown per second.", min=0.1, max=60)] = 5.0,
    port: Port = RERUN_PORT,
    bind: Bind = LOOPBACK,
    open_: Open = True,
    memory: Memory = 300,
    image_width: ImageWidth = BROWSER_WIDTH_PX,
    points: Points = 40_000,
    layers: Annotated[
        bool, typer.Option(help="Show other images than color, classes of lidar points and occupancy too.")
    ] = False,
) -> None:
    """Show a running graph, and the next one, in Rerun's viewer.

    The graph does not wait for the viewer, which drops what it cannot show in time. Ctrl-C ends it.

    [bold]Examples[/]

    simbev view live --domain 3
    """
    graph = RunningGraph(domain, network, ros_arguments(context, namespace))
    require_rerun()
    shown = detail(points, image_width or 0, memory, layers=layers)
    show_graph(graph, (port, bind), rate, shown, agent=agent, opens=open_)


def show_graph(
    graph: RunningGraph,
    place: tuple[int, str],
    rate_hz: float,
    detail: "Detail",
    *,
    agent: str | None = None,
    opens: bool,
) -> None:
    """Show the graph of a domain, and the next one, until an interrupt.

    Args:
        graph: Where the graph is.
        place: Port and address to listen on.
        rate_hz: Maximum number of frames per second of wall time.
        detail: How much is shown; beyond its limit of memory, the earliest is dropped.
        agent: Name of the agent that is shown; None: the first one of each scene.
        opens: Whether to open the browser.

    Raises:
        InputError: The port cannot be used, ROS_DOMAIN_ID is not a domain, or a scene does not have the agent.
        SimbevError: Rerun's server does not start, or has ended by itself.
    """
    from simbev_ros.ros.nodes.lifeline import SUPERVISOR_VARIABLE, end_with_supervisor
    from simbev_ros.show.rerun.live.live_viewer import running_viewer

    console = make_console()
    end_with_supervisor()
    printing = _Printing(graph.enter_domain(), console, is_alone=SUPERVISOR_VARIABLE not in os.environ)
    with running_viewer(place, rate_hz, detail, printing, graph.ros, agent) as viewer:
        show_address(viewer.page_url, console, opens=opens)
        while True:
            viewer.require_running()
            time.sleep(_IDLE_S)


class _Printing:
    """Prints what happens; not whether there is a graph if the same command runs it.

    Args:
        domain: ROS domain.
        console: Where to print.
        is_alone: Whether another command runs the graph.
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
        from simbev_ros.show.rerun.live.viewer_process import SHOWING

        self._print(f"{SHOWING}{name}")

    def messages_ignored(self, reason: str) -> None:
        """Print the reason."""
        self._print(f"warning: messages are not drawn: {reason}")

    def _print(self, line: str) -> None:
        self._console.print(line, soft_wrap=True, highlight=False)
