"""The topics of a scene: names, types and how often each is published. Pure: imports no ROS."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase

from simbev_ros.config.camera import Camera, Modality
from simbev_ros.config.lidar import Lidar
from simbev_ros.config.positioning import Gnss, Imu
from simbev_ros.config.radar import Radar
from simbev_ros.scene.spec import SceneSpec

CLOCK = "/clock"
SCENE = "/world/scene"
MAP = "/world/map"
LEGEND = "/world/legend"
REQUEST = "/world/request"
END = "/world/end"
ACTORS = "/world/actors"
SIGNALS = "/world/signals"
LIGHTS = "/world/lights"
BUILDING_LIGHTS = "/world/building_lights"
WEATHER = "/world/weather"
EVENTS = "/world/events"
WORLD_MARKERS = "/world/markers"
READY = "/sync/ready"
DIAGNOSTICS = "/diagnostics"
EVALUATION = "/evaluation"
TF = "/tf"
TF_STATIC = "/tf_static"

REPLAYED = (SCENE, MAP, ACTORS, SIGNALS, WEATHER, EVENTS)
"""What a replay needs: it is always recorded, so that all else can be had again."""

_COMPRESSED: dict[Modality, str] = {
    "rgb": "compressed",
    "semantic": "compressed",
    "instance": "compressed",
    "depth": "compressedDepth",
    "flow": "compressed",
}


@dataclass(frozen=True, slots=True)
class Topic:
    """One topic of a scene.

    Attributes:
        name: With leading slash.
        type: ROS type, e.g. ``sensor_msgs/msg/Image``.
        period_ticks: One message every so many ticks from tick 0 on; 0: latched, one message a scene.
        sensor: Sensor data, which live graphs send as best effort.
        sporadic: Messages come when something happens, none, one or more at a tick.
        messages_per_tick: At each tick but the first so many, stamped at equal distances, the last one at the tick; at
            tick 0 one. More than one only where ``period_ticks`` is 1.
    """

    name: str
    type: str
    period_ticks: int = 1
    sensor: bool = False
    sporadic: bool = False
    messages_per_tick: int = 1


def image_topic(agent: str, camera: str, modality: str) -> str:
    """Raw image topic of a camera's modality."""
    return f"/{agent}/{camera}/{modality}/image_raw"


def compressed_topic(agent: str, camera: str, modality: Modality) -> str:
    """Compressed form of ``image_topic``, named as image_transport does."""
    return f"{image_topic(agent, camera, modality)}/{_COMPRESSED[modality]}"


def camera_info_topic(agent: str, camera: str, modality: str) -> str:
    """CameraInfo next to ``image_topic``."""
    return f"/{agent}/{camera}/{modality}/camera_info"


def views_topic(agent: str, camera: str) -> str:
    """What of the boxes a camera sees."""
    return f"/{agent}/{camera}/boxes"


def agent_topic(agent: str, name: str) -> str:
    """A topic in an agent's namespace."""
    return f"/{agent}/{name}"


def world_topics(spec: SceneSpec) -> Iterator[Topic]:
    """What the world node publishes and every scene has."""
    yield Topic(SCENE, "std_msgs/msg/String", 0)
    yield Topic(MAP, "std_msgs/msg/String", 0)
    yield Topic(LEGEND, "std_msgs/msg/String", 0)
    yield Topic(LIGHTS, "sensor_msgs/msg/PointCloud2", 0)
    yield Topic(BUILDING_LIGHTS, "std_msgs/msg/String", 0)
    yield Topic(EVENTS, "std_msgs/msg/String", sporadic=True)
    yield Topic(CLOCK, "rosgraph_msgs/msg/Clock")
    yield Topic(ACTORS, "sensor_msgs/msg/PointCloud2")
    yield Topic(SIGNALS, "sensor_msgs/msg/PointCloud2")
    yield Topic(WEATHER, "std_msgs/msg/String")
    yield Topic(agent_topic(spec.rig.agent, "odom"), "nav_msgs/msg/Odometry")


