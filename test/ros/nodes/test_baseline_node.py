"""The node of a baseline subscribes to what is published, and answers and reports each tick; a fake model stands in."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
import rclpy
import simplejpeg
from made_up_scene import made_up_spec
from nav_msgs.msg import Odometry
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from ros_domain import DOMAIN
from sensor_msgs.msg import CompressedImage, Image, PointCloud2
from std_msgs.msg import Header, String
from waiting import wait_until

from simbev_ros.baselines.boxes import BOX_DTYPE as MODEL_BOX_DTYPE
from simbev_ros.baselines.grid import CELLS
from simbev_ros.baselines.inference import Answer
from simbev_ros.baselines.modality import Modality
from simbev_ros.baselines.node.node import BaselineNode
from simbev_ros.ros.msgs.images import compressed_image_message, image_message
from simbev_ros.ros.msgs.stamps import header, stamp_of
from simbev_ros.ros.msgs.tables import message_from_table, table_from_message
from simbev_ros.schema.points import POINT_DTYPE

SENSORS: list[dict[str, Any]] = [
    {"type": "camera", "name": "front", "pose": {"z_m": 1.6}, "width_px": 64, "height_px": 32, "rate_hz": 10},
    {"type": "lidar", "name": "lidar", "pose": {"z_m": 1.8}},
]
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
RELIABLE, BEST_EFFORT = QoSProfile(depth=16), QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)
COMPRESSED, RAW, POINTS = "/ego/front/rgb/image_raw/compressed", "/ego/front/rgb/image_raw", "/ego/lidar/points"


class FakeBaseline:
    """Answers with one box whose length is the number of points, and whose width is the brightness of the image."""

    modality, cameras, camera_size_px = Modality.FUSED, 1, (64, 32)
    sweep_ages_ns = (0, 250_000_000, 500_000_000)

    def answer(self, points: Any, images: Any, pixel_from_level: Any) -> Answer:
        boxes = np.zeros(1, MODEL_BOX_DTYPE)
        boxes["length"], boxes["width"], boxes["score"] = len(points), images.mean(), 0.5
        return Answer(np.full((CELLS, CELLS, 14), 7, np.uint8), boxes)


class Graph:
    """What a graph publishes and what the stack answers; ``stack`` is the node under test.

    Args:
        arguments: Arguments for ROS.
        sensor_qos: QoS of the sensors.
        image_topics: Which of the camera's topics are published.
    """

    def __init__(self, arguments: list[str], sensor_qos: QoSProfile, image_topics: tuple[str, ...]) -> None:
        rclpy.init(args=["--ros-args", *arguments], domain_id=DOMAIN)
        self.spec = made_up_spec(SENSORS, number=3, ticks=10)
        self.node, self.stack = Node("graph"), BaselineNode(FakeBaseline())  # type: ignore[arg-type]
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)
        self.executor.add_node(self.stack)
        self.publishers: dict[str, Publisher] = {
            "/ego/odom": self.node.create_publisher(Odometry, "/ego/odom", RELIABLE),
            POINTS: self.node.create_publisher(PointCloud2, POINTS, sensor_qos),
        }
        for topic, kind in ((RAW, Image), (COMPRESSED, CompressedImage)):
            if topic in image_topics:
                self.publishers[topic] = self.node.create_publisher(kind, topic, sensor_qos)
        self.boxes: list[PointCloud2] = []
        self.grids: list[Image] = []
        self.reports: list[Header] = []
        self.node.create_subscription(PointCloud2, "/prediction/boxes", self.boxes.append, RELIABLE)
        self.node.create_subscription(Image, "/prediction/bev", self.grids.append, RELIABLE)
        self.node.create_subscription(Header, "/sync/ready", self.reports.append, RELIABLE)
        self.scenes = self.node.create_publisher(String, "/world/scene", LATCHED)

    def start_scene(self) -> None:
        self.reports.clear()
        self.scenes.publish(String(data=self.spec.model_dump_json()))
        self.spin_until(lambda: bool(self.reports))

    def send(self, tick: int, *, points: int | None = None, brightness: int | None = None) -> None:
        """Publish the messages of a tick: its odometry, and a cloud and an image if they are given."""
        stamp_ns = self.spec.stamp_ns(tick)
        odometry = Odometry(header=header(stamp_ns, "map"))
        odometry.pose.pose.orientation.w = 1.0
        self.publishers["/ego/odom"].publish(odometry)
        if points is not None:
            self.publishers[POINTS].publish(message_from_table(np.zeros(points, POINT_DTYPE), stamp_ns, "ego/lidar"))
        if brightness is not None:
            image = np.full((32, 64, 3), brightness, np.uint8)
            if COMPRESSED in self.publishers:
                message = compressed_image_message(
                    simplejpeg.encode_jpeg(image), "rgb8; jpeg compressed bgr8", stamp_ns, "c"
                )
                self.publishers[COMPRESSED].publish(message)
            else:
                self.publishers[RAW].publish(image_message(image, stamp_ns, "c"))

    def spin_until(self, condition: Callable[[], bool]) -> None:
        wait_until(condition, meanwhile=lambda: self.executor.spin_once(timeout_sec=0.05))

    def reported_ticks(self) -> list[int]:
        return [self.spec.tick_of(stamp_of(report.stamp)) for report in self.reports]

    def reliability_of(self, topic: str) -> ReliabilityPolicy:
        [found] = self.node.get_subscriptions_info_by_topic(topic)
        return found.qos_profile.reliability


@pytest.fixture
def graph() -> Iterator[Callable[..., Graph]]:
    """Function that starts a graph with the stack; at its end both are gone."""
    graphs: list[Graph] = []

    def start(
        *arguments: str, sensor_qos: QoSProfile = RELIABLE, image_topics: tuple[str, ...] = (RAW, COMPRESSED)
    ) -> Graph:
        graphs.append(Graph(list(arguments), sensor_qos, image_topics))
        return graphs[-1]

    yield start
    for each in graphs:
        each.stack.close()
        each.executor.shutdown()
        each.stack.destroy_node()
        each.node.destroy_node()
    rclpy.shutdown()


def test_frames_with_all_inputs_are_answered_and_every_tick_is_reported(graph: Callable[..., Graph]) -> None:
    running = graph()
    running.start_scene()
    assert running.reported_ticks() == [-1]
    assert running.reports[0].frame_id == f"baseline_fused:{running.spec.name}"
    running.send(0, points=3, brightness=200)
    running.send(1, points=4)
    running.send(2, points=5, brightness=100)
    running.spin_until(lambda: len(running.reports) == 4)
    assert running.reported_ticks() == [-1, 0, 1, 2]
    running.spin_until(lambda: len(running.boxes) == len(running.grids) == 2)
    tables = [table_from_message(message) for message in running.boxes]
    assert [float(table["length"][0]) for table in tables] == [3.0, 5.0]
    assert [float(table["width"][0]) for table in tables] == pytest.approx([200.0, 100.0], abs=2.0)
    assert [running.spec.tick_of(stamp_of(each.header.stamp)) for each in running.boxes] == [0, 2]
    assert {each.header.frame_id for each in running.boxes} == {"map"}
    bev, grid = running.spec.agents[0].annotation.bev, running.grids[-1]
    assert bev is not None
    assert (grid.height, grid.width, grid.encoding) == (bev.rows, bev.columns, "8UC14")
    assert (grid.header.frame_id, set(grid.data)) == ("ego/base_link", {7})


def test_a_malformed_cloud_is_not_answered_and_its_tick_is_reported(graph: Callable[..., Graph]) -> None:
    running = graph()
    running.start_scene()
    cloud = message_from_table(np.zeros(3, POINT_DTYPE), running.spec.stamp_ns(0), "ego/lidar")
    cloud.data = cloud.data[:-1]
    running.publishers[POINTS].publish(cloud)
    running.send(0, brightness=200)
    running.send(1, points=4)
    running.send(2, points=5, brightness=100)
    running.spin_until(lambda: running.reported_ticks() == [-1, 0, 1, 2] and bool(running.boxes))
    assert [running.spec.tick_of(stamp_of(each.header.stamp)) for each in running.boxes] == [2]


def test_a_scene_that_starts_again_is_answered_again(graph: Callable[..., Graph]) -> None:
    running = graph()
    for count in (1, 2):
        running.start_scene()
        running.send(0, points=2, brightness=50)
        running.spin_until(lambda: running.reported_ticks() == [-1, 0])
        running.spin_until(lambda count=count: len(running.boxes) == count)  # type: ignore[misc]
    assert {int(table_from_message(message)["length"][0]) for message in running.boxes} == {2}


def test_compressed_images_are_preferred(graph: Callable[..., Graph]) -> None:
    running = graph()
    running.start_scene()
    assert running.reliability_of(COMPRESSED) == running.reliability_of(POINTS) == ReliabilityPolicy.RELIABLE
    assert not running.node.get_subscriptions_info_by_topic(RAW)


def test_raw_images_are_read_if_there_are_no_compressed_ones(graph: Callable[..., Graph]) -> None:
    running = graph(image_topics=(RAW,))
    running.start_scene()
    running.send(0, points=3, brightness=90)
    running.spin_until(lambda: bool(running.boxes))
    assert float(table_from_message(running.boxes[0])["width"][0]) == pytest.approx(90.0)


def test_a_graph_with_best_effort_sensors_is_live(graph: Callable[..., Graph]) -> None:
    running = graph(sensor_qos=BEST_EFFORT)
    running.start_scene()
    assert running.reliability_of(POINTS) == running.reliability_of(COMPRESSED) == ReliabilityPolicy.BEST_EFFORT
    running.send(0, points=3, brightness=90)
    running.spin_until(lambda: bool(running.boxes) and len(running.reports) == 2)
    assert running.reported_ticks() == [-1, 0]


def test_a_live_graph_may_have_reliable_sensors(graph: Callable[..., Graph]) -> None:
    running = graph("-p", "live:=true")
    running.start_scene()
    assert running.reliability_of(POINTS) == running.reliability_of(COMPRESSED) == ReliabilityPolicy.BEST_EFFORT


def test_a_damaged_image_costs_its_frame_and_no_more(graph: Callable[..., Graph]) -> None:
    running = graph()
    running.start_scene()
    running.send(0, points=3)
    damaged = compressed_image_message(b"no JPEG", "jpeg", running.spec.stamp_ns(0), "c")
    running.publishers[COMPRESSED].publish(damaged)
    running.send(1, points=3)
    running.send(2, points=3, brightness=90)
    running.spin_until(lambda: len(running.reports) == 4 and bool(running.boxes))
    assert running.reported_ticks() == [-1, 0, 1, 2]
    assert [running.spec.tick_of(stamp_of(each.header.stamp)) for each in running.boxes] == [2]
