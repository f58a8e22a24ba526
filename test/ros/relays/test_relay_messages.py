"""The relays' messages say what Autoware and Nav2 expect, and their nodes send them."""

import os
import subprocess
import sys
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
import rclpy
from geometry_msgs.msg import TwistWithCovarianceStamped
from made_up_scene import made_up_spec
from nav_msgs.msg import OccupancyGrid, Odometry
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile
from ros_domain import DOMAIN
from scene_edits import with_ego
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import String
from waiting import wait_until

from simbev_ros.foundation.geometry.transforms import matrices_from_xyz_rpy, quaternion_from_rpy
from simbev_ros.ros.msgs.stamps import header
from simbev_ros.ros.msgs.tables import message_from_table, table_from_message
from simbev_ros.ros.relays.autoware import AutowareRelay
from simbev_ros.ros.relays.autoware_messages import velocity_message
from simbev_ros.ros.relays.nav2 import Nav2Relay, drivable_map
from simbev_ros.schema.points import POINT_DTYPE

STAMP_NS = 3_602_050_000_000
SCENE = with_ego(made_up_spec([]), base_link_x_m=-1.4)
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def odometry(yaw_deg: float = 0.0) -> Odometry:
    """The ego at (10, 20) in the map, 8 m/s fast."""
    message = Odometry(header=header(STAMP_NS, "map"), child_frame_id="ego/base_link")
    message.pose.pose.position.x, message.pose.pose.position.y = 10.0, 20.0
    turn = quaternion_from_rpy(np.radians([0.0, 0.0, yaw_deg]))
    orientation = message.pose.pose.orientation
    orientation.x, orientation.y, orientation.z, orientation.w = turn.tolist()
    message.twist.twist.linear.x, message.twist.twist.linear.y = 8.0, 0.3
    message.twist.twist.angular.z = 0.1
    return message


def road(count: int = 60) -> OccupancyGrid:
    """A grid of cells of 1 m around the ego, with a road on its left half."""
    message = OccupancyGrid(header=header(STAMP_NS, "ego/base_link"))
    message.info.resolution, message.info.width, message.info.height = 1.0, count, count
    message.info.origin.position.x = message.info.origin.position.y = -count / 2.0
    message.data = np.repeat([0, 100], count * count // 2).tolist()
    return message


def test_the_velocity_has_autowares_variances_if_the_odometry_has_none() -> None:
    twist = velocity_message(odometry(), "base_link").twist
    assert (twist.twist.linear.x, twist.twist.linear.y, twist.twist.angular.z) == (8.0, 0.0, 0.1)
    variances = twist.covariance.reshape(6, 6).diagonal()
    np.testing.assert_allclose(variances, [0.04, 10_000, 10_000, 10_000, 10_000, 0.01])


def test_the_velocity_has_the_variances_of_a_noisy_odometry() -> None:
    noisy = odometry()
    noisy.twist.covariance[0], noisy.twist.covariance[35] = 0.25, 0.5
    variances = velocity_message(noisy, "base_link").twist.covariance.reshape(6, 6).diagonal()
    assert (variances[0], variances[5]) == (0.25, 0.5)


def test_the_map_is_free_where_the_road_is() -> None:
    map_from_base = matrices_from_xyz_rpy(np.array([10.0, 20.0, 0.0]), np.radians([0.0, 0.0, 90.0]))
    message = drivable_map(road(), map_from_base, "map")
    assert message.header.frame_id == "map" and message.info.origin.orientation.w == 1.0
    cells = np.asarray(message.data).reshape(message.info.height, message.info.width)
    x = message.info.origin.position.x + np.arange(message.info.width) + 0.5
    assert set(cells[:, x < 9.0].ravel()) == {0}  # it drives along y, and the road is on its left
    assert set(cells[:, x > 11.0].ravel()) == {100}


@pytest.fixture
def context() -> Iterator[Context]:
    context = Context()
    rclpy.init(context=context, domain_id=DOMAIN)
    yield context
    context.shutdown()


@pytest.mark.graph
def test_the_nodes_answer_what_they_hear_among_malformed_messages(context: Context) -> None:
    stranger = rclpy.create_node("stranger", context=context)
    nodes = [stranger, AutowareRelay(context=context), Nav2Relay(context=context)]
    received: dict[str, Any] = {}
    for topic, kind, qos in (
        ("/sensing/lidar/top/pointcloud_raw_ex", PointCloud2, 5),
        ("/sensing/vehicle_velocity_converter/twist_with_covariance", TwistWithCovarianceStamped, 5),
        ("/map", OccupancyGrid, LATCHED),
    ):
        stranger.create_subscription(kind, topic, lambda message, topic=topic: received.update({topic: message}), qos)
    cloud = message_from_table(np.ones(3, POINT_DTYPE), STAMP_NS, "ego/lidar")
    inputs = [
        (stranger.create_publisher(Odometry, "/ego/odom", 5), odometry()),
        (stranger.create_publisher(PointCloud2, "/ego/lidar/points", 5), cloud),
        (stranger.create_publisher(OccupancyGrid, "/ego/bev/road/grid", 5), road()),
        (stranger.create_publisher(String, "/world/scene", LATCHED), String(data=SCENE.model_dump_json())),
    ]
    short, other, empty = (message_from_table(np.ones(3, POINT_DTYPE), STAMP_NS, "ego/lidar") for _ in range(3))
    short.data, other.fields, empty.point_step = short.data[:-1], other.fields[:2], 0
    small = road()
    small.data = small.data[:-1]
    malformed = [
        *((inputs[1][0], message) for message in (short, other, empty)),
        *((inputs[2][0], message) for message in (small, OccupancyGrid())),
        *((inputs[3][0], String(data=text)) for text in ("{}", "[" * 10_000)),
    ]
    executor = SingleThreadedExecutor(context=context)
    for node in nodes:
        executor.add_node(node)

    def send_again() -> None:
        for publisher, message in (*malformed, *inputs):
            publisher.publish(message)
        for _ in range(10):
            executor.spin_once(timeout_sec=0.01)

    wait_until(lambda: len(received) == 3, meanwhile=send_again)
    executor.shutdown()
    for node in nodes:
        node.destroy_node()
    assert len(received) == 3
    rows = table_from_message(received["/sensing/lidar/top/pointcloud_raw_ex"])
    assert len(rows) == 3 and received["/map"].header.frame_id == "map"
    info = received["/map"].info
    assert abs(info.origin.position.x + info.width / 2 - 11.4) <= 1.0  # base_link at 10 m is 1.4 m behind the center


@pytest.mark.parametrize("module", ["ros.relays.autoware", "reference_stack.node"])
def test_a_program_starts_in_a_shell_that_chooses_a_middleware_which_is_not_installed(module: str) -> None:
    program = f"import sys; sys.argv[0] = '-m'; import simbev_ros.{module}"
    environment = {**os.environ, "RMW_IMPLEMENTATION": "rmw_none_cpp"}
    done = subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0
    assert done.stderr.startswith("warning: RMW_IMPLEMENTATION=rmw_none_cpp: dropped: ")
