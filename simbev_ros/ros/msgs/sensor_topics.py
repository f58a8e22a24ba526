"""Topics of a rig's sensors: every name, type and rate is defined here and nowhere else.

Each kind of sensor has a function that gives its topics from a scene's specification. Its node publishes on them, and
``topics_of_sensor`` adds them to the manifest, from which recorder, evaluator and annotator know what a sensor sends.
Pure: imports no ROS.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple, assert_never

from simbev_ros.config.camera import Camera
from simbev_ros.config.lidar import Lidar
from simbev_ros.config.modalities import IMAGE_KINDS, Modality
from simbev_ros.config.odometry import Odometry
from simbev_ros.config.positioning import Gnss, Imu
from simbev_ros.config.radar import Radar
from simbev_ros.config.rig import AnySensor
from simbev_ros.config.sensor import Sensor
from simbev_ros.drawing.displays.detections import LABEL_INFO
from simbev_ros.recording.compressed_clouds import COMPRESSED_CLOUD, ZSTD
from simbev_ros.recording.video import VIDEO_TYPE
from simbev_ros.ros.msgs.topic import Topic, agent_topic
from simbev_ros.schema.messages.table_messages import RADAR_SCAN
from simbev_ros.schema.scene.agents import AgentView

_POINTS = "points"
_CAMERA_INFO = "camera_info"
_VIDEO = "video"
_LABEL_INFO = "label_info"


class CameraTopics(NamedTuple):
    """Topics of one modality of a camera.

    Attributes:
        raw: Its images.
        compressed: Its compressed images, named as in image_transport.
        info: The CameraInfo of the images, in their namespace, where image_transport looks for it.
        video: Its images as a video; None: there is none.
    """

    raw: Topic
    compressed: Topic
    info: Topic
    video: Topic | None = None

    def recorded(self, *, compressed: bool) -> tuple[Topic, Topic]:
        """Topics that a bag contains: images in one form, a video if there is one and they are compressed, and info."""
        return ((self.video or self.compressed) if compressed else self.raw), self.info


class LidarTopics(NamedTuple):
    """Topics of a lidar; None: this cloud is switched off. At least one is on."""

    points: Topic | None
    semantic_points: Topic | None

    @property
    def raw(self) -> tuple[Topic, ...]:
        """The clouds that are on."""
        return tuple(topic for topic in self if topic is not None)

    def recorded(self, lidar: Lidar) -> tuple[Topic, ...]:
        """The clouds that are on in the form that bags contain."""
        return self.raw if lidar.compression is None else tuple(map(compressed_cloud_topic, self.raw))


class GnssTopics(NamedTuple):
    """Topics of a GNSS receiver.

    Attributes:
        fix: Its fixes.
        velocity: Its velocity, named as nmea_navsat_driver does; None: it is switched off.
        fix_velocity: The same with its covariance, named as ublox_gps does; None: it is switched off.
        extended_fix: Fixes with velocities, named as gpsd_client does; None: it is switched off.
    """

    fix: Topic
    velocity: Topic | None = None
    fix_velocity: Topic | None = None
    extended_fix: Topic | None = None


class ImuTopics(NamedTuple):
    """Topics of an IMU (REP-145): samples without and with orientation."""

    raw: Topic
    oriented: Topic


def points_name(agent: str, sensor: str) -> str:
    """Name of the topic with the points of a lidar or the detections of a radar."""
    return agent_topic(agent, f"{sensor}/{_POINTS}")


def camera_info_name(agent: str, camera: str, modality: Modality) -> str:
    """Name of the CameraInfo topic of a camera's modality."""
    return agent_topic(agent, f"{camera}/{modality}/{_CAMERA_INFO}")


def camera_topics(view: AgentView, camera: Camera) -> dict[Modality, CameraTopics]:
    """Topics of a camera, by modality in the rig's order."""
    topics = {}
    for modality in camera.modalities:
        raw = f"{modality}/image_raw"
        topics[modality] = CameraTopics(
            _topic(view, camera, raw, "sensor_msgs/msg/Image"),
            _topic(view, camera, f"{raw}/{IMAGE_KINDS[modality].transport}", "sensor_msgs/msg/CompressedImage"),
            _topic(view, camera, f"{modality}/{_CAMERA_INFO}", "sensor_msgs/msg/CameraInfo"),
            _topic(view, camera, f"{modality}/{_VIDEO}", VIDEO_TYPE) if camera.video and modality == "rgb" else None,
        )
    return topics


