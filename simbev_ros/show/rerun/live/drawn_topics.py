"""Topics of a running graph that the viewer draws, and so subscribes to. Pure: imports no ROS."""

from collections.abc import Callable, Iterator

from simbev_ros.config.camera import Camera
from simbev_ros.config.lidar import Lidar
from simbev_ros.config.positioning import Imu
from simbev_ros.config.rig import AnySensor
from simbev_ros.ros.msgs.annotation_topics import annotation_topics
from simbev_ros.ros.msgs.sensor_topics import CameraTopics, camera_topics, imu_topics, lidar_topics, topics_of_sensor
from simbev_ros.ros.msgs.topic import Topic
from simbev_ros.ros.msgs.topics import EVENTS, odometry_topic
from simbev_ros.schema.scene.agents import AgentView

ChooseImage = Callable[[CameraTopics], Topic]
"""Chooses the raw or the compressed topic of a camera's modality."""


def drawn_topics(view: AgentView, choose_image: ChooseImage, *, layers: bool) -> Iterator[Topic]:
    """Topics of a scene that are drawn.

    Args:
        view: The scene as the agent that is shown sees it.
        choose_image: Chooses one of the two forms of an image.
        layers: Whether to include what is hidden until it is switched on: the cameras' other modalities, the classes
            of lidar points, and occupancy.
    """
    yield odometry_topic(view)
    yield Topic(EVENTS, "std_msgs/msg/String", sporadic=True)
    for sensor in view.rig.sensors:
        yield from _sensor_topics(view, sensor, choose_image, layers)
    labels = annotation_topics(view)
    yield from (labels.bev_labels, labels.boxes, *labels.views.values())
    if labels.vector_map is not None:
        yield labels.vector_map
    if labels.occupancy is not None and layers:
        yield labels.occupancy


def _sensor_topics(view: AgentView, sensor: AnySensor, choose_image: ChooseImage, layers: bool) -> Iterator[Topic]:
    if isinstance(sensor, Camera):
        for modality, forms in camera_topics(view, sensor).items():
            if modality == "rgb" or layers:
                yield choose_image(forms)
    elif isinstance(sensor, Lidar):
        clouds = lidar_topics(view, sensor).raw
        yield from clouds if layers else clouds[:1]
    elif isinstance(sensor, Imu):
        yield imu_topics(view, sensor).oriented
    else:
        yield from topics_of_sensor(view, sensor, compressed_images=True)
