"""Serves a running graph to Foxglove and Lichtblick; the node that it starts ends with it."""

import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

import rclpy
from rclpy.signals import SignalHandlerOptions

from simbev_ros.ros.conventions.arguments import PLAIN, RosArguments
from simbev_ros.ros.conventions.names import NamespacedNode, NodeName
from simbev_ros.ros.nodes.spinning import spinning
from simbev_ros.show.foxglove.graph_relay import GraphRelay
from simbev_ros.show.foxglove.server import Address, running_server

_BACKLOG = 128
"""Maximum number of messages that wait for a slow client; then the oldest are dropped for it."""
_NICENESS = 10
"""Lower priority than that of the graph, which needs the cores more."""
_IDLE_S = 0.1


def serve_domain(
    domain: int,
    address: Address,
    on_started: Callable[[Address], None],
    warn: Callable[[str], None],
    ros: RosArguments = PLAIN,
) -> None:
    """Serve the graph of a ROS domain until an exception, such as an interrupt, ends it.

    Graphs may start and end meanwhile.

    Args:
        domain: ROS domain.
        address: Where to listen.
        on_started: Called with the address once clients can connect.
        warn: Called with a line for each topic that cannot be shown.
        ros: ROS arguments for the nodes of the graph, and its namespace; clients see the names without it.

    Raises:
        InputError: The address cannot be used.
    """
    import foxglove

    with suppress(OSError):  # a sandbox may forbid it
        os.nice(_NICENESS)
    context = foxglove.Context()
    with _spinning_node(domain, ros) as node:
        relay = GraphRelay(node, context, warn)
        with running_server(f"ROS domain {domain}", address, relay, context, message_backlog_size=_BACKLOG) as (
            server,
            used,
        ):
            relay.server = server
            on_started(used)
            while relay.failure is None:
                time.sleep(_IDLE_S)
            relay.server = None
            raise relay.failure


@contextmanager
def _spinning_node(domain: int, ros: RosArguments) -> Iterator[NamespacedNode]:
    """A node of a domain whose callbacks run in a thread."""
    rclpy.init(domain_id=domain, args=ros.for_nodes, signal_handler_options=SignalHandlerOptions.NO)
    name = NodeName("simbev_view", graph=ros.namespace)
    node = NamespacedNode(name, enable_rosout=False, start_parameter_services=False)
    try:
        with spinning(node):
            yield node
    finally:
        node.destroy_node()
        rclpy.shutdown()
