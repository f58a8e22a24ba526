"""The stack as a ROS node: clouds and odometry in, boxes, scores and a report of each finished tick out.

Nothing here is specific to this stack: to try your own, replace ``Pipeline``.
"""

import sys
from collections.abc import Callable, Mapping

import rclpy
import rclpy.utilities
from nav_msgs.msg import Odometry
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription
from sensor_msgs.msg import Image, PointCloud2
from std_msgs.msg import Header, String
from visualization_msgs.msg import MarkerArray

from simbev_ros.foundation.tick_join import TickJoin, all_of
from simbev_ros.reference_stack.arrays import Floats
from simbev_ros.reference_stack.messages import (
    header_of,
    markers_message,
    points_of,
    pose_of,
    scores_message,
    stamp_ns_of,
    table_message,
)
from simbev_ros.reference_stack.pipeline import Answer, Pipeline
from simbev_ros.reference_stack.scene import Scene, UsageError, read_scene

_LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
EVERY = QoSProfile(depth=16)
"""Reliable, with a queue longer than the lockstep window can fill."""
_NEWEST = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
_CLOUD = "cloud"
_PATIENCE_TICKS = 50
"""A tick waits up to this number of ticks for what it lacks; where messages are lost, a later one ends the wait."""
_MALFORMED = (ValueError, LookupError, TypeError, AttributeError, ArithmeticError, RecursionError)
"""Exceptions from reading messages that are not as they must be; any process can send messages."""
_WARNING_PERIOD_S = 10.0
_POLL_S = 0.05
_POLLS_TO_SETTLE = 10
"""This side of a connection is established a moment before the other side is."""


