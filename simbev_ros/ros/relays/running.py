"""The base of the relays, and how they run as programs."""

from collections.abc import Callable
from typing import Any

import rclpy
import rclpy.utilities
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import QoSProfile

from simbev_ros.foundation.errors import FOREIGN_ERRORS, SimbevError
from simbev_ros.ros.nodes.lifeline import ending_middleware

_WARNING_PERIOD_S = 10.0


class Relay(Node):
    """Base of the relays. Messages that cannot be relayed, which any process can send, are ignored with a warning."""

    def listen(self, kind: type[Any], topic: str, relay: Callable[[Any], None], qos: QoSProfile) -> str:
        """Subscribe to a topic; return its name after remapping.

        Args:
            kind: Type of its messages.
            topic: Its name.
            relay: Called with each message.
            qos: Quality of service.
        """

        def receive(message: Any) -> None:
            try:
                relay(message)
            except (SimbevError, *FOREIGN_ERRORS) as error:
                self.get_logger().warning(
                    f"ignored a malformed message on {topic}: {error!r:.200}", throttle_duration_sec=_WARNING_PERIOD_S
                )

        return str(self.create_subscription(kind, topic, receive, qos).topic_name)


def run(make_node: Callable[[], Node]) -> None:
    """Run a node until SIGINT or SIGTERM; arguments after ``--ros-args`` are its own."""
    rclpy.init()
    node = make_node()
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        with ending_middleware(0):
            node.destroy_node()
            rclpy.utilities.try_shutdown()
