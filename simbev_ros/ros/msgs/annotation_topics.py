"""Topics of the annotator: the labels that it publishes, and the sensor data that it reads.

All of them follow from a scene's specification. Pure: imports no ROS.
"""

import math
from collections.abc import Container, Iterator, Mapping
from dataclasses import dataclass, replace
from enum import StrEnum

from simbev_ros.config.annotation import Annotation
from simbev_ros.config.camera import Camera
from simbev_ros.config.lidar import Lidar
from simbev_ros.config.radar import Radar
from simbev_ros.config.rig import Rig
from simbev_ros.drawing.displays.detections import LABEL_INFO
from simbev_ros.ros.msgs.sensor_topics import camera_topics, lidar_topics, radar_topic
from simbev_ros.ros.msgs.topic import Topic, agent_topic
from simbev_ros.schema.scene.agents import AgentView


class Label(StrEnum):
    """Labels of an annotator: 3D boxes, their visibility in cameras, or the surroundings of the ego."""

    BOXES = "boxes"
    VIEWS = "views"
    SURROUNDINGS = "surroundings"


@dataclass(frozen=True, slots=True)
class AnnotationTopics:
    """Topics that the annotator publishes in one scene.

    Attributes:
        bev_labels: The bird's-eye-view grid, one bit per class.
        bev_color: The grid as a color image.
        boxes: The 3D boxes.
        box_markers: The boxes as markers for displays.
        hd_map: The lane under the ego.
        views: How each camera with instance images sees the boxes, by the camera's name.
        occupancy: Occupied voxels; None: not configured.
        vector_map: The roads around the ego; None: not configured.
        bev_label_info: Names of the bits of ``bev_labels``, latched; not recorded.
    """

    bev_labels: Topic
    bev_color: Topic
    boxes: Topic
    box_markers: Topic
    hd_map: Topic
    views: Mapping[str, Topic]
    occupancy: Topic | None
    vector_map: Topic | None
    bev_label_info: Topic

    @property
    def recorded(self) -> tuple[Topic, ...]:
        """Topics that a bag contains, in its order."""
        always = (self.bev_labels, self.bev_color, self.boxes, self.box_markers, self.hd_map)
        asked = (topic for topic in (self.occupancy, self.vector_map) if topic is not None)
        return (*always, *self.views.values(), *asked)

    @property
    def by_label(self) -> dict[Label, tuple[Topic, ...]]:
        """Recorded topics by what they are about, without the displays that are made of them."""
        views = tuple(self.views.values())
        apart = (self.boxes, *views, self.bev_color, self.box_markers)
        others = tuple(topic for topic in self.recorded if topic not in apart)
        return {Label.BOXES: (self.boxes,), Label.VIEWS: views, Label.SURROUNDINGS: others}


def boxes_name(agent: str) -> str:
    """Name of the topic with the 3D boxes around an agent."""
    return agent_topic(agent, "boxes")


def bev_labels_name(agent: str) -> str:
    """Name of the topic with the bird's-eye-view grid around an agent."""
    return agent_topic(agent, "bev/labels")


def annotation_topics(view: AgentView) -> AnnotationTopics:
    """Topics that the annotator publishes in a scene."""
    agent, occupancy, vector_map = view.agent, view.annotation.occupancy, view.annotation.vector_map
    cameras, markers = viewing_cameras(view.rig, view.annotation), "visualization_msgs/msg/MarkerArray"

    def topic(name: str, type_name: str, rate_hz: float | None = None) -> Topic:
        return Topic(agent_topic(agent, name), type_name, view.label_period_ticks(rate_hz))

    return AnnotationTopics(
        bev_labels=topic("bev/labels", "sensor_msgs/msg/Image"),
        bev_color=topic("bev/color", "sensor_msgs/msg/Image"),
        boxes=topic("boxes", "sensor_msgs/msg/PointCloud2"),
        box_markers=topic("boxes/markers", markers),
        hd_map=topic("hd_map", "std_msgs/msg/String"),
        views={
            camera.name: topic(f"{camera.name}/boxes", "sensor_msgs/msg/PointCloud2", camera.rate_hz)
            for camera in cameras
        },
        occupancy=topic("occupancy/points", "sensor_msgs/msg/PointCloud2", occupancy.rate_hz) if occupancy else None,
        vector_map=topic("vector_map", "std_msgs/msg/String", vector_map.rate_hz) if vector_map else None,
        bev_label_info=Topic(agent_topic(agent, "bev/label_info"), LABEL_INFO, 0),
    )


def viewing_cameras(rig: Rig, annotation: Annotation) -> list[Camera]:
    """Cameras whose views of the boxes are published: those with instance images, if views are configured."""
    return [each for each in rig.of_type(Camera) if annotation.views and "instance" in each.modalities]


def annotator_inputs(
    view: AgentView, *, compressed_images: bool, labels: Container[Label] = tuple(Label)
) -> dict[str, Topic]:
    """Topics that an annotator reads, by the sensor's name, with the period at which it needs their messages.

    Boxes need the clouds, of each lidar the noisy one if there is one, because perception receives that one; views need
    the instance images in one of their two forms. An annotator of boxes without views reads the views of another one.
    """
    period = view.label_period_ticks()
    return {
        sensor: replace(topic, period_ticks=math.lcm(period, topic.period_ticks))
        for sensor, topic in _annotator_inputs(view, compressed_images, labels)
    }


def _annotator_inputs(
    view: AgentView, compressed_images: bool, labels: Container[Label]
) -> Iterator[tuple[str, Topic]]:
    if Label.BOXES in labels:
        for lidar in view.rig.of_type(Lidar):
            yield lidar.name, lidar_topics(view, lidar).recorded(lidar)[0]
        for radar in view.rig.of_type(Radar):
            yield radar.name, radar_topic(view, radar)
    if Label.VIEWS in labels:
        for camera in viewing_cameras(view.rig, view.annotation):
            images, _ = camera_topics(view, camera)["instance"].recorded(compressed=compressed_images)
            yield camera.name, images
    elif Label.BOXES in labels:
        yield from annotation_topics(view).views.items()
