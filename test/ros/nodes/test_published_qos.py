"""Publishers of the graph connect to the subscribers that ROS users have, and ROS parameters override their QoS."""

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import rclpy
import yaml
from nav_msgs.msg import OccupancyGrid
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from ros_domain import DOMAIN
from waiting import PATIENCE_S

from simbev_ros.foundation.errors import InputError
from simbev_ros.ros.conventions.names import NodeName
from simbev_ros.ros.msgs.message_types import message_class
from simbev_ros.ros.msgs.topic import Topic
from simbev_ros.ros.nodes.graph_node import GraphNode

POINTS = Topic("/ego/lidar/points", "sensor_msgs/msg/PointCloud2", sensor=True)
ACTORS = Topic("/world/actors", "sensor_msgs/msg/PointCloud2")
GRID = Topic("/ego/bev/road/grid", "nav_msgs/msg/OccupancyGrid", keeps_newest=True)
RELIABILITY = "qos_overrides./ego/lidar/points.publisher.reliability"
DEFAULT = QoSProfile(depth=10)
MAP = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""How Nav2's static layer subscribes."""

MakeNode = Callable[..., GraphNode]


@pytest.fixture
def make_node(tmp_path: Path) -> Iterator[MakeNode]:
    """Function that makes a node of a graph with ROS parameters."""
    nodes: list[GraphNode] = []

    def make(namespace: str = "", **parameters: object) -> GraphNode:
        file = tmp_path / "parameters.yaml"
        file.write_text(yaml.safe_dump({"/**": {"ros__parameters": parameters}}))
        rclpy.init(args=["--ros-args", "--params-file", str(file)], domain_id=DOMAIN)
        nodes.append(GraphNode(NodeName("lidar", "ego", namespace)))
        return nodes[0]

    yield make
    for node in nodes:
        node.destroy_node()
    rclpy.shutdown()


def offered(node: GraphNode, topic: Topic) -> QoSProfile:
    """QoS with which a node publishes a topic."""
    node.advertise(topic)
    (publisher,) = [each for each in node.publishers if each.topic_name == topic.name]
    return publisher.qos_profile


def received(node: GraphNode, topic: Topic, qos: QoSProfile, *, late: bool = False, limit_s: float = 1.0) -> list[Any]:
    """Messages that a subscriber gets of one that is sent when it is connected or, if it comes late, before."""
    messages: list[Any] = []
    node.advertise(topic)
    kind, sent = message_class(topic.type), False
    if late:
        node.publish(topic.name, kind())
    node.create_subscription(kind, topic.name, messages.append, qos)
    end_s = time.monotonic() + limit_s
    while not messages and time.monotonic() < end_s:
        if not late and not sent and node.reader_count(topic.name):
            node.publish(topic.name, kind())
            sent = True
        rclpy.spin_once(node, timeout_sec=0.05)
    return messages


def test_a_subscriber_with_default_qos_gets_live_sensor_data_if_they_are_reliable(make_node: MakeNode) -> None:
    assert len(received(make_node(live=True, reliable=True), POINTS, DEFAULT, limit_s=PATIENCE_S)) == 1


def test_live_sensor_data_are_best_effort_by_default_and_depth_stays_if_they_are_reliable(make_node: MakeNode) -> None:
    node = make_node(live=True)
    assert (offered(node, POINTS).reliability, offered(node, POINTS).depth) == (ReliabilityPolicy.BEST_EFFORT, 5)
    assert offered(node, ACTORS).reliability == ReliabilityPolicy.RELIABLE
    node.reliable = True
    assert (node.offered_qos(POINTS).reliability, node.offered_qos(POINTS).depth) == ("reliable", 5)
    assert received(node, POINTS, DEFAULT) == [], "the publisher of before is best effort"


def test_a_late_subscriber_gets_the_newest_grid_as_it_would_a_map(make_node: MakeNode) -> None:
    assert len(received(make_node(), GRID, MAP, late=True, limit_s=PATIENCE_S)) == 1


def test_a_grid_reaches_a_subscriber_that_asks_for_no_earlier_ones(make_node: MakeNode) -> None:
    (message,) = received(make_node(), GRID, DEFAULT, limit_s=PATIENCE_S)
    assert isinstance(message, OccupancyGrid)


def test_parameters_override_the_qos_of_a_live_sensor_topic(make_node: MakeNode) -> None:
    node = make_node(**{"live": True, RELIABILITY: "reliable", RELIABILITY.replace("reliability", "depth"): 2})
    qos = offered(node, POINTS)
    assert (qos.reliability, qos.depth, qos.history) == (ReliabilityPolicy.RELIABLE, 2, HistoryPolicy.KEEP_LAST)
    assert node.get_parameter(RELIABILITY).value == "reliable" and node.describe_parameter(RELIABILITY).read_only


def test_only_overridden_policies_are_parameters(make_node: MakeNode) -> None:
    node = make_node(**{"live": True, RELIABILITY: "reliable"})
    for topic in (POINTS, ACTORS, Topic("/ego/other/points", POINTS.type, sensor=True)):
        node.advertise(topic)
    assert [name for name in node._parameters if name.startswith("qos_overrides")] == [RELIABILITY]


def test_below_a_namespace_an_override_names_the_topic_as_it_is_in_ros(make_node: MakeNode) -> None:
    name = RELIABILITY.replace("/ego", "/sim1/ego")
    node = make_node("/sim1", **{"live": True, name: "reliable"})
    node.advertise(POINTS)
    (publisher,) = [each for each in node.publishers if each.topic_name == f"/sim1{POINTS.name}"]
    assert publisher.qos_profile.reliability == ReliabilityPolicy.RELIABLE


@pytest.mark.parametrize(("live", "topic"), [(False, POINTS), (True, ACTORS)])
def test_what_lockstep_and_the_graph_itself_rely_on_is_not_overridden(
    make_node: MakeNode, live: bool, topic: Topic
) -> None:
    name = f"qos_overrides.{topic.name}.publisher.reliability"
    assert offered(make_node(**{"live": live, name: "best_effort"}), topic).reliability == ReliabilityPolicy.RELIABLE


@pytest.mark.parametrize(
    ("policy", "value", "problem"),
    [
        ("reliability", "certain", "'certain'; allowed: reliable, best_effort"),
        ("history", "keep_all", "'keep_all'; allowed: keep_last"),
        ("depth", 0, "0; allowed: a number from 1 on"),
        ("depth", "deep", "'deep'; allowed: a number from 1 on"),
        ("depth", True, "True; allowed: a number from 1 on"),
        ("size", 3, "there is no such policy; allowed: depth, history, reliability"),
    ],
)
def test_an_override_that_cannot_be_is_refused_with_parameter_and_value(
    make_node: MakeNode, policy: str, value: object, problem: str
) -> None:
    name = RELIABILITY.replace("reliability", policy)
    node = make_node(**{"live": True, name: value})
    with pytest.raises(InputError) as refused:
        node.advertise(POINTS)
    assert str(refused.value) == f"parameter {name}: {problem}"
