"""Topics with typed messages: what other topics carry as tables or JSON, in message types with fields.

These are those of ``simbev_interfaces``, and radar_msgs/RadarScan for radars whose configuration asks for it.

The recorder makes them of the messages that it records; a node that has the table or the record can serialize it right
away. Publishers of rclpy send serialized messages as they are. Pure: imports no ROS.
"""

import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

from rosbags.serde import SerdeError

from simbev_ros.config.radar import Radar
from simbev_ros.drawing.displays.messages import MAP_FRAME
from simbev_ros.foundation.errors import SimbevError
from simbev_ros.foundation.files.structured_text import parse_json
from simbev_ros.foundation.types import Table
from simbev_ros.recording.arrays import point_array
from simbev_ros.ros.msgs import topics, typed_records
from simbev_ros.ros.msgs.annotation_topics import annotation_topics
from simbev_ros.ros.msgs.sensor_topics import radar_scan_topic, radar_topic
from simbev_ros.ros.msgs.topic import Topic
from simbev_ros.schema.messages import table_messages
from simbev_ros.schema.messages.message_types import types_with
from simbev_ros.schema.messages.table_messages import RADAR_SCAN, row_layout, serialize_table
from simbev_ros.schema.scene.agents import AgentView, agent_views
from simbev_ros.schema.scene.spec import SceneSpec

_SUFFIX = "typed"
_MALFORMED = (SimbevError, SerdeError, KeyError, TypeError, AttributeError, OverflowError, struct.error)
"""Exceptions from reading or serializing malformed content, apart from ValueError."""


@dataclass(frozen=True, slots=True)
class TypedTopic:
    """Topic with the same content as another topic, in a message type with typed fields.

    Attributes:
        topic: The topic; it has a message for each one of the source, with the same stamp.
        source: The other topic.
        read: Gives the content of a serialized message of the source: a table, a record of JSON values, or for
            /world/scene the text itself.
        serialize: Gives the serialized message, little-endian CDR with zeros as padding, of such a content and a stamp,
            ns.
    """

    topic: Topic
    source: Topic
    read: Callable[[bytes | memoryview], Any]
    serialize: Callable[[Any, int], bytes]

    def convert(self, payload: bytes | memoryview, stamp_ns: int) -> bytes:
        """Make a serialized message of one of the source.

        Raises:
            ValueError: The source's message is malformed, or its content is not what the topic promises.
        """
        try:
            return self.serialize(self.read(payload), stamp_ns)
        except _MALFORMED as error:
            raise ValueError(f"its content is not that of {self.topic.type}: {error!r}") from None


def typed_topics(spec: SceneSpec) -> tuple[TypedTopic, ...]:
    """Typed topics of a scene: world; of each agent lane, boxes and the cameras' views of them; scans of radars."""
    world = {topic.name: topic for topic in topics.world_topics(spec)}
    return (
        _of_text(world[topics.SCENE], typed_records.SCENE, typed_records.serialize_scene, str),
        _of_text(world[topics.EVENTS], typed_records.EVENT, typed_records.serialize_event, parse_json),
        _of_table(world[topics.ACTORS], table_messages.ACTORS, MAP_FRAME),
        _of_table(world[topics.SIGNALS], table_messages.SIGNALS, MAP_FRAME),
        _of_text(world[topics.WEATHER], typed_records.WEATHER, typed_records.serialize_weather, parse_json),
        *(typed for view in agent_views(spec) for typed in _typed_labels(view)),
        *radar_scans(spec),
    )


def radar_scans(spec: SceneSpec) -> tuple[TypedTopic, ...]:
    """Topics with the detections of radars as radar_msgs/RadarScan, of those whose configuration asks for it."""
    return tuple(
        _radar_scan(view, radar) for view in agent_views(spec) for radar in view.rig.of_type(Radar) if radar.scan
    )


def _radar_scan(view: AgentView, radar: Radar) -> TypedTopic:
    returns = row_layout(RADAR_SCAN).dtype

    def serialize(cloud: Table, stamp_ns: int) -> bytes:
        rows = cloud[list(returns.names or ())].astype(returns)
        return serialize_table(RADAR_SCAN, rows, stamp_ns, f"{view.agent}/{radar.name}")

    return TypedTopic(radar_scan_topic(view, radar), radar_topic(view, radar), _read_table, serialize)


def _typed_labels(view: AgentView) -> Iterator[TypedTopic]:
    """Typed topics of an agent's labels."""
    labels = annotation_topics(view)
    yield _of_text(labels.hd_map, typed_records.LANE, typed_records.serialize_lane, parse_json)
    yield _of_table(labels.boxes, table_messages.BOXES, MAP_FRAME)
    for camera, topic in labels.views.items():
        yield _of_table(topic, table_messages.VIEWS, f"{view.agent}/{camera}_optical")


def _typed(source: Topic, type_name: str) -> Topic:
    return replace(source, name=f"{source.name}/{_SUFFIX}", type=type_name)


def _of_table(source: Topic, type_name: str, frame: str) -> TypedTopic:
    """The typed topic of a table."""

    def serialize(table: Table, stamp_ns: int) -> bytes:
        return serialize_table(type_name, table, stamp_ns, frame)

    return TypedTopic(_typed(source, type_name), source, _read_table, serialize)


def _of_text(
    source: Topic, type_name: str, serialize: Callable[[Any, int], bytes], parse: Callable[[str], Any]
) -> TypedTopic:
    """The typed topic of JSON."""
    return TypedTopic(_typed(source, type_name), source, lambda payload: parse(_read_text(payload)), serialize)


def _read_table(payload: bytes | memoryview) -> Table:
    return point_array(_decode(payload, "sensor_msgs/msg/PointCloud2"))


def _read_text(payload: bytes | memoryview) -> str:
    return str(_decode(payload, "std_msgs/msg/String").data)


def _decode(payload: bytes | memoryview, type_name: str) -> Any:
    return types_with(type_name).deserialize_cdr(payload, type_name)
