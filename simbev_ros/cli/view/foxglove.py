"""``simbev view foxglove``: a recorded scene, or a running graph, for Foxglove and Lichtblick, over a WebSocket."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from simbev_ros.cli.console import make_console
from simbev_ros.cli.ros_options import NamespaceOption, ros_arguments
from simbev_ros.cli.view.options import (
    FOXGLOVE_PORT,
    LOOPBACK,
    Bind,
    Domain,
    Network,
    Port,
    RunningGraph,
    SceneOption,
    choose_scene,
)
from simbev_ros.foundation.errors import InputError

if TYPE_CHECKING:
    from simbev_ros.dataset.scene import Scene


def foxglove(
    context: typer.Context,
    path: Annotated[
        Path | None,
        typer.Argument(
            metavar="BAG|DATASET", help="A scene's bag, or a dataset; default: the running graph.", show_default=False
        ),
    ] = None,
    scene: SceneOption = None,
    domain: Domain = None,
    network: Network = False,
    namespace: NamespaceOption = None,
    port: Port = FOXGLOVE_PORT,
    bind: Bind = LOOPBACK,
) -> None:
    """Serve a recorded scene or a running graph to Foxglove and Lichtblick, with the topics of all agents.

    [bold]Examples[/]

    simbev view foxglove out/demo

    simbev view foxglove --domain 3              the running graph, and the next one
    """
    ros = ros_arguments(context, namespace)
    of_graphs = {"--domain": domain is not None, "--network": network, "--namespace": namespace is not None}
    of_graphs["--ros-args"] = bool(context.obj)
    if path is not None and (given := [option for option, is_given in of_graphs.items() if is_given]):
        raise InputError(f"{given[0]}: is for the running graph; leave {path} out")
    if path is None and scene is not None:
        raise InputError(f"--scene {scene}: is for a recorded scene; give its bag or dataset")
    if path is None:
        serve_graph(RunningGraph(domain, network, ros), port, bind, make_console())
    else:
        serve_recorded(choose_scene(path, scene), port, bind, make_console())


def serve_recorded(scene: "Scene", port: int, bind: str, console: Console) -> None:
    """Serve a scene until an interrupt.

    Raises:
        InputError: foxglove-sdk is not installed, or the address cannot be used.
        BagError: The bag cannot be read.
    """
    from simbev_ros.recording.reader import SceneBag
    from simbev_ros.show.foxglove.bag_server import serve_bag
    from simbev_ros.show.foxglove.server import Address

    def warn(line: str) -> None:
        console.print(f"warning: {line}", soft_wrap=True)

    with SceneBag(scene.path) as bag:

        def announce(address: Address) -> None:
            console.print(f"serving {bag.name} at {address.url}", soft_wrap=True, highlight=False)
            if not bag.closed:
                warn("the bag was cut off; what it holds is served")

        serve_bag(bag, Address(bind, port), announce, warn)


def serve_graph(graph: RunningGraph, port: int, bind: str, console: Console) -> None:
    """Serve the running graph of a ROS domain until an interrupt; graphs may end and start meanwhile.

    Args:
        graph: Where the graph is.
        port: TCP port; 0: any free one.
        bind: Address to listen on.
        console: Console for messages.

    Raises:
        InputError: foxglove-sdk is not installed, ROS_DOMAIN_ID is not a domain, or the address cannot be used.
    """
    from simbev_ros.show.foxglove.server import Address, require_foxglove

    require_foxglove()
    from simbev_ros.show.foxglove.graph_server import serve_domain

    number = graph.enter_domain()

    def announce(address: Address) -> None:
        console.print(f"serving ROS domain {number} at {address.url}", soft_wrap=True, highlight=False)

    def warn(line: str) -> None:
        console.print(f"warning: {line}", soft_wrap=True)

    serve_domain(number, Address(bind, port), announce, warn, graph.ros)
