"""The stack as a ROS node: clouds, images and odometry in, boxes, scores and a report of each finished tick out."""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from nav_msgs.msg import Odometry
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription
from sensor_msgs.msg import CompressedImage, Image, PointCloud2
from std_msgs.msg import Header, String
from visualization_msgs.msg import MarkerArray

from simbev_ros.baselines.inference import Baseline
from simbev_ros.baselines.node.answering import Answering, Frame, ReadImage
from simbev_ros.baselines.node.image_fit import ImageFit
from simbev_ros.baselines.node.newest import NewestOnly
from simbev_ros.baselines.node.scene_inputs import SceneInputs, inputs_of_scene
from simbev_ros.baselines.node.sweeps import Sweep, SweepMemory, points_in_ego
from simbev_ros.config.included_stacks import baseline_stack
from simbev_ros.foundation.errors import FOREIGN_ERRORS
from simbev_ros.foundation.tick_join import TickJoin, all_of
from simbev_ros.foundation.types import UInt8Array
from simbev_ros.reference_stack.messages import markers_message, scores_message, table_message
from simbev_ros.ros.msgs.stamps import header, stamp_of
from simbev_ros.ros.msgs.tables import table_from_message
from simbev_ros.ros.msgs.world import map_from_base_link

_LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
_EVERY = QoSProfile(depth=16)
"""Reliable, with a queue longer than the lockstep window can fill."""
_LIVE = QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)
_PATIENCE_TICKS = 50
"""A tick waits up to this number of ticks for what it lacks; where messages are lost, a later one ends the wait."""
_POLL_S = 0.05
_POLLS_TO_SETTLE = 10
"""This side of a connection is established a moment before the other side is."""


class _Offer(NamedTuple):
    """A topic on which an input may be."""

    topic: str
    kind: type


class _Task(NamedTuple):
    """A frame, and the scene that it belongs to."""

    inputs: SceneInputs
    answering: Answering
    frame: Frame
    map_frame: str


