"""Displays of a scene: each topic with the topics that its messages are made of.

Pure: imports no ROS. They follow from the table of displays and the topics of the scene.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

from simbev_ros.config.camera import Camera
from simbev_ros.drawing.displays.table import MESSAGE_DISPLAYS, MessageDisplay, Moment
from simbev_ros.drawing.kinds import Kind
from simbev_ros.ros.msgs import topics
from simbev_ros.ros.msgs.annotation_topics import annotation_topics
from simbev_ros.ros.msgs.joint_topics import v2x_topics
from simbev_ros.ros.msgs.sensor_topics import camera_topics
from simbev_ros.ros.msgs.topic import Topic, agent_topic
from simbev_ros.scene.frames import ego_frame
from simbev_ros.schema.scene.agents import AgentView, agent_views
from simbev_ros.schema.scene.spec import SceneSpec

_WORLD = {
    Kind.ACTORS: topics.ACTORS,
    Kind.SIGNALS: topics.SIGNALS,
    Kind.LIGHTS: topics.LIGHTS,
    Kind.WEATHER: topics.WEATHER,
    Kind.EVENTS: topics.EVENTS,
}


@dataclass(frozen=True, slots=True)
class SceneDisplay:
    """A topic for displays in one scene.

    Attributes:
        topic: The topic.
        sources: Names of the topics of which it is made, images by the raw one; each message of the first one leads
            to one of this topic.
        source_type: ROS type of the first one.
    """

    topic: Topic
    sources: tuple[str, ...]
    source_type: str
    _row: MessageDisplay
    _frame: str
    _view: AgentView

    def make(self, stamp_ns: int, *contents: Any) -> bytes:
        """Serialized message of the contents of the sources, which are as in ``MessageDisplay``."""
        return self._row.make(Moment(stamp_ns, self._frame, self._view), *contents)


def scene_displays(spec: SceneSpec) -> tuple[SceneDisplay, ...]:
    """All displays of a scene that are made of other topics: those of the world, then those of each agent."""
    world = {topic.name: topic for topic in topics.world_topics(spec)}
    known = {kind.key(""): world[name] for kind, name in _WORLD.items()}
    of_world = [row for row in MESSAGE_DISPLAYS if row.topic.startswith("/world/")]
    others = [row for row in MESSAGE_DISPLAYS if row not in of_world]
    views = agent_views(spec)
    return (
        *(_display(row, known, views[0]) for row in of_world),
        *(display for view in views for display in _of_agent(others, known | dict(_data_of(view)), view)),
    )


def recorded_displays(spec: SceneSpec) -> tuple[SceneDisplay, ...]:
    """Displays that bags contain, each made of one topic."""
    recorded = {topic.name for topic in topics.manifest(spec, compressed_images=False)}
    return tuple(display for display in scene_displays(spec) if display.topic.name in recorded)


def _of_agent(rows: list[MessageDisplay], known: Mapping[str, Topic], view: AgentView) -> Iterator[SceneDisplay]:
    """Displays of an agent whose data the scene has."""
    cameras = [camera.name for camera in view.rig.of_type(Camera)]
    for row in rows:
        for sensor in cameras if row.kinds[0].is_of_sensor else [""]:
            if all(kind.key(view.agent, sensor) in known for kind in row.kinds):
                yield _display(row, known, view, sensor)


def _display(row: MessageDisplay, known: Mapping[str, Topic], view: AgentView, sensor: str = "") -> SceneDisplay:
    agent = view.agent
    sources = [known[kind.key(agent, sensor)] for kind in row.kinds]
    name = row.topic.format(agent=agent, sensor=sensor)
    topic = replace(
        sources[0],
        name=name if name.startswith("/") else agent_topic(agent, name),
        type=row.type_name,
        keeps_newest=row.keeps_newest,
    )
    frame = f"{agent}/{sensor}_optical" if sensor else ego_frame(view)
    return SceneDisplay(topic, tuple(source.name for source in sources), sources[0].type, row, frame, view)


def _data_of(view: AgentView) -> Iterator[tuple[str, Topic]]:
    """Topics with an agent's data, by their keys."""
    labels, agent = annotation_topics(view), view.agent
    yield Kind.ODOMETRY, topics.odometry_topic(view)
    yield Kind.BOXES, labels.boxes
    yield Kind.GRID, labels.bev_labels
    yield Kind.LANE, labels.hd_map
    if labels.vector_map is not None:
        yield Kind.VECTOR_MAP, labels.vector_map
    if (messages := v2x_topics(view.scene).get(agent)) is not None:
        yield Kind.V2X_SENT.key(agent), messages.sent
        yield Kind.V2X_ARRIVED, messages.arrived
    for name, topic in labels.views.items():
        yield Kind.VIEWS.key(agent, name), topic
    for camera in view.rig.of_type(Camera):
        for modality, forms in camera_topics(view, camera).items():
            yield f"{camera.name}/{modality}", forms.raw
