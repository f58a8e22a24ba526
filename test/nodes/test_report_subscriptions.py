"""Reports arrive from publishers of any durability, over the middleware."""

import os
import time
from collections.abc import Callable, Iterator

import pytest
import rclpy
from rclpy.context import Context
from rclpy.executors import Executor, SingleThreadedExecutor
from rclpy.experimental.events_executor import EventsExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import Header

from simbev_ros.nodes.reports import subscribe_to_reports

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
BEST_EFFORT = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
OUTSIDE = ("mine",)


@pytest.fixture
def context() -> Iterator[Context]:
    made = Context()
    rclpy.init(context=made, domain_id=39)
    yield made
    made.shutdown()


@pytest.fixture
def stack(context: Context) -> Iterator[Node]:
    node = rclpy.create_node(f"stack_{os.getpid()}", context=context)
    yield node
    node.destroy_node()


class World:
    """A node that subscribes to reports."""

    def __init__(self, context: Context, executor: Executor, outside: tuple[str, ...]) -> None:
        self.node = rclpy.create_node("world", context=context)
        self.reports: list[str] = []
        subscribe_to_reports(self.node, lambda message: self.reports.append(message.frame_id), outside)
        self.executor = executor
        self.executor.add_node(self.node)

    def spin(self, until: Callable[[], bool], timeout_s: float) -> bool:
        end_s = time.monotonic() + timeout_s
        while not until() and time.monotonic() < end_s:
            self.executor.spin_once(timeout_sec=0.05)
        return until()


@pytest.fixture(params=[EventsExecutor, SingleThreadedExecutor])
def executor(request: pytest.FixtureRequest, context: Context) -> Iterator[Executor]:
    made = request.param(context=context)
    yield made
    made.shutdown()


def test_a_publisher_with_the_default_qos_is_heard(context: Context, stack: Node, executor: Executor) -> None:
    world = World(context, executor, OUTSIDE)
    ready = stack.create_publisher(Header, "/sync/ready", 10)
    assert world.spin(lambda: ready.get_subscription_count() == 1, 10)
    ready.publish(Header(frame_id="mine:Blocks-0000"))
    assert world.spin(lambda: world.reports == ["mine:Blocks-0000"], 10)


def test_a_latched_report_is_heard_although_it_was_sent_before(
    context: Context, stack: Node, executor: Executor
) -> None:
    ready = stack.create_publisher(Header, "/sync/ready", LATCHED)
    ready.publish(Header(frame_id="mine:Blocks-0000"))
    world = World(context, executor, OUTSIDE)
    assert world.spin(lambda: world.reports == ["mine:Blocks-0000"], 10)


def test_reports_of_the_graph_itself_arrive_once_and_those_of_best_effort_publishers_never(
    context: Context, stack: Node, executor: Executor
) -> None:
    world = World(context, executor, OUTSIDE)
    unheard = stack.create_publisher(Header, "/sync/ready", BEST_EFFORT)
    ready = stack.create_publisher(Header, "/sync/ready", LATCHED)
    assert world.spin(lambda: ready.get_subscription_count() == 2, 10)
    unheard.publish(Header(frame_id="mine:Blocks-0000"))
    for scene in range(3):
        ready.publish(Header(frame_id=f"lidar:Blocks-{scene:04d}:signature"))
    assert not world.spin(lambda: len(world.reports) > 3, 1)
    assert world.reports == [f"lidar:Blocks-{scene:04d}:signature" for scene in range(3)]


def test_a_graph_without_outside_participants_has_one_subscription(
    context: Context, stack: Node, executor: Executor
) -> None:
    world = World(context, executor, ())
    assert len(list(world.node.subscriptions)) == 1
