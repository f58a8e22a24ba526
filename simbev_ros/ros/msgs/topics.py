"""Manifest of a scene: name, type and rate of every topic.

All of them follow from the scene's specification; nodes take theirs from here. A function with the parameter ``spec``
gives the topics of all agents of a scene, one with the parameter ``view`` those of one agent. Pure: imports no ROS.
"""

from collections.abc import Iterator
from dataclasses import dataclass

from simbev_ros.config.scenario import RecordedTopics
from simbev_ros.ros.msgs.annotation_topics import annotation_topics
from simbev_ros.ros.msgs.joint_topics import joint_topics
from simbev_ros.ros.msgs.sensor_topics import sensor_topics
from simbev_ros.ros.msgs.topic import Topic, agent_topic
from simbev_ros.schema.scene.agents import AgentView, agent_views
from simbev_ros.schema.scene.spec import SceneSpec

CLOCK = "/clock"
SCENE = "/world/scene"
MAP = "/world/map"
LEGEND = "/world/legend"
REQUEST = "/world/request"
STOP = "/world/stop"
END = "/world/end"
ACTORS = "/world/actors"
SIGNALS = "/world/signals"
LIGHTS = "/world/lights"
BUILDING_LIGHTS = "/world/building_lights"
WEATHER = "/world/weather"
EVENTS = "/world/events"
READY = "/sync/ready"
DIAGNOSTICS = "/diagnostics"
EVALUATION = "/evaluation"
DRIVE_ROUTE = "/drive/route"
DRIVE_PLAN = "/drive/plan"
DRIVE_GOAL = "/drive/goal"
DRIVE_PROGRESS = "/drive/progress"
DRIVE_EVENTS = "/drive/events"
DRIVE_SCORE = "/drive/score"
TF = "/tf"
TF_STATIC = "/tf_static"
ROBOT_DESCRIPTION = "/robot_description"

REPLAY_TOPICS = (SCENE, MAP, ACTORS, SIGNALS, WEATHER, EVENTS)
"""Topics that a replay needs; always recorded, so that everything else can be computed again."""


def odometry_name(agent: str) -> str:
    """Name of the topic with an agent's true motion."""
    return agent_topic(agent, "odom")


def odometry_topic(view: AgentView) -> Topic:
    """Topic with an agent's true motion."""
    return Topic(odometry_name(view.agent), "nav_msgs/msg/Odometry")


def robot_description_topic(view: AgentView) -> Topic:
    """Topic with an agent's URDF; the ego's has the name that ROS tools expect."""
    name = ROBOT_DESCRIPTION if view.is_ego else agent_topic(view.agent, "robot_description")
    return Topic(name, "std_msgs/msg/String", 0)


def end_topic() -> Topic:
    """Topic that announces the end of a scene; it is not recorded."""
    return Topic(END, "std_msgs/msg/String", 0)


def world_topics(spec: SceneSpec) -> Iterator[Topic]:
    """Topics of the world node that every scene has."""
    yield from _WORLD
    for view in agent_views(spec):
        yield from _carrier_topics(view)
    yield from _drive_topics(spec)


def _drive_topics(spec: SceneSpec) -> tuple[Topic, ...]:
    """Topics of the world node about the first agent's route."""
    return () if spec.drive is None else _DRIVE


def referee_topics(spec: SceneSpec) -> tuple[Topic, ...]:
    """Topics of the referee: the infractions of the first agent, and its scores up to a tick."""
    return () if spec.drive is None else _REFEREE


_REFEREE = (
    Topic(DRIVE_EVENTS, "std_msgs/msg/String", sporadic=True),
    Topic(DRIVE_SCORE, "std_msgs/msg/String", sporadic=True),
)

_DRIVE = (
    Topic(DRIVE_ROUTE, "nav_msgs/msg/Path", 0),
    Topic(DRIVE_PLAN, "sensor_msgs/msg/PointCloud2", 0),
    Topic(DRIVE_GOAL, "geometry_msgs/msg/PoseStamped", 0),
    Topic(DRIVE_PROGRESS, "sensor_msgs/msg/PointCloud2"),
)

_WORLD = (
    Topic(SCENE, "std_msgs/msg/String", 0),
    Topic(MAP, "std_msgs/msg/String", 0),
    Topic(LEGEND, "std_msgs/msg/String", 0),
    Topic(LIGHTS, "sensor_msgs/msg/PointCloud2", 0),
    Topic(BUILDING_LIGHTS, "std_msgs/msg/String", 0),
    Topic(EVENTS, "std_msgs/msg/String", sporadic=True),
    Topic(CLOCK, "rosgraph_msgs/msg/Clock"),
    Topic(ACTORS, "sensor_msgs/msg/PointCloud2"),
    Topic(SIGNALS, "sensor_msgs/msg/PointCloud2"),
    Topic(WEATHER, "std_msgs/msg/String"),
)
"""Topics about the world."""


def _carrier_topics(view: AgentView) -> tuple[Topic, ...]:
    """Topics of the world node about an agent."""
    status = (vehicle_status_topic(view),) if view.reports_status else ()
    return robot_description_topic(view), odometry_topic(view), *status


def vehicle_status_topic(view: AgentView) -> Topic:
    """Topic with speed, steering, gear and indicators of an agent's vehicle."""
    return Topic(agent_topic(view.agent, "vehicle_status"), "sensor_msgs/msg/PointCloud2")


def transform_topics(spec: SceneSpec) -> Iterator[Topic]:
    """Topics of the transforms of a scene; they are in every bag, even if the graph cannot publish them."""
    yield tf_static_topic()
    if any(view.frames.publish for view in agent_views(spec)):
        yield tf_topic()


def tf_static_topic() -> Topic:
    """Topic of the transforms that stay."""
    return Topic(TF_STATIC, "tf2_msgs/msg/TFMessage", 0)


def tf_topic() -> Topic:
    """Topic of the transforms that change from tick to tick."""
    return Topic(TF, "tf2_msgs/msg/TFMessage")


@dataclass(frozen=True, slots=True)
class TopicFilter:
    """Filter for the recorded topics: those that the configuration chooses, and those that a replay needs."""

    chosen: RecordedTopics

    def __contains__(self, name: object) -> bool:
        return name in REPLAY_TOPICS or name in self.chosen


def manifest(spec: SceneSpec, *, compressed_images: bool) -> tuple[Topic, ...]:
    """All topics that a scene's bag can have, in the order in which a tick is written: by agent, and the joint ones."""
    return (
        *_WORLD,
        *transform_topics(spec),
        *_drive_topics(spec),
        *referee_topics(spec),
        *(topic for view in agent_views(spec) for topic in _agent_topics(view, compressed_images)),
        *joint_topics(spec),
    )


def _agent_topics(view: AgentView, compressed_images: bool) -> Iterator[Topic]:
    """Topics of an agent: its motion, sensor data and labels."""
    yield from _carrier_topics(view)
    yield from sensor_topics(view, compressed_images=compressed_images)
    yield from annotation_topics(view).recorded