class BaselineNode(Node):
    """Answers frames with a trained baseline: every frame in lockstep, the newest one live.

    A frame is a tick at which all sensors that the model sees are due. Topics are relative to the node's namespace and
    can be remapped as usual: those of the rig's sensors and of odometry, and world/scene in; prediction/boxes,
    prediction/boxes/markers (only with subscribers), prediction/bev and sync/ready out.

    Parameters:
        agent: The agent with the model's sensors; left out: the scene's first one.
        lidar_topic: The lidar that the model sees, by its topic in the scene; left out: the rig's first one.
        live: Whether the graph is, so that the newest frame counts. Left out, best-effort sensors say so.

    Args:
        baseline: The model.
        tracks: Whether to track the boxes.
    """

    def __init__(self, baseline: Baseline, *, tracks: bool = False) -> None:
        super().__init__(baseline_stack(baseline.modality).participant)
        self._baseline, self._tracks = baseline, tracks
        self._agent = str(self.declare_parameter("agent", "").value)
        self._lidar_topic = str(self.declare_parameter("lidar_topic", "").value)
        self._live_parameter = bool(self.declare_parameter("live", False).value)
        self._is_live = self._live_parameter
        self._inputs: SceneInputs | None = None
        self._answering: Answering | None = None
        self._sweeps = SweepMemory(baseline.sweep_ages_ns)
        self._join: TickJoin[Odometry, Any] | None = None
        self._newest: NewestOnly[_Task] | None = None
        self._offers: dict[str, tuple[_Offer, ...]] = {}
        self._connected: dict[str, Subscription] = {}
        self._polls = self._polls_connected = 0
        self._boxes = self.create_publisher(PointCloud2, "prediction/boxes", _EVERY)
        self._markers = self.create_publisher(MarkerArray, "prediction/boxes/markers", _EVERY)
        self._grid = self.create_publisher(Image, "prediction/bev", _EVERY)
        self._ready = self.create_publisher(Header, "sync/ready", _LATCHED)
        self.create_subscription(String, "world/scene", self._on_scene, _LATCHED)
        self.create_timer(_POLL_S, self._connect, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def close(self) -> None:
        """End the thread that answers live frames."""
        if self._newest is not None:
            self._newest.close()
            self._newest = None

    def _on_scene(self, message: String) -> None:
        """Start a new scene; its first tick waits until this node reports that it is ready."""
        baseline = self._baseline
        size_px, seen = baseline.camera_size_px or (0, 0), (baseline.modality, self._lidar_topic, baseline.cameras)
        try:
            inputs = inputs_of_scene(message.data, *seen, size_px, self._agent)
        except FOREIGN_ERRORS as error:
            self.get_logger().warning(f"ignored a malformed message on world/scene: {error!r:.200}")
            return
        self._sweeps = SweepMemory(baseline.sweep_ages_ns)
        for each in self._connected.values():  # the next graph may be live although this one is not, or vice versa
            self.destroy_subscription(each)
        self._connected, self._polls, self._polls_connected = {}, 0, 0
        self._is_live = self._live_parameter
        if inputs.unseen_cameras:
            names = ", ".join(inputs.unseen_cameras)
            self.get_logger().info(f"the model takes {baseline.cameras} cameras; it does not see {names}")
        self._offers = {inputs.odometry_topic: (_Offer(inputs.odometry_topic, Odometry),)}
        if inputs.lidar is not None:
            self._offers[inputs.lidar.topic] = (_Offer(inputs.lidar.topic, PointCloud2),)
        for camera in inputs.cameras.values():
            forms = (_Offer(camera.compressed_topic, CompressedImage), _Offer(camera.raw_topic, Image))
            self._offers[camera.compressed_topic] = forms
        self._inputs, self._answering = inputs, Answering(baseline, inputs, tracks=self._tracks)
        self._join = TickJoin(all_of(inputs.due, patience_ticks=_PATIENCE_TICKS * inputs.tick_ns, in_order=True))

    def _connect(self) -> None:
        """Subscribe to the inputs, every message or the newest ones; when connected, report the lead-in as finished."""
        if self._inputs is None or self._polls_connected >= _POLLS_TO_SETTLE:
            return
        self._polls += 1
        for name, offers in self._offers.items():
            if name not in self._connected:
                self._subscribe(name, offers)
        waiting = [each for each in self._connected.values() if not each.get_publisher_count()]
        if not waiting and len(self._connected) == len(self._offers):
            self._polls_connected += 1
            if self._polls_connected == _POLLS_TO_SETTLE:
                self._report(self._inputs, self._inputs.start_ns - self._inputs.tick_ns)

    def _subscribe(self, name: str, offers: tuple[_Offer, ...]) -> None:
        """Subscribe to the first topic that something publishes; to a later one if nothing has come for a while."""
        for offer in offers[: 1 if self._polls < _POLLS_TO_SETTLE else None]:
            topic = offer.topic.removeprefix("/")
            for publisher in self.get_publishers_info_by_topic(topic)[:1]:
                self._is_live |= publisher.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT
                is_odometry = offer.kind is Odometry
                receive = self._on_odometry if is_odometry else partial(self._on_input, name)
                qos = _LIVE if self._is_live and not is_odometry else _EVERY
                self._connected[name] = self.create_subscription(offer.kind, topic, receive, qos)
                return

    def _on_input(self, name: str, message: Any) -> None:
        if self._join is not None:
            self._join.add(name, stamp_of(message.header.stamp), message)
            self._finish_ticks()

    def _on_odometry(self, message: Odometry) -> None:
        if self._join is not None:
            self._join.open(stamp_of(message.header.stamp), message)
            self._finish_ticks()

    def _finish_ticks(self) -> None:
        """Answer and report each tick that is complete."""
        inputs, answering = self._inputs, self._answering
        if inputs is None or answering is None or self._join is None:
            return
        for stamp_ns, odometry, messages in self._join.release():
            try:
                frame = self._frame(inputs, stamp_ns, odometry, messages)
            except FOREIGN_ERRORS as error:
                self.get_logger().warning(f"a frame is not answered: {error!r:.200}")
                frame = None
            task = None if frame is None else _Task(inputs, answering, frame, odometry.header.frame_id)
            if not self._is_live:
                if task is not None:
                    self._answer(task)
                self._report(inputs, stamp_ns)
            elif task is not None:
                if self._newest is None:
                    self._newest = NewestOnly(self._answer_and_report)
                self._newest.put(task)

    def _frame(self, inputs: SceneInputs, stamp_ns: int, odometry: Odometry, messages: dict[str, Any]) -> Frame | None:
        """Remember the cloud of a tick; return its frame, or None if it has none or lacks an input."""
        map_from_ego = map_from_base_link(odometry) @ inputs.base_link_from_ego
        lidar = inputs.lidar
        if lidar is not None and lidar.topic in messages:
            points_ego = points_in_ego(table_from_message(messages[lidar.topic]), lidar.ego_from_lidar)
            self._sweeps.add(Sweep(stamp_ns, points_ego, map_from_ego))
        if not inputs.is_frame(stamp_ns) or any(name not in messages for name in inputs.due(stamp_ns)):
            return None
        sweeps = [] if lidar is None else self._sweeps.of_frame(stamp_ns)
        images = {name: _reader(messages[camera.compressed_topic]) for name, camera in inputs.cameras.items()}
        return Frame(stamp_ns, map_from_ego, sweeps, images)

    def _answer_and_report(self, task: _Task) -> None:
        self._answer(task)
        self._report(task.inputs, task.frame.stamp_ns)

    def _answer(self, task: _Task) -> None:
        stamp_ns = task.frame.stamp_ns
        try:
            answer = task.answering.answer(task.frame)
        except ValueError as error:
            self.get_logger().warning(f"a frame is not answered: {error}")
            return
        in_map = header(stamp_ns, task.map_frame)
        self._boxes.publish(table_message(answer.boxes, in_map))
        if self._markers.get_subscription_count():
            self._markers.publish(markers_message(answer.boxes, in_map))
        self._grid.publish(scores_message(answer.scores, header(stamp_ns, task.inputs.ego_frame)))

    def _report(self, inputs: SceneInputs, stamp_ns: int) -> None:
        """Report a tick as finished; in lockstep, the world waits for it."""
        self._ready.publish(header(stamp_ns, f"{self.get_name()}:{inputs.name}"))


def _reader(message: CompressedImage | Image) -> ReadImage:
    """How to read the image of a message in a model's size."""
    read: Callable[[Any, ImageFit], UInt8Array] = _read_jpeg if isinstance(message, CompressedImage) else _read_raw
    return partial(read, message)


def _read_jpeg(message: CompressedImage, fit: ImageFit) -> UInt8Array:
    return fit.decode(bytes(message.data))


def _read_raw(message: Image, fit: ImageFit) -> UInt8Array:
    if message.encoding not in ("rgb8", "bgr8"):
        raise ValueError(f"an image is {message.encoding!r:.40}; it must be rgb8 or bgr8")
    rows = np.frombuffer(message.data, np.uint8).reshape(message.height, -1)
    image = rows[:, : 3 * message.width].reshape(message.height, message.width, 3)
    return fit.fit(image if message.encoding == "rgb8" else np.ascontiguousarray(image[..., ::-1]))
