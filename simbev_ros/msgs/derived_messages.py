"""Messages that the recorder makes of others: /tf of the odometry, typed messages of tables and JSON."""

from collections.abc import Callable, Container, Iterable, Mapping

from nav_msgs.msg import Odometry
from rclpy.serialization import deserialize_message

from simbev_ros.msgs import topics
from simbev_ros.msgs.transforms import EgoTransforms, serialize_transforms
from simbev_ros.msgs.typed_topics import TypedTopic
from simbev_ros.scene.spec import SceneSpec

Maker = Callable[[bytes, int], bytes]
"""Makes a serialized message of another one and its stamp, ns; raises ValueError if that one is malformed."""


def message_makers(
    spec: SceneSpec, typed: Iterable[TypedTopic], recorded: Container[str]
) -> Mapping[str, Mapping[str, Maker]]:
    """Makers of messages on recorded topics, by source and topic; those of /tf take the ticks of a scene in order.

    Args:
        spec: The scene.
        typed: Typed topics of the scene.
        recorded: Names of the recorded topics.
    """
    odometry = topics.odometry_name(spec.rig.agent)
    makers: dict[str, dict[str, Maker]] = {odometry: {topics.TF: _transforms(spec)}} if topics.TF in recorded else {}
    for each in typed:
        if each.topic.name in recorded:
            makers.setdefault(each.source.name, {})[each.topic.name] = each.convert
    return makers


def _transforms(spec: SceneSpec) -> Maker:
    transforms = EgoTransforms(spec)
    return lambda odometry, _: serialize_transforms(transforms.at(deserialize_message(odometry, Odometry)))
