"""The manifest has the topics of every kind of sensor, and those that the annotator sends and reads."""

import pytest
from made_up_scene import made_up_spec

from simbev_ros.config.rig import SENSOR_KINDS
from simbev_ros.recording.compressed_clouds import COMPRESSED_CLOUD
from simbev_ros.recording.video import VIDEO_TYPE
from simbev_ros.ros.msgs.annotation_topics import annotator_inputs
from simbev_ros.ros.msgs.sensor_topics import sensor_topics, topics_of_sensor
from simbev_ros.ros.msgs.topics import manifest
from simbev_ros.schema.scene.agents import agent_view

RIG = [
    {"type": "camera", "name": "cam", "modalities": ["rgb", "instance", "depth"], "rate_hz": 10},
    {"type": "lidar", "name": "both"},
    {"type": "lidar", "name": "undisturbed", "points": False, "rate_hz": 5},
    {"type": "radar", "name": "radar"},
    {"type": "gnss", "name": "gnss", "rate_hz": 1},
    {"type": "imu", "name": "imu", "rate_hz": 100},
    {"type": "odometry", "name": "wheel", "rate_hz": 10},
    {"type": "gnss", "name": "moving", "rate_hz": 4, "velocity": {}, "extended_fix": True},
]
SENSED = {
    "cam/camera_info": ("CameraInfo", 2, 1),
    "cam/rgb/image_raw/compressed": ("CompressedImage", 2, 1),
    "cam/rgb/camera_info": ("CameraInfo", 2, 1),
    "cam/instance/image_raw/compressed": ("CompressedImage", 2, 1),
    "cam/instance/camera_info": ("CameraInfo", 2, 1),
    "cam/depth/image_raw/compressedDepth": ("CompressedImage", 2, 1),
    "cam/depth/camera_info": ("CameraInfo", 2, 1),
    "both/points": ("PointCloud2", 1, 1),
    "both/semantic_points": ("PointCloud2", 1, 1),
    "undisturbed/semantic_points": ("PointCloud2", 4, 1),
    "radar/points": ("PointCloud2", 1, 1),
    "gnss/fix": ("NavSatFix", 20, 1),
    "imu/data_raw": ("Imu", 1, 5),
    "imu/data": ("Imu", 1, 5),
    "wheel/odometry": ("Odometry", 2, 1),
    "moving/fix": ("NavSatFix", 5, 1),
    "moving/vel": ("TwistStamped", 5, 1),
    "moving/fix_velocity": ("TwistWithCovarianceStamped", 5, 1),
    "moving/extended_fix": ("GPSFix", 5, 1),
}
"""Topics below /ego: type, ticks between messages, messages per tick."""
PACKAGES = {
    "Odometry": "nav_msgs",
    "TwistStamped": "geometry_msgs",
    "TwistWithCovarianceStamped": "geometry_msgs",
    "GPSFix": "gps_msgs",
}
LABELS = {
    "bev/labels": 1, "bev/color": 1, "boxes": 1, "boxes/markers": 1, "hd_map": 1, "cam/boxes": 2, "occupancy/points": 10
}  # fmt: skip


@pytest.mark.parametrize("kind", SENSOR_KINDS)
def test_every_kind_has_topics(kind: str) -> None:
    spec = made_up_spec([{"type": kind, "name": "some"}])
    (sensor,) = spec.agents[0].rig.sensors
    topics = topics_of_sensor(agent_view(spec), sensor, compressed_images=True)
    assert topics and all(topic.name.startswith("/ego/some/") and topic.sensor for topic in topics)


def test_sensors_send_the_topics_of_the_table() -> None:
    topics = list(sensor_topics(agent_view(made_up_spec(RIG)), compressed_images=True))
    sensed = {
        f"/ego/{name}": (f"{PACKAGES.get(kind, 'sensor_msgs')}/msg/{kind}", *rest)
        for name, (kind, *rest) in SENSED.items()
    }
    assert {t.name: (t.type, t.period_ticks, t.messages_per_tick) for t in topics} == sensed
    assert [topic.name for topic in topics] == list(sensed)


def test_a_tick_is_written_in_the_order_world_transforms_motion_sensors_labels() -> None:
    topics = manifest(made_up_spec(RIG), compressed_images=True)
    names = [topic.name for topic in topics]
    assert names[:4] == ["/world/scene", "/world/map", "/world/legend", "/world/lights"]
    assert names[10:14] == ["/tf_static", "/tf", "/robot_description", "/ego/odom"]
    assert names[14:] == [f"/ego/{name}" for name in (*SENSED, *LABELS)]
    assert {t.name: t.period_ticks for t in topics[14 + len(SENSED) :]} == {f"/ego/{n}": p for n, p in LABELS.items()}


def test_compressed_clouds_are_recorded_and_annotated_in_place_of_others() -> None:
    spec = made_up_spec([{"type": "lidar", "name": "lidar", "rate_hz": 10, "compression": "zstd"}])
    topics = list(sensor_topics(agent_view(spec), compressed_images=True))
    assert [topic.name for topic in topics] == ["/ego/lidar/points/zstd", "/ego/lidar/semantic_points/zstd"]
    assert {(topic.type, topic.period_ticks, topic.sensor) for topic in topics} == {(COMPRESSED_CLOUD, 2, True)}
    assert annotator_inputs(agent_view(spec), compressed_images=True)["lidar"].name == "/ego/lidar/points/zstd"


@pytest.mark.parametrize("compressed", [True, False])
def test_the_annotator_reads_one_cloud_per_lidar_and_radar_and_the_instances_of_each_camera(
    compressed: bool,
) -> None:
    read = annotator_inputs(agent_view(made_up_spec(RIG)), compressed_images=compressed)
    assert {sensor: topic.name for sensor, topic in read.items()} == {
        "cam": f"/ego/cam/instance/image_raw{'/compressed' * compressed}",
        "both": "/ego/both/points",
        "undisturbed": "/ego/undisturbed/semantic_points",
        "radar": "/ego/radar/points",
    }


def test_a_video_is_recorded_in_place_of_jpeg_and_only_if_images_are_compressed() -> None:
    view = agent_view(made_up_spec([{"type": "camera", "name": "cam", "modalities": ["rgb"], "video": "h264"}]))
    compressed, raw = ({t.name: t.type for t in sensor_topics(view, compressed_images=form)} for form in (True, False))
    assert compressed.pop("/ego/cam/rgb/video") == VIDEO_TYPE
    assert [*compressed] == ["/ego/cam/camera_info", "/ego/cam/rgb/camera_info"]
    assert [*raw] == ["/ego/cam/camera_info", "/ego/cam/rgb/image_raw", "/ego/cam/rgb/camera_info"]


def test_a_camera_without_video_is_specified_as_before() -> None:
    (camera,) = agent_view(made_up_spec([{"type": "camera", "name": "cam"}])).rig.sensors
    assert "video" not in camera.model_dump()
