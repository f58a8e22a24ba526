"""Transforms of the rig: /tf_static for the sensors, /tf for the ego.

The scene's specification gives the static ones, the odometry the ego's. They are always recorded, but published live
only if tf2_msgs is installed.
"""

from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np
from geometry_msgs.msg import Transform, TransformStamped
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rosbags.typesys import Stores, get_typestore

from simbev_ros.config.camera import Camera
from simbev_ros.geometry.transforms import SENSOR_FROM_OPTICAL, quaternion_from_rpy, rpy_from_rotation
from simbev_ros.msgs import topics
from simbev_ros.msgs.qos import qos_of, rclpy_qos
from simbev_ros.msgs.stamps import header
from simbev_ros.msgs.world import quaternion_message, vector_message
from simbev_ros.scene.spec import SceneSpec
from simbev_ros.types import Float64Array

try:
    from tf2_msgs.msg import TFMessage
except ImportError:  # not available as a wheel; bags contain the transforms nevertheless
    TFMessage = None

_TYPES = get_typestore(Stores.ROS2_JAZZY)


def static_transforms(spec: SceneSpec) -> Iterator[TransformStamped]:
    """Transforms from ``<agent>/base_link`` to every sensor, and from each camera's body to its optical frame."""
    agent = spec.rig.agent
    for sensor in spec.rig.sensors:
        frame = f"{agent}/{sensor.name}"
        yield _stamped(spec.start_ns, f"{agent}/base_link", frame, sensor.pose.ego_from_sensor)
        if isinstance(sensor, Camera):
            yield _stamped(spec.start_ns, frame, f"{frame}_optical", SENSOR_FROM_OPTICAL)


def ego_transform(odometry: Odometry) -> TransformStamped:
    """Transform from map to ``<agent>/base_link``, from the odometry."""
    position = odometry.pose.pose.position
    transform = TransformStamped(header=odometry.header, child_frame_id=odometry.child_frame_id)
    transform.transform = Transform(
        translation=vector_message(np.array([position.x, position.y, position.z])),
        rotation=odometry.pose.pose.orientation,
    )
    return transform


def serialize_transforms(transforms: Iterable[TransformStamped]) -> bytes:
    """Serialize transforms to a tf2_msgs/TFMessage in CDR, even if tf2_msgs is not installed."""
    message = _TYPES.types["tf2_msgs/msg/TFMessage"]([_as_rosbags(transform) for transform in transforms])
    return bytes(_TYPES.serialize_cdr(message, "tf2_msgs/msg/TFMessage"))


def _as_rosbags(message: Any) -> Any:
    """Convert a message without arrays to the same type in rosbags' store."""
    fields = message.get_fields_and_field_types()
    values = [getattr(message, name) for name in fields]
    package, kind = type(message).__module__.split(".")[0], type(message).__name__
    message_class = _TYPES.types[f"{package}/msg/{kind}"]
    return message_class(*[_as_rosbags(v) if hasattr(v, "get_fields_and_field_types") else v for v in values])


def _stamped(stamp_ns: int, parent: str, child: str, parent_from_child: Float64Array) -> TransformStamped:
    rotation = quaternion_message(quaternion_from_rpy(rpy_from_rotation(parent_from_child[:3, :3])))
    return TransformStamped(
        header=header(stamp_ns, parent),
        child_frame_id=child,
        transform=Transform(translation=vector_message(parent_from_child[:3, 3]), rotation=rotation),
    )


class TransformBroadcaster:
    """Publisher of /tf and /tf_static for live graphs; does nothing if tf2_msgs cannot be imported."""

    def __init__(self, node: Node) -> None:
        self._publishers: dict[str, Any] = {}
        if TFMessage is not None:
            for topic in topics.transform_topics():
                qos = rclpy_qos(qos_of(topic, live=False))
                self._publishers[topic.name] = node.create_publisher(TFMessage, topic.name, qos)

    def start_scene(self, spec: SceneSpec) -> None:
        """Publish the rig's transforms, latched."""
        if self._publishers:
            self._publishers[topics.TF_STATIC].publish(TFMessage(transforms=list(static_transforms(spec))))

    def publish(self, odometry: Odometry) -> None:
        """Publish the ego's transform."""
        if self._publishers:
            self._publishers[topics.TF].publish(TFMessage(transforms=[ego_transform(odometry)]))
