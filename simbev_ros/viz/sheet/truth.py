"""What is true around the ego at the time of a picture, from the labels that a bag has of about that time."""

from collections import defaultdict, deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from simbev_ros.geometry.transforms import matrices_from_xyz_quaternion, matrices_from_xyz_rpy, rpy_from_rotation
from simbev_ros.recording.arrays import image_array, point_array
from simbev_ros.recording.reader import RawMessage, SceneBag
from simbev_ros.types import AnyArray, Float64Array, Table, UInt16Array

HOLD_NS = 1_000_000_000
"""What is slower than a picture counts with its last sample, but not with one that is older than this."""


@dataclass(frozen=True, slots=True)
class Truth:
    """What is true at the time of one picture.

    Attributes:
        map_from_ego: (4, 4) pose of the ego at that time.
        boxes: (N,) rows of /ego/boxes, map frame; None if there are none of about that time.
        labels: (rows, columns) bird's-eye-view labels; None if there are none of about that time.
        map_from_grid: (4, 4) pose of the labels' grid: level, along the ego's heading when they were made.
    """

    map_from_ego: Float64Array
    boxes: Table | None
    labels: UInt16Array | None
    map_from_grid: Float64Array


@dataclass(frozen=True, slots=True)
class TruthTopics:
    """Where a bag has it; None: nowhere."""

    boxes: str | None = None
    odometry: str | None = None
    labels: str | None = None

    @property
    def names(self) -> list[str]:
        """Those that there are."""
        return [topic for topic in (self.boxes, self.odometry, self.labels) if topic is not None]


@dataclass(slots=True)
class History:
    """The messages of the last seconds: of topics with truth all, of others the last one.

    Attributes:
        bag: Where the messages are from.
        topics: Those with truth.
    """

    bag: SceneBag
    topics: TruthTopics
    _messages: Mapping[str, deque[RawMessage]] = field(init=False)
    _decoded: dict[str, tuple[int, AnyArray]] = field(init=False, default_factory=dict)

    def __post_init__(self) -> None:
        self._messages = defaultdict(deque)

    def add(self, message: RawMessage) -> None:
        """Take in the next message; stamps do not fall."""
        messages = self._messages[message.topic]
        span_ns = 2 * HOLD_NS if message.topic in self.topics.names else 0
        while messages and messages[0].stamp_ns <= message.stamp_ns - span_ns:
            messages.popleft()
        messages.append(message)

    def latest(self, topic: str | None, stamp_ns: int) -> RawMessage | None:
        """The last message of a topic that is neither younger than a stamp nor too old to be shown with it."""
        past = (m for m in reversed(self._messages.get(topic or "", ())) if m.stamp_ns <= stamp_ns)
        message = next(past, None)
        return message if message is not None and message.stamp_ns >= stamp_ns - HOLD_NS else None

    def array(self, message: RawMessage) -> AnyArray:
        """What is in a message; that of odometry is (4, 4) map_from_ego."""
        stamp_ns, array = self._decoded.get(message.topic, (None, None))
        if array is None or stamp_ns != message.stamp_ns:
            array = decoded_array(self.bag, message)
            self._decoded[message.topic] = message.stamp_ns, array
        return array

    def truth(self, stamp_ns: int) -> Truth | None:
        """What is true at a stamp; None where the ego's pose at that very time is not known."""
        map_from_ego = self._pose(stamp_ns)
        if map_from_ego is None:
            return None
        boxes, labels = self.latest(self.topics.boxes, stamp_ns), self.latest(self.topics.labels, stamp_ns)
        map_from_labels = self._pose(labels.stamp_ns) if labels else None
        return Truth(
            map_from_ego,
            None if boxes is None else self.array(boxes),
            None if labels is None or map_from_labels is None else self.array(labels),
            level(map_from_ego if map_from_labels is None else map_from_labels),
        )

    def _pose(self, stamp_ns: int) -> Float64Array | None:
        """(4, 4) map_from_ego."""
        message = self.latest(self.topics.odometry, stamp_ns)
        return self.array(message) if message is not None and message.stamp_ns == stamp_ns else None


def decoded_array(bag: SceneBag, message: RawMessage) -> AnyArray:
    """Of an image its pixels, of a point cloud its rows, of odometry (4, 4) map_from_ego."""
    content = bag.decode(message)
    match message.type_name:
        case "sensor_msgs/msg/PointCloud2":
            return point_array(content)
        case "nav_msgs/msg/Odometry":
            return _pose_matrix(content.pose.pose)
        case _:
            return image_array(content)


def _pose_matrix(pose: Any) -> Float64Array:
    """(4, 4) parent from child of a ``geometry_msgs/msg/Pose``."""
    place, turn = pose.position, pose.orientation
    return matrices_from_xyz_quaternion(
        np.array([place.x, place.y, place.z]), np.array([turn.x, turn.y, turn.z, turn.w])
    )


def level(map_from_ego: Float64Array) -> Float64Array:
    """The ego's pose without its roll and pitch."""
    yaw_rad = rpy_from_rotation(map_from_ego[:3, :3])[2]
    return matrices_from_xyz_rpy(map_from_ego[:3, 3], np.array([0.0, 0.0, yaw_rad]))