class ReferenceStack(Node):
    """Answers lidar clouds: every cloud in lockstep, the newest one live.

    Topics, relative to the node's namespace, which can be remapped as usual: ego/lidar/points, ego/odom, world/scene
    in; prediction/boxes, prediction/boxes/markers (only with subscribers), prediction/bev and sync/ready out.

    Parameters:
        lidar_topic: Another lidar, by its topic in the scene, which may itself be remapped. In a scene with several
            agents, the odometry must be remapped to that of the agent that carries it.
        live: Whether the graph is, so that the newest cloud counts. Left out, best-effort clouds say so; a live graph
            with ``--reliable`` does not differ from lockstep in this.

    Attributes:
        inputs: Further subscriptions that must be connected before a scene starts.
    """

    def __init__(self, name: str = "reference_stack") -> None:
        super().__init__(name)
        lidar_topic = self.declare_parameter("lidar_topic", "").value
        self._live = bool(self.declare_parameter("live", False).value)
        self._points_topic = self.resolve_topic_name(lidar_topic.removeprefix("/") or "ego/lidar/points")
        self._lidar_topic = lidar_topic or self._points_topic.removeprefix(self.get_namespace().rstrip("/"))
        self._scene: Scene | None = None
        self._pipeline: Pipeline | None = None
        self._join: TickJoin[Odometry, PointCloud2] | None = None
        self._points: Subscription | None = None
        self._polls_connected = 0
        self.inputs = [self.create_subscription(Odometry, "ego/odom", self._on_odometry, EVERY)]
        self._boxes = self.create_publisher(PointCloud2, "prediction/boxes", EVERY)
        self._markers = self.create_publisher(MarkerArray, "prediction/boxes/markers", EVERY)
        self._grid = self.create_publisher(Image, "prediction/bev", EVERY)
        self._ready = self.create_publisher(Header, "sync/ready", _LATCHED)
        self.create_subscription(String, "world/scene", self._on_scene, _LATCHED)
        self.create_timer(_POLL_S, self._connect, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _on_scene(self, message: String) -> None:
        """Start a new scene; its first tick waits until this node reports that it is ready."""
        try:
            scene = self.start_scene(message.data)
        except _MALFORMED as error:
            self.get_logger().warning(f"ignored a malformed message on world/scene: {error!r:.200}")
            return
        if self._points is not None:  # the next graph may be live although this one is not, or vice versa
            self.destroy_subscription(self._points)
        self._points, self._polls_connected = None, 0
        self._scene, self._pipeline = scene, Pipeline(scene.ego_from_lidar, scene.grid)
        patience_ns = _PATIENCE_TICKS * scene.tick_ns
        self._join = TickJoin(all_of(self.due, patience_ticks=patience_ns, in_order=True))

    def start_scene(self, text: str) -> Scene:
        """Read the specification of a new scene, JSON; override it if more is needed of it."""
        return read_scene(text, self._lidar_topic)

    def _connect(self) -> None:
        """Subscribe to the clouds, every one or the newest; when connected, report the lead-in as finished."""
        if self._scene is None or self._polls_connected >= _POLLS_TO_SETTLE:
            return
        if self._points is None:
            for publisher in self.get_publishers_info_by_topic(self._points_topic)[:1]:
                is_live = self._live or publisher.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT
                qos = _NEWEST if is_live else EVERY
                self._points = self.create_subscription(PointCloud2, self._points_topic, self._on_cloud, qos)
        elif all(each.get_publisher_count() for each in (self._points, *self.inputs)):
            self._polls_connected += 1
            if self._polls_connected == _POLLS_TO_SETTLE:
                self._report(self._scene, self._scene.start_ns - self._scene.tick_ns)

    def _on_cloud(self, message: PointCloud2) -> None:
        self.add_input(_CLOUD, message)

    def add_input(self, name: str, message: PointCloud2) -> None:
        """Receive a message of an input; answer what it completes."""
        if self._join is not None:
            self._join.add(name, stamp_ns_of(message.header), message)
            self._finish_ticks()

    def _on_odometry(self, message: Odometry) -> None:
        if self._join is not None:
            self._join.open(stamp_ns_of(message.header), message)
            self._finish_ticks()

    def _finish_ticks(self) -> None:
        """Answer and report each tick that is complete."""
        if self._scene is None or self._pipeline is None or self._join is None:
            return
        for stamp_ns, odometry, messages in self._join.release():
            if _CLOUD in messages:
                self._answer(self._scene, self._pipeline, messages, odometry, stamp_ns)
            self._report(self._scene, stamp_ns)

    def due(self, stamp_ns: int) -> tuple[str, ...]:
        """The inputs that a tick waits for, besides its odometry; override it if there are more."""
        return (_CLOUD,) if self._scene is not None and self._scene.has_cloud(stamp_ns) else ()

    def _answer(
        self,
        scene: Scene,
        pipeline: Pipeline,
        messages: Mapping[str, PointCloud2],
        odometry: Odometry,
        stamp_ns: int,
    ) -> None:
        map_from_ego = pose_of(odometry) @ scene.base_link_from_ego
        try:
            answer = pipeline.step(*points_of(messages[_CLOUD]), map_from_ego, stamp_ns * 1e-9)
            answer = self.complete(answer, messages, map_from_ego)
        except _MALFORMED as error:
            self.get_logger().warning(
                f"a frame is not answered: {error!r:.200}", throttle_duration_sec=_WARNING_PERIOD_S
            )
            return
        in_map = header_of(stamp_ns, odometry.header.frame_id)
        self._boxes.publish(table_message(answer.boxes, in_map))
        if self._markers.get_subscription_count():
            self._markers.publish(markers_message(answer.boxes, in_map))
        self._grid.publish(scores_message(answer.scores, header_of(stamp_ns, scene.ego_frame)))

    def complete(self, answer: Answer, messages: Mapping[str, PointCloud2], map_from_ego: Floats) -> Answer:
        """Complete an answer by other inputs than the cloud; override it if there are any.

        Args:
            answer: The answer to the cloud.
            messages: What has arrived of the tick, by input.
            map_from_ego: (4, 4) pose of the ego at the tick.
        """
        return answer

    def _report(self, scene: Scene, stamp_ns: int) -> None:
        """Report a tick as finished; in lockstep, the world waits for it if ``graph.participants`` lists this node."""
        self._ready.publish(header_of(stamp_ns, f"{self.get_name()}:{scene.name}"))


def run_until_signal(make_node: Callable[[], ReferenceStack]) -> None:
    """Run a stack until SIGINT or SIGTERM.

    Args:
        make_node: Makes the node once ROS runs.
    """
    rclpy.init()
    node: ReferenceStack | None = None
    try:
        node = make_node()
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    except UsageError as error:
        sys.exit(f"error: {error}")
    finally:
        if node is not None:
            node.destroy_node()
        rclpy.utilities.try_shutdown()