def annotation_topics(spec: SceneSpec) -> Iterator[Topic]:
    """What the annotator publishes."""
    agent = spec.rig.agent
    yield Topic(agent_topic(agent, "bev/labels"), "sensor_msgs/msg/Image")
    yield Topic(agent_topic(agent, "bev/color"), "sensor_msgs/msg/Image")
    yield Topic(agent_topic(agent, "boxes"), "sensor_msgs/msg/PointCloud2")
    yield Topic(agent_topic(agent, "boxes/markers"), "visualization_msgs/msg/MarkerArray")
    yield Topic(agent_topic(agent, "hd_map"), "std_msgs/msg/String")
    for camera in viewing_cameras(spec):
        yield Topic(views_topic(agent, camera.name), "sensor_msgs/msg/PointCloud2", spec.period_ticks(camera.rate_hz))
    occupancy, vector_map = spec.annotation.occupancy, spec.annotation.vector_map
    if occupancy is not None:
        period = spec.period_ticks(occupancy.rate_hz)
        yield Topic(agent_topic(agent, "occupancy/points"), "sensor_msgs/msg/PointCloud2", period)
    if vector_map is not None:
        yield Topic(agent_topic(agent, "vector_map"), "std_msgs/msg/String", spec.period_ticks(vector_map.rate_hz))


def viewing_cameras(spec: SceneSpec) -> list[Camera]:
    """The cameras of which the annotator says what they see."""
    return [each for each in spec.rig.of_type(Camera) if spec.annotation.views and "instance" in each.modalities]


def read_by_annotator(spec: SceneSpec, *, compressed_images: bool) -> dict[str, Topic]:
    """By sensor the topic that the annotator reads of it: a cloud, or instance images in their compressed or raw form.

    Of a lidar the cloud with its errors counts, as that is what perception gets, if there is one.
    """
    taken: dict[str, Topic] = {}
    clouds = [sensor.name for sensor in (*spec.rig.of_type(Lidar), *spec.rig.of_type(Radar))]
    images = [camera.name for camera in viewing_cameras(spec)]
    for topic in sensor_topics(spec, compressed_images=compressed_images):
        _, _, sensor, modality, *_ = topic.name.split("/")
        is_image = modality == "instance" and "CameraInfo" not in topic.type
        if sensor in clouds or (sensor in images and is_image):
            taken.setdefault(sensor, topic)
    return taken


def sensor_topics(spec: SceneSpec, *, compressed_images: bool) -> Iterator[Topic]:
    """What the rig's sensors publish; of images the compressed or the raw form."""
    agent = spec.rig.agent
    for sensor in spec.rig.sensors:
        period = spec.period_ticks(sensor.rate_hz)
        base = f"/{agent}/{sensor.name}"
        match sensor:
            case Camera():
                for modality in sensor.modalities:
                    if compressed_images:
                        name, kind = compressed_topic(agent, sensor.name, modality), "CompressedImage"
                    else:
                        name, kind = image_topic(agent, sensor.name, modality), "Image"
                    yield Topic(name, f"sensor_msgs/msg/{kind}", period, sensor=True)
                    info = camera_info_topic(agent, sensor.name, modality)
                    yield Topic(info, "sensor_msgs/msg/CameraInfo", period, sensor=True)
            case Lidar():
                if sensor.points:
                    yield Topic(f"{base}/points", "sensor_msgs/msg/PointCloud2", period, sensor=True)
                if sensor.semantic_points:
                    yield Topic(f"{base}/semantic_points", "sensor_msgs/msg/PointCloud2", period, sensor=True)
            case Radar():
                yield Topic(f"{base}/points", "sensor_msgs/msg/PointCloud2", period, sensor=True)
            case Gnss():
                yield Topic(f"{base}/fix", "sensor_msgs/msg/NavSatFix", period, sensor=True)
            case Imu():
                per_tick = spec.messages_per_tick(sensor.rate_hz)
                for name in ("data_raw", "data"):
                    yield Topic(
                        f"{base}/{name}", "sensor_msgs/msg/Imu", period, sensor=True, messages_per_tick=per_tick
                    )


def transform_topics() -> Iterator[Topic]:
    """Transforms; in a bag they are always there, also where the graph cannot publish them."""
    yield Topic(TF_STATIC, "tf2_msgs/msg/TFMessage", 0)
    yield Topic(TF, "tf2_msgs/msg/TFMessage")


@dataclass(frozen=True, slots=True)
class TopicFilter:
    """Which topics are recorded: those that one of some patterns fits and none of some others, as in a shell."""

    include: Sequence[str] = ("*",)
    exclude: Sequence[str] = ()

    def __contains__(self, name: object) -> bool:
        return name in REPLAYED or (self._any(name, self.include) and not self._any(name, self.exclude))

    @staticmethod
    def _any(name: object, patterns: Sequence[str]) -> bool:
        return any(fnmatchcase(str(name), pattern) for pattern in patterns)


def manifest(spec: SceneSpec, *, compressed_images: bool) -> tuple[Topic, ...]:
    """Every topic that a scene's bag can have, in the order in which a tick is written."""
    return (
        *world_topics(spec),
        *transform_topics(),
        *sensor_topics(spec, compressed_images=compressed_images),
        *annotation_topics(spec),
    )
