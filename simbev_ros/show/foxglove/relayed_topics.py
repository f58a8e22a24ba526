"""Topics for the relay's clients: those of a running graph, and transforms where the graph cannot publish them."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from std_msgs.msg import String

from simbev_ros.ros.conventions.names import NamespacedNode
from simbev_ros.ros.msgs import topics
from simbev_ros.ros.msgs.message_types import message_class
from simbev_ros.ros.msgs.stamps import serialized_stamp_ns
from simbev_ros.ros.msgs.transforms import SceneTransforms, serialize_transforms, static_transforms
from simbev_ros.schema.messages.message_types import is_known_type
from simbev_ros.schema.scene.spec import SceneSpec

_TRANSFORMS = "tf2_msgs/msg/TFMessage"
_INTERNAL = ("/parameter_events",)
_LATCHED_DEPTH, _DEPTH = 10, 20
_LARGE = ("sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage", "sensor_msgs/msg/PointCloud2")
"""Types of which only the newest message waits for a busy relay."""


@dataclass(frozen=True, slots=True)
class RelayedTopic:
    """A topic for clients.

    Attributes:
        name: Name of the topic.
        type_name: Its type.
        sources: Topics of the graph to subscribe to; others if the offered messages are made of their messages.
        source_type: Type of the sources.
        is_latched: Whether the sources' publishers keep their last message for late subscribers.
        make: Makes an offered message from each of the sources', or None of some; None: they are the same.
    """

    name: str
    type_name: str
    sources: tuple[str, ...]
    source_type: str
    is_latched: bool
    make: Callable[[bytes], bytes | None] | None = None

    @property
    def qos(self) -> QoSProfile:
        """QoS of a subscription that no publisher ever waits for: only latched topics are reliable."""
        if self.is_latched:
            return QoSProfile(depth=_LATCHED_DEPTH, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        depth = 1 if self.source_type in _LARGE else _DEPTH
        return QoSProfile(depth=depth, reliability=ReliabilityPolicy.BEST_EFFORT)


def relayed_topics(
    node: NamespacedNode, transforms: "GraphTransforms"
) -> tuple[dict[str, RelayedTopic], dict[str, str]]:
    """Topics with publishers in the domain and namespace of a node.

    Args:
        node: The node.
        transforms: Makes transforms that the graph does not publish.

    Returns:
        Topics by name, and types by name of topics that cannot be offered because their package is not installed.
    """
    relayed, unknown = {}, {}
    for name, types in node.graph_topics():
        publishers = [] if name in _INTERNAL else node.get_publishers_info_by_topic(name)
        if not publishers:
            continue
        type_name = types[0]
        if not _is_readable(type_name):
            unknown[name] = type_name
            continue
        is_latched = all(
            (each.qos_profile.durability, each.qos_profile.reliability)
            == (DurabilityPolicy.TRANSIENT_LOCAL, ReliabilityPolicy.RELIABLE)
            for each in publishers
        )
        relayed[name] = RelayedTopic(name, type_name, (name,), type_name, is_latched)
    missing = (topics.TF, topics.TF_STATIC)
    for topic in transform_topics(relayed, transforms):
        relayed.setdefault(topic.name, topic)
    return relayed, {name: kind for name, kind in unknown.items() if name not in missing or name not in relayed}


def _is_readable(type_name: str) -> bool:
    """Whether messages of a type can be received and described."""
    try:
        message_class(type_name)
    except (ImportError, AttributeError, ValueError):
        return False
    return is_known_type(type_name)


def transform_topics(relayed: Mapping[str, RelayedTopic], transforms: "GraphTransforms") -> Iterator[RelayedTopic]:
    """/tf of all agents, and /tf_static, from a graph that runs where tf2_msgs is not installed."""
    for name, source, make in (
        (topics.TF, topics.ACTORS, transforms.moving),
        (topics.TF_STATIC, topics.SCENE, transforms.static),
    ):
        if source in relayed and topics.SCENE in relayed:
            yield replace(relayed[source], name=name, type_name=_TRANSFORMS, make=make)


class GraphTransforms:
    """Makes the transforms of the scene that a graph plays, as its recorder does."""

    def __init__(self) -> None:
        self._spec: SceneSpec | None = None
        self._transforms: SceneTransforms | None = None

    def start_scene(self, payload: bytes) -> None:
        """Take the message of /world/scene.

        Raises:
            ValueError: It is malformed.
        """
        self._spec = SceneSpec.from_json(deserialize_message(payload, String).data)
        self._transforms = SceneTransforms(self._spec)

    def moving(self, payload: bytes) -> bytes | None:
        """/tf of a message of /world/actors; None: the scene is not known yet, or has no such transforms.

        Raises:
            ValueError: The message is malformed.
        """
        stamp_ns = serialized_stamp_ns(payload, "sensor_msgs/msg/PointCloud2")
        if self._transforms is None or stamp_ns is None:
            return None
        made = self._transforms.of_actors(payload, stamp_ns)
        return serialize_transforms(made) if made else None

    def static(self, payload: bytes) -> bytes:
        """/tf_static of a message of /world/scene."""
        self.start_scene(payload)
        assert self._spec is not None
        return serialize_transforms(static_transforms(self._spec))


def differences(
    before: Mapping[str, RelayedTopic], now: Mapping[str, RelayedTopic]
) -> tuple[Sequence[str], Sequence[str]]:
    """Names of the topics that have vanished or are offered differently, and of those that are new or different."""
    gone = [name for name, topic in before.items() if now.get(name) != topic]
    return gone, [name for name, topic in now.items() if before.get(name) != topic]
