"""Runs a ROS node outside the graph, in the test's own process."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import rclpy
from commands import DOMAIN
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions


@contextmanager
def outside_node(name: str) -> Iterator[tuple[Node, Callable[[Callable[[], bool], float], None]]]:
    """A node in the tests' domain, and a function that spins it until a condition holds."""
    context = Context()
    rclpy.init(context=context, domain_id=DOMAIN, signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node(name, context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)

    def spin_until(condition: Callable[[], bool], timeout_s: float) -> None:
        end_s = time.monotonic() + timeout_s
        while not condition():
            assert time.monotonic() < end_s, "timed out"
            executor.spin_once(timeout_sec=0.1)

    try:
        yield node, spin_until
    finally:
        executor.shutdown()
        node.destroy_node()
        context.shutdown()


def keep(messages: list[Any]) -> Callable[[Any], None]:
    """Callback that appends every message to a list."""
    return messages.append
