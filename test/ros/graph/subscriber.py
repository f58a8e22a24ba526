"""Runs a ROS node outside the graph, in the test's own process."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any

import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from ros_domain import DOMAIN
from waiting import wait_until


@contextmanager
def outside_node(name: str) -> Iterator[tuple[Node, Callable[..., None]]]:
    """A node in the tests' domain, and a function that spins it until a condition holds, as ``wait_until``."""
    context = Context()
    rclpy.init(context=context, domain_id=DOMAIN, signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node(name, context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)

    try:
        yield node, partial(wait_until, meanwhile=partial(executor.spin_once, timeout_sec=0.1))
    finally:
        executor.shutdown()
        node.destroy_node()
        context.shutdown()


def keep(messages: list[Any]) -> Callable[[Any], None]:
    """Callback that appends every message to a list."""
    return messages.append
