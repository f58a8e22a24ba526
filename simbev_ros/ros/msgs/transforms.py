"""Transforms of all agents: /tf_static for the sensors on their rigs, /tf for their motion.

The scene's specification gives the static ones, an agent's odometry those of its motion: map to base_link, or with
``frames.odom`` map to odom to base_link. They are always recorded, but published live only if tf2_msgs is installed.
World node, recorder and Foxglove relay make them with ``SceneTransforms``.
"""

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np
from geometry_msgs.msg import Transform, TransformStamped
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.serialization import deserialize_message
from rosbags.typesys import Stores, get_typestore
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Header

from simbev_ros.foundation.geometry.geodesy import earth_from_map
from simbev_ros.foundation.geometry.transforms import inverse, quaternion_from_rpy, rpy_from_rotation
from simbev_ros.foundation.types import Float64Array
from simbev_ros.ros.msgs import topics
from simbev_ros.ros.msgs.odometry import odom_from_base_link
from simbev_ros.ros.msgs.qos import qos_of, rclpy_qos
from simbev_ros.ros.msgs.stamps import header, stamp_of
from simbev_ros.ros.msgs.tables import table_from_message
from simbev_ros.ros.msgs.world import (
    EARTH_FRAME,
    MAP_FRAME,
    QuaternionSigns,
    agent_odometry,
    map_from_base_link,
    quaternion_message,
    vector_message,
)
from simbev_ros.scene.frames import ego_from_base_link, fixed_frames, odom_frame, odometry_of_frames, rear_axle_m
from simbev_ros.schema.scene.agents import AgentView, agent_views
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.simulation.sensors.odometry import DeadReckoning

try:
    from tf2_msgs.msg import TFMessage
except ImportError:  # not available as a wheel; bags contain the transforms nevertheless
    TFMessage = None

_TYPES = get_typestore(Stores.ROS2_JAZZY)


def static_transforms(spec: SceneSpec) -> Iterator[TransformStamped]:
    """Transforms from ``<agent>/base_link`` to every sensor, and from each camera's body to its optical frame.

    The first one is from ``earth`` (REP-105: earth-centered, earth-fixed) to ``map``; it is exact at the map's origin.
    If base_link is at the rear axle, the agent's first one leads to ``<agent>/footprint``, the frame of grids.
    """
    if spec.datum is not None:
        datum = spec.datum
        place = datum.latitude_deg, datum.longitude_deg, datum.altitude_m
        yield _stamped(header(spec.start_ns, EARTH_FRAME), MAP_FRAME, earth_from_map(*place, datum.map_from_east_rad))
    for view in agent_views(spec):
        for frame in fixed_frames(view):
            yield _stamped(header(spec.start_ns, frame.parent), frame.name, frame.parent_from_frame)


def ego_transform(odometry: Odometry) -> TransformStamped:
    """Transform from map to ``<agent>/base_link``, from the true odometry."""
    position = odometry.pose.pose.position
    transform = TransformStamped(header=odometry.header, child_frame_id=odometry.child_frame_id)
    transform.transform = Transform(
        translation=vector_message(np.array([position.x, position.y, position.z])),
        rotation=odometry.pose.pose.orientation,
    )
    return transform


class SceneTransforms:
    """Transforms of /tf of one scene: those of all agents, in their order.

    They follow from the odometries and the specification alone, so that a recorder, which may lack tf2_msgs, makes the
    ones that the graph publishes.
    """

    def __init__(self, spec: SceneSpec) -> None:
        self._spec, self._signs = spec, QuaternionSigns()
        self._agents = [EgoTransforms(view) for view in agent_views(spec)]

    def at(self, odometries: Sequence[Odometry]) -> list[TransformStamped]:
        """Transforms of a tick, from the true odometry of each agent. Ticks come in order."""
        pairs = zip(self._agents, odometries, strict=True)
        transforms = [transform for agent, odometry in pairs for transform in agent.at(odometry)]
        for each in transforms:
            tick = self._spec.tick_of(stamp_of(each.header.stamp))
            self._signs.keep(each.child_frame_id, tick, each.transform.rotation)
        return transforms

    def of_actors(self, payload: bytes, stamp_ns: int) -> list[TransformStamped]:
        """The same from a serialized message of /world/actors, which has the motion of all agents at once.

        Raises:
            ValueError: The message is malformed, or the vehicle of an agent is not in it.
        """
        actors = table_from_message(deserialize_message(payload, PointCloud2))
        return self.at([agent_odometry(agent.view, actors, stamp_ns) for agent in self._agents])