def camera_info_topic(view: AgentView, camera: Camera) -> Topic:
    """Topic with the CameraInfo that all images of a camera share: one lens, one frame, one rate."""
    return _topic(view, camera, _CAMERA_INFO, "sensor_msgs/msg/CameraInfo")


def label_info_topic(view: AgentView, camera: Camera) -> Topic | None:
    """Latched topic with the names of the classes in a camera's semantic images; None: it has no such images."""
    if "semantic" not in camera.modalities:
        return None
    return Topic(agent_topic(view.agent, f"{camera.name}/semantic/{_LABEL_INFO}"), LABEL_INFO, 0)


def lidar_topics(view: AgentView, lidar: Lidar) -> LidarTopics:
    """Topics of a lidar."""
    return LidarTopics(
        _topic(view, lidar, _POINTS, "sensor_msgs/msg/PointCloud2") if lidar.points else None,
        _topic(view, lidar, "semantic_points", "sensor_msgs/msg/PointCloud2") if lidar.semantic_points else None,
    )


def compressed_cloud_topic(cloud: Topic) -> Topic:
    """Topic with the compressed form of a cloud, named as by point_cloud_transport."""
    return replace(cloud, name=f"{cloud.name}/{ZSTD}", type=COMPRESSED_CLOUD)


def radar_topic(view: AgentView, radar: Radar) -> Topic:
    """Topic with the detections of a radar."""
    return _topic(view, radar, _POINTS, "sensor_msgs/msg/PointCloud2")


def radar_scan_topic(view: AgentView, radar: Radar) -> Topic:
    """Topic with the detections of a radar as radar_msgs/RadarScan, if its configuration asks for it."""
    return _topic(view, radar, "scan", RADAR_SCAN)


def gnss_topics(view: AgentView, gnss: Gnss) -> GnssTopics:
    """Topics of a GNSS receiver."""
    fix = _topic(view, gnss, "fix", "sensor_msgs/msg/NavSatFix")
    extended_fix = _topic(view, gnss, "extended_fix", "gps_msgs/msg/GPSFix") if gnss.extended_fix else None
    if gnss.velocity is None:
        return GnssTopics(fix, extended_fix=extended_fix)
    return GnssTopics(
        fix,
        _topic(view, gnss, "vel", "geometry_msgs/msg/TwistStamped"),
        _topic(view, gnss, "fix_velocity", "geometry_msgs/msg/TwistWithCovarianceStamped"),
        extended_fix,
    )


def imu_topics(view: AgentView, imu: Imu) -> ImuTopics:
    """Topics of an IMU."""
    return ImuTopics(
        raw=_topic(view, imu, "data_raw", "sensor_msgs/msg/Imu"),
        oriented=_topic(view, imu, "data", "sensor_msgs/msg/Imu"),
    )


def wheel_odometry_topic(view: AgentView, odometry: Odometry) -> Topic:
    """Topic with pose and velocity of a wheel odometry."""
    return _topic(view, odometry, "odometry", "nav_msgs/msg/Odometry")


def sensor_topics(view: AgentView, *, compressed_images: bool) -> Iterator[Topic]:
    """Topics of all sensors of a scene's rig; images in compressed or raw form."""
    for sensor in view.rig.sensors:
        yield from topics_of_sensor(view, sensor, compressed_images=compressed_images)


def topics_of_sensor(view: AgentView, sensor: AnySensor, *, compressed_images: bool) -> tuple[Topic, ...]:
    """Topics of one sensor of any kind, in the order in which they are in a bag."""
    match sensor:
        case Camera():
            modalities = camera_topics(view, sensor).values()
            images = (topic for each in modalities for topic in each.recorded(compressed=compressed_images))
            return (camera_info_topic(view, sensor), *images)
        case Lidar():
            return lidar_topics(view, sensor).recorded(sensor)
        case Radar():
            return (radar_topic(view, sensor),)
        case Gnss():
            return tuple(topic for topic in gnss_topics(view, sensor) if topic is not None)
        case Imu():
            return imu_topics(view, sensor)
        case Odometry():
            return (wheel_odometry_topic(view, sensor),)
        case _:
            assert_never(sensor)


def _topic(view: AgentView, sensor: Sensor, name: str, type_name: str) -> Topic:
    """A topic in a sensor's namespace, at the sensor's rate."""
    return Topic(
        agent_topic(view.agent, f"{sensor.name}/{name}"),
        type_name,
        view.scene.period_ticks(sensor.rate_hz),
        sensor=True,
        messages_per_tick=view.scene.messages_per_tick(sensor.rate_hz),
    )
