"""What the tests of nodes share."""

from collections.abc import Iterator
from typing import Any

import pytest
from rclpy.experimental.events_executor import EventsExecutor


@pytest.fixture
def executor(node: Any) -> Iterator[EventsExecutor]:
    """An executor that spins the test's node; it lets go of it, or the node would outlive its test."""
    made = EventsExecutor()
    made.add_node(node)
    yield made
    made.remove_node(node)
    made.shutdown()
