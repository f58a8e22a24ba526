"""What the tests of nodes share."""

from collections.abc import Callable, Iterator
from contextlib import nullcontext
from typing import Any

import pytest
import rclpy
from rclpy.context import Context
from rclpy.experimental.events_executor import EventsExecutor
from rclpy.node import Node

from simbev_ros.ros.graph.domain import DomainLock
from simbev_ros.ros.nodes import annotator_node, world_node


@pytest.fixture(scope="session", autouse=True)
def no_memory_policy() -> Iterator[None]:
    """Leave garbage collection alone: a node that freezes its objects first scans all that the tests have left."""
    with pytest.MonkeyPatch.context() as patch:
        for module in (annotator_node, world_node):
            patch.setattr(module, "freeze_after_loading", nullcontext)
        yield


@pytest.fixture
def executor(node: Any) -> Iterator[EventsExecutor]:
    """An executor that spins the test's node; it drops the node, which would outlive its test otherwise."""
    made = EventsExecutor()
    made.add_node(node)
    yield made
    made.remove_node(node)
    made.shutdown()


@pytest.fixture
def own_domain(monkeypatch: pytest.MonkeyPatch) -> Iterator[Context]:
    """A ROS context in a domain in which nobody else is."""
    monkeypatch.delenv("ROS_DOMAIN_ID", raising=False)
    made = Context()
    with DomainLock() as lock:
        rclpy.init(context=made, domain_id=lock.domain)
        yield made
        made.try_shutdown()


@pytest.fixture
def make_node(own_domain: Context) -> Iterator[Callable[[str], Node]]:
    """Function that makes a node in a domain of the test's own; the nodes are destroyed when the test has ended."""
    made: list[Node] = []

    def make(name: str) -> Node:
        made.append(rclpy.create_node(name, context=own_domain))
        return made[-1]

    yield make
    for node in made:
        node.destroy_node()
