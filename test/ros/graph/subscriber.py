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
from rosgraph_msgs.msg import Clock
from std_srvs.srv import SetBool, Trigger
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


class Caller:
    """Calls services of a graph from a node outside."""

    def __init__(self, node: Node, spin_until: Callable[..., None]) -> None:
        self._node, self._spin_until = node, spin_until

    def call(self, kind: Any, name: str, request: Any) -> Any:
        """The answer of a service."""
        client = self._node.create_client(kind, name)
        self._spin_until(client.service_is_ready)
        future = client.call_async(request)
        self._spin_until(future.done)
        self._node.destroy_client(client)
        return future.result()

    def trigger(self, name: str) -> Any:
        """The answer of a service without a request."""
        return self.call(Trigger, name, Trigger.Request())

    def pause(self, *, paused: bool) -> Any:
        """Pause the world, or let it run; the answer."""
        return self.call(SetBool, "/world/pause", SetBool.Request(data=paused))


def clock_ns(clock: Clock) -> int:
    """The time of a clock's message, in nanoseconds."""
    return int(clock.clock.sec * 10**9 + clock.clock.nanosec)


def paused_ns(clocks: list[Clock], spin_until: Callable[..., None]) -> int:
    """Wait until a paused world has repeated its time; give that time in nanoseconds."""
    clocks.clear()
    spin_until(lambda: len(clocks) > 2 and len({clock_ns(each) for each in clocks[-3:]}) == 1)
    return clock_ns(clocks[-1])


def keep(messages: list[Any]) -> Callable[[Any], None]:
    """Callback that appends every message to a list."""
    return messages.append