class EgoTransforms:
    """Transforms of /tf of one agent in one scene, from its true odometry of each tick in order.

    Attributes:
        view: The scene as the agent sees it.
    """

    def __init__(self, view: AgentView) -> None:
        self.view = view
        self._reckoning: DeadReckoning | None = None
        if view.frames.odom:
            self._reckoning = DeadReckoning(
                odometry_of_frames(view), view.noise_seed, view.scene.tick_ns, rear_axle_m(view), view.base_link_x_m
            )

    def at(self, odometry: Odometry) -> list[TransformStamped]:
        """Transforms of a tick: map to base_link, or by way of the odom frame those of them that are published.

        Up to tick 0, base_link rests in the odom frame, which begins there.
        """
        if self._reckoning is None:
            return [ego_transform(odometry)]
        view, map_from_base = self.view, map_from_base_link(odometry)
        tick = view.scene.tick_of(stamp_of(odometry.header.stamp))
        self._reckoning.advance_to(tick, map_from_base @ inverse(ego_from_base_link(view)))
        odom_from_base = odom_from_base_link(self._reckoning.pose)
        map_from_odom, odom = map_from_base @ inverse(odom_from_base), odom_frame(view.agent)
        in_odom = Header(stamp=odometry.header.stamp, frame_id=odom)
        made = {
            "map_to_odom": _stamped(odometry.header, odom, map_from_odom),
            "odom_to_base_link": _stamped(in_odom, odometry.child_frame_id, odom_from_base),
        }
        return [transform for name, transform in made.items() if name in view.frames.publish]


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


def _stamped(parent: Header, child: str, parent_from_child: Float64Array) -> TransformStamped:
    rotation = quaternion_message(quaternion_from_rpy(rpy_from_rotation(parent_from_child[:3, :3])))
    return TransformStamped(
        header=parent,
        child_frame_id=child,
        transform=Transform(translation=vector_message(parent_from_child[:3, 3]), rotation=rotation),
    )


class TransformBroadcaster:
    """Publisher of /tf and /tf_static for live graphs; does nothing if tf2_msgs cannot be imported."""

    def __init__(self, node: Node) -> None:
        self._publishers: dict[str, Any] = {}
        self._transforms: SceneTransforms | None = None
        if TFMessage is not None:
            for topic in (topics.tf_static_topic(), topics.tf_topic()):
                qos = rclpy_qos(qos_of(topic, live=False))
                self._publishers[topic.name] = node.create_publisher(TFMessage, topic.name, qos)

    def start_scene(self, spec: SceneSpec) -> None:
        """Publish the transforms of the agents' rigs, latched."""
        self._transforms = SceneTransforms(spec)
        if self._publishers:
            self._publishers[topics.TF_STATIC].publish(TFMessage(transforms=list(static_transforms(spec))))

    def publish(self, odometries: Sequence[Odometry]) -> None:
        """Publish the transforms of a tick, if the graph publishes any and there is a subscriber.

        Args:
            odometries: True odometry of each agent.
        """
        if not self._publishers or self._transforms is None:
            return
        moving = self._transforms.at(odometries)  # dead reckoning needs each tick
        publisher = self._publishers[topics.TF]
        if moving and publisher.get_subscription_count():
            publisher.publish(TFMessage(transforms=moving))
