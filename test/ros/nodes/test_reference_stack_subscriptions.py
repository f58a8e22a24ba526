"""The reference stack queues every cloud in lockstep, in a live graph the newest one, and answers no malformed one."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import rclpy
from made_up_scene import SENSORS, made_up_scene, made_up_spec
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from ros_domain import DOMAIN
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import String
from waiting import wait_until

from simbev_ros.reference_stack.node import ReferenceStack
from simbev_ros.ros.msgs.stamps import header

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
BEST_EFFORT = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)

SubscribedAs = Callable[..., ReliabilityPolicy]


@pytest.fixture
def subscribed_as(tmp_path: Path) -> Iterator[SubscribedAs]:
    """Function that starts the stack beside a publisher of clouds; returns the reliability that it asks for."""
    nodes: list[Node] = []
    text = made_up_scene(tmp_path / "bag", number=3, ticks=1).spec.model_dump_json()

    def subscribe(offered: QoSProfile, *arguments: str) -> ReliabilityPolicy:
        rclpy.init(args=["--ros-args", *arguments], domain_id=DOMAIN)
        graph, stack = Node("graph"), ReferenceStack()
        nodes.extend((graph, stack))
        graph.create_publisher(PointCloud2, "/ego/lidar/points", offered)
        graph.create_publisher(String, "/world/scene", LATCHED).publish(String(data=text))
        topic = "/ego/lidar/points"
        wait_until(
            lambda: graph.get_subscriptions_info_by_topic(topic),
            meanwhile=lambda: rclpy.spin_once(stack, timeout_sec=0.05),
        )
        return graph.get_subscriptions_info_by_topic(topic)[0].qos_profile.reliability

    yield subscribe
    for node in nodes:
        node.destroy_node()
    rclpy.shutdown()


def test_reliable_clouds_are_all_read(subscribed_as: SubscribedAs) -> None:
    assert subscribed_as(QoSProfile(depth=16)) == ReliabilityPolicy.RELIABLE


def test_of_clouds_that_are_best_effort_the_newest_is_read(subscribed_as: SubscribedAs) -> None:
    assert subscribed_as(BEST_EFFORT) == ReliabilityPolicy.BEST_EFFORT


def test_of_reliable_clouds_of_a_live_graph_the_newest_is_read(subscribed_as: SubscribedAs) -> None:
    assert subscribed_as(QoSProfile(depth=16), "-p", "live:=true") == ReliabilityPolicy.BEST_EFFORT


@pytest.mark.parametrize("fields", [{}, {"point_step": 16, "width": 9, "height": 1}], ids=["no columns", "no data"])
def test_a_malformed_cloud_is_not_answered_and_its_tick_is_reported(
    monkeypatch: pytest.MonkeyPatch, fields: dict[str, int]
) -> None:
    reports: list[int] = []
    monkeypatch.setattr(ReferenceStack, "_report", lambda _, scene, stamp_ns: reports.append(stamp_ns))
    spec = made_up_spec(SENSORS, ticks=2)
    head = header(spec.stamp_ns(0), "map")
    rclpy.init(domain_id=DOMAIN)
    try:
        stack = ReferenceStack()
        stack._on_scene(String(data=spec.model_dump_json()))
        stack._on_odometry(Odometry(header=head))
        stack._on_cloud(PointCloud2(header=head, **fields))
        stack.destroy_node()
    finally:
        rclpy.shutdown()
    assert reports == [spec.stamp_ns(0)]
