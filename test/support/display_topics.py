"""All topics of a scene that the graph publishes only to subscribers, collected from the tables that its nodes use."""

from collections.abc import Iterator

from simbev_ros.config.camera import Camera
from simbev_ros.ros.msgs.annotation_topics import annotation_topics
from simbev_ros.ros.msgs.displays import scene_displays
from simbev_ros.ros.msgs.sensor_topics import label_info_topic
from simbev_ros.ros.msgs.topic import Topic
from simbev_ros.schema.scene.agents import agent_views
from simbev_ros.schema.scene.spec import SceneSpec


def display_topics(spec: SceneSpec) -> Iterator[Topic]:
    """Topics that the graph publishes only to subscribers, and that are not recorded."""
    views = agent_views(spec)
    recorded = {topic.name for view in views for topic in annotation_topics(view).recorded}
    yield from (each.topic for each in scene_displays(spec) if each.topic.name not in recorded)
    for view in views:
        names = (label_info_topic(view, camera) for camera in view.rig.of_type(Camera))
        yield from (topic for topic in names if topic is not None)
        yield annotation_topics(view).bev_label_info
