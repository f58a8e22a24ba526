"""A recorded scene, or a running graph, for Foxglove and Lichtblick, over a WebSocket."""

import os
from typing import TYPE_CHECKING

from rich.console import Console

from simbev_ros.ros.conventions.arguments import PLAIN, RosArguments

if TYPE_CHECKING:
    from simbev_ros.dataset.scene import Scene


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


def serve_graph(
    port: int, bind: str, domain: int | None, *, network: bool, console: Console, ros: RosArguments = PLAIN
) -> None:
    """Serve the running graph of a ROS domain until an interrupt; graphs may end and start meanwhile.

    Args:
        port: TCP port; 0: any free one.
        bind: Address to listen on.
        domain: ROS domain; None: that of ROS_DOMAIN_ID, or 0.
        network: Whether the graph may be on another host.
        console: Console for messages.
        ros: What the nodes of the graph are told, and its namespace.

    Raises:
        InputError: foxglove-sdk is not installed, ROS_DOMAIN_ID is no domain, or the address cannot be used.
    """
    from simbev_ros.show.foxglove.server import Address, require_foxglove

    require_foxglove()
    from simbev_ros.ros.graph.domain import domain_from_environment
    from simbev_ros.ros.graph.environment import graph_environment
    from simbev_ros.ros.graph.exposure import Exposure
    from simbev_ros.show.foxglove.graph_server import serve_domain

    number = domain_from_environment() if domain is None else domain
    os.environ.update(graph_environment(number, Exposure(network=network)))

    def announce(address: Address) -> None:
        console.print(f"serving ROS domain {number} at {address.url}", soft_wrap=True, highlight=False)

    def warn(line: str) -> None:
        console.print(f"warning: {line}", soft_wrap=True)

    serve_domain(number, Address(bind, port), announce, warn, ros)
