"""Runs a node in a thread of its own, so that an interrupt never ends one of its callbacks."""

from collections.abc import Iterator
from contextlib import contextmanager
from threading import Event, Thread

from rclpy.node import Node

from simbev_ros.ros.nodes.main import make_executor

_STEP_S = 0.1


@contextmanager
def spinning(node: Node) -> Iterator[None]:
    """Run the callbacks of a node in a thread for as long as the context is open.

    The callbacks must not raise anything: rclpy's events executor crashes then.
    """
    ended = Event()
    executor = make_executor(takes_message_info=False)
    executor.add_node(node)

    def spin() -> None:
        while not ended.is_set():
            executor.spin_once(timeout_sec=_STEP_S)

    thread = Thread(target=spin, name="spinning")
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()
        executor.shutdown()
