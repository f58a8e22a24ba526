"""Messages that the recorder makes of others: /tf of /world/actors, typed messages of tables and JSON, displays."""

from collections.abc import Callable, Container, Iterable, Mapping

from rosbags.serde import SerdeError

from simbev_ros.foundation.errors import FOREIGN_ERRORS, SimbevError
from simbev_ros.recording.arrays import image_array, point_array
from simbev_ros.ros.msgs import topics
from simbev_ros.ros.msgs.displays import SceneDisplay, recorded_displays
from simbev_ros.ros.msgs.transforms import SceneTransforms, serialize_transforms
from simbev_ros.ros.msgs.typed_topics import TypedTopic
from simbev_ros.schema.messages.message_types import types_with
from simbev_ros.schema.scene.spec import SceneSpec

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
    makers: dict[str, dict[str, Maker]] = {}
    if topics.TF in recorded:
        makers[topics.ACTORS] = {topics.TF: _transforms(spec)}
    for each in typed:
        if each.topic.name in recorded:
            makers.setdefault(each.source.name, {})[each.topic.name] = each.convert
    for display in recorded_displays(spec):
        if display.topic.name in recorded:
            makers.setdefault(display.sources[0], {})[display.topic.name] = _drawing(display)
    return makers


def _transforms(spec: SceneSpec) -> Maker:
    """Maker of /tf."""
    transforms = SceneTransforms(spec)
    return lambda payload, stamp_ns: serialize_transforms(transforms.of_actors(payload, stamp_ns))


def _drawing(display: SceneDisplay) -> Maker:
    """Maker of a display of one image or table."""
    source = display.source_type
    read = image_array if source.endswith("/Image") else point_array

    def draw(payload: bytes, stamp_ns: int) -> bytes:
        try:
            return display.make(stamp_ns, read(types_with(source).deserialize_cdr(payload, source)))
        except (SimbevError, SerdeError, *FOREIGN_ERRORS) as error:
            raise ValueError(f"{display.topic.name} cannot be made of it: {error!r:.200}") from None

    return draw
