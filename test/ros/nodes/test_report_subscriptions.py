"""Reports arrive from publishers of any durability, over the middleware."""

import time
from collections.abc import Callable, Iterator

import pytest
from rclpy.context import Context
from rclpy.executors import Executor, SingleThreadedExecutor
from rclpy.experimental.events_executor import EventsExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import Header
from waiting import PATIENCE_S

from simbev_ros.ros.nodes.reports import subscribe_to_reports

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
BEST_EFFORT = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
OUTSIDE = ("mine",)


@pytest.fixture
def stack(make_node: Callable[[str], Node]) -> Node:
    return make_node("stack")


class World:
    """A node that subscribes to reports, with its executor."""

    def __init__(self, node: Node, executor: Executor) -> None:
        self.node, self.executor = node, executor
        self.reports: list[str] = []
        self.executor.add_node(node)

    def listen(self, outside: tuple[str, ...]) -> None:
        subscribe_to_reports(self.node, lambda message: self.reports.append(message.frame_id), outside)

    def spin(self, until: Callable[[], bool], timeout_s: float = PATIENCE_S) -> bool:
        end_s = time.monotonic() + timeout_s
        while not until() and time.monotonic() < end_s:
            self.executor.spin_once(timeout_sec=0.05)
        return until()


@pytest.fixture(params=[EventsExecutor, SingleThreadedExecutor])
def world(request: pytest.FixtureRequest, own_domain: Context, make_node: Callable[[str], Node]) -> Iterator[World]:
    executor = request.param(context=own_domain)
    node = make_node("world")
    yield World(node, executor)
    executor.remove_node(node)
    executor.shutdown()


def test_a_publisher_with_the_default_qos_is_heard(world: World, stack: Node) -> None:
    world.listen(OUTSIDE)
    ready = stack.create_publisher(Header, "/sync/ready", 10)
    assert world.spin(lambda: ready.get_subscription_count() == 1)
    ready.publish(Header(frame_id="mine:Blocks-0000"))
    assert world.spin(lambda: world.reports == ["mine:Blocks-0000"])


def test_a_latched_report_is_heard_although_it_was_sent_before(world: World, stack: Node) -> None:
    ready = stack.create_publisher(Header, "/sync/ready", LATCHED)
    ready.publish(Header(frame_id="mine:Blocks-0000"))
    world.listen(OUTSIDE)
    assert world.spin(lambda: world.reports == ["mine:Blocks-0000"])


def test_reports_of_the_graph_itself_arrive_once_and_those_of_best_effort_publishers_never(
    world: World, stack: Node
) -> None:
    world.listen(OUTSIDE)
    unheard = stack.create_publisher(Header, "/sync/ready", BEST_EFFORT)
    ready = stack.create_publisher(Header, "/sync/ready", LATCHED)
    assert world.spin(lambda: ready.get_subscription_count() == 2)
    unheard.publish(Header(frame_id="mine:Blocks-0000"))
    for scene in range(3):
        ready.publish(Header(frame_id=f"lidar:Blocks-{scene:04d}:signature"))
    assert world.spin(lambda: len(world.reports) >= 3)
    assert not world.spin(lambda: len(world.reports) > 3, 1)
    assert world.reports == [f"lidar:Blocks-{scene:04d}:signature" for scene in range(3)]


def test_a_graph_without_outside_participants_has_one_subscription(world: World) -> None:
    world.listen(())
    assert len(list(world.node.subscriptions)) == 1
