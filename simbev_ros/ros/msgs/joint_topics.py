"""Topics about all agents of a scene together, and those of messages between them.

A scene with one agent has none of them. Pure: imports no ROS.
"""

import math
from collections.abc import Iterator
from typing import NamedTuple

from simbev_ros.ros.msgs.annotation_topics import annotation_topics
from simbev_ros.ros.msgs.topic import Topic, agent_topic
from simbev_ros.schema.scene.agents import agent_views
from simbev_ros.schema.scene.spec import SceneSpec

JOINT_BOXES = "/world/boxes"
_TABLE = "sensor_msgs/msg/PointCloud2"


class V2xTopics(NamedTuple):
    """Topics of the messages of an agent.

    Attributes:
        sent: What the agent sends, at the rate of the messages.
        arrived: What arrives at the agent, at every tick.
    """

    sent: Topic
    arrived: Topic


def joint_topics(spec: SceneSpec) -> Iterator[Topic]:
    """Topics that a bag can have because a scene has several agents."""
    if (boxes := joint_boxes_topic(spec)) is not None:
        yield boxes
    for topics in v2x_topics(spec).values():
        yield from (topics.sent, topics.arrived)


def joint_boxes_topic(spec: SceneSpec) -> Topic | None:
    """Topic with the boxes around all agents, when all of them have labels; None: the scene has one agent."""
    period = math.lcm(*(boxes.period_ticks for boxes in joint_inputs(spec).values()))
    return Topic(JOINT_BOXES, _TABLE, period) if len(spec.agents) > 1 else None


def v2x_topics(spec: SceneSpec) -> dict[str, V2xTopics]:
    """Topics of the messages between agents, by the name of the agent that sends or receives them."""
    if spec.v2x is None:
        return {}
    period = spec.period_ticks(spec.v2x.rate_hz)
    return {
        name: V2xTopics(sent=Topic(f"/v2x/{name}", _TABLE, period), arrived=Topic(agent_topic(name, "v2x"), _TABLE))
        for name in spec.v2x.agents
    }


def joint_inputs(spec: SceneSpec) -> dict[str, Topic]:
    """Topics with the boxes of each agent, by its name, which are read to join them or to send them."""
    if len(spec.agents) == 1:
        return {}
    return {view.agent: annotation_topics(view).boxes for view in agent_views(spec)}
