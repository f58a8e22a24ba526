"""Topics about all agents of a scene together. A scene with one agent has none of them. Pure: imports no ROS."""

from collections.abc import Iterator

from simbev_ros.msgs.annotation_topics import annotation_topics
from simbev_ros.msgs.topic import Topic
from simbev_ros.scene.agents import agent_views
from simbev_ros.scene.spec import SceneSpec

JOINT_BOXES = "/world/boxes"


def joint_topics(spec: SceneSpec) -> Iterator[Topic]:
    """Topics that a bag can have because a scene has several agents."""
    if spec.whole.agents:
        yield Topic(JOINT_BOXES, "sensor_msgs/msg/PointCloud2")


def joint_inputs(spec: SceneSpec) -> dict[str, Topic]:
    """Topics with the boxes of each agent, by its name, which are read to join them."""
    if not spec.whole.agents:
        return {}
    return {view.rig.agent: annotation_topics(view).boxes for view in agent_views(spec)}
