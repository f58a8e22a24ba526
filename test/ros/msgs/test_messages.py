"""Messages carry arrays without loss, at the offsets that consumers expect."""

import json

import cv2
import numpy as np
import pytest
from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import Odometry
from rclpy.serialization import deserialize_message, serialize_message
from rosbags.typesys import Stores, get_typestore
from sensor_msgs.msg import CameraInfo, PointCloud2
from std_msgs.msg import String
from visualization_msgs.msg import Marker, MarkerArray

from simbev_ros.config.load import load_scenario
from simbev_ros.foundation.geometry.camera import LensCamera, PinholeCamera
from simbev_ros.foundation.geometry.fisheye import FisheyeCamera
from simbev_ros.maps.build import load_network
from simbev_ros.maps.hd_map import lane_record
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.ros.msgs.images import camera_info_message, image_message
from simbev_ros.ros.msgs.stamps import header, serialized_stamp_ns, stamp_of, time_message
from simbev_ros.ros.msgs.tables import message_from_table, table_from_cdr, table_from_message
from simbev_ros.ros.msgs.transforms import serialize_transforms, static_transforms
from simbev_ros.ros.msgs.world import odometry_message, record_message
from simbev_ros.scene.drawing.draw_scene import draw_scene, planned_scenes
from simbev_ros.schema.boxes import BOX_DTYPE
from simbev_ros.schema.points import POINT_DTYPE, RADAR_POINT_DTYPE, SEMANTIC_POINT_DTYPE
from simbev_ros.schema.scene.lights import STREET_LIGHT_DTYPE
from simbev_ros.schema.scene.map_spec import MapSpec
from simbev_ros.schema.scene.state import ACTOR_DTYPE, EGO_ID, SIGNAL_DTYPE

STAMP_NS = 7_204_050_000_001
TYPES = get_typestore(Stores.ROS2_JAZZY)


@pytest.mark.parametrize(
    "dtype",
    [ACTOR_DTYPE, SIGNAL_DTYPE, STREET_LIGHT_DTYPE, BOX_DTYPE, POINT_DTYPE, SEMANTIC_POINT_DTYPE, RADAR_POINT_DTYPE],
)
def test_tables_survive_serialization_and_their_fields_fit_into_point_step(dtype: np.dtype) -> None:
    table = np.frombuffer(np.random.default_rng(0).bytes(5 * dtype.itemsize), dtype)
    message = deserialize_message(serialize_message(message_from_table(table, STAMP_NS, "map")), PointCloud2)
    assert table_from_message(message).tobytes() == table.tobytes()
    assert message.row_step == message.point_step * message.width == len(message.data)
    ends = [field.offset + np.dtype(dtype[field.name]).itemsize for field in message.fields]
    assert max(ends) <= message.point_step
    assert stamp_of(message.header.stamp) == STAMP_NS


def test_lidar_points_have_the_velodyne_layout() -> None:
    fields = message_from_table(np.zeros(1, POINT_DTYPE), 0, "f").fields
    assert [(field.name, field.offset) for field in fields] == [
        ("x", 0), ("y", 4), ("z", 8), ("intensity", 12), ("ring", 16), ("time", 18)
    ]  # fmt: skip
    assert POINT_DTYPE.itemsize == 22


@pytest.mark.parametrize(
    ("shape", "dtype", "encoding"),
    [
        ((3, 5, 3), "u1", "rgb8"),
        ((3, 5), "u1", "mono8"),
        ((3, 5), "u2", "mono16"),
        ((3, 5), "f4", "32FC1"),
        ((3, 5, 2), "f4", "32FC2"),
    ],
)
def test_images_carry_their_bytes_and_encoding(shape: tuple[int, ...], dtype: str, encoding: str) -> None:
    image = np.arange(np.prod(shape)).reshape(shape).astype(dtype)
    message = image_message(image, STAMP_NS, "f")
    assert message.encoding == encoding
    assert (message.height, message.width, message.step) == (3, 5, image.nbytes // 3)
    assert np.frombuffer(message.data, dtype).tobytes() == image.tobytes()


def test_camera_info_projects_like_the_camera() -> None:
    camera = PinholeCamera(640, 480, 500.0, 510.0, 300.0, 250.0)
    info = camera_info_message(camera, 0, "f")
    point = np.array([1.0, -2.0, 8.0])
    projected = np.reshape(info.p, (3, 4)) @ [*point, 1.0]
    assert projected[:2] / projected[2] == pytest.approx(camera.project(point[None])[0])


def test_opencv_rectifies_and_projects_with_the_camera_info_of_a_lens() -> None:
    camera = LensCamera(640, 480, 500.0, 510.0, 300.0, 250.0, (-0.3, 0.1, 0.002, -0.001, -0.01))
    info = deserialize_message(serialize_message(camera_info_message(camera, 0, "f")), CameraInfo)
    assert (info.distortion_model, info.width, info.height) == ("plumb_bob", 640, 480)
    k, r, p = np.reshape(info.k, (3, 3)), np.reshape(info.r, (3, 3)), np.reshape(info.p, (3, 4))
    points = np.random.default_rng(0).uniform([-2, -2, 5], [2, 2, 9], (50, 3))
    raw, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), k, np.array(info.d))
    assert raw[:, 0] == pytest.approx(camera.project(points))
    rectified = cv2.undistortPoints(raw, k, np.array(info.d), R=r, P=p)[:, 0]
    projected = points @ p[:, :3].T + p[:, 3]
    assert rectified == pytest.approx(projected[:, :2] / projected[:, 2:], abs=0.01)


def test_opencv_rectifies_and_projects_with_the_camera_info_of_a_fisheye() -> None:
    camera = FisheyeCamera(640, 480, 180.0, 185.0, 300.0, 250.0, (0.02, -0.004, 0.001, 0.0), float(np.radians(98.0)))
    info = deserialize_message(serialize_message(camera_info_message(camera, 0, "f")), CameraInfo)
    assert (info.distortion_model, len(info.d)) == ("equidistant", 4)
    k, p = np.reshape(info.k, (3, 3)), np.reshape(info.p, (3, 4))
    points = np.random.default_rng(0).uniform([-9, -9, 1], [9, 9, 9], (50, 3))
    raw, _ = cv2.fisheye.projectPoints(points[:, None], np.zeros(3), np.zeros(3), k, np.array(info.d))
    assert raw[:, 0] == pytest.approx(camera.project(points))
    rectified = cv2.fisheye.undistortPoints(raw, k, np.array(info.d), R=np.eye(3), P=p)[:, 0]
    projected = points @ p[:, :3].T
    assert rectified == pytest.approx(projected[:, :2] / projected[:, 2:], rel=1e-4)
    read = FisheyeCamera(info.width, info.height, k[0, 0], k[1, 1], *k[:2, 2], tuple(info.d), camera.max_angle_rad)
    assert read == camera


@pytest.mark.parametrize("stamp_ns", [0, 1, 999_999_999, STAMP_NS])
def test_stamps_are_exact(stamp_ns: int) -> None:
    assert stamp_of(time_message(stamp_ns)) == stamp_ns


def test_stamp_is_read_from_serialized_messages_without_decoding() -> None:
    cloud = serialize_message(message_from_table(np.zeros(1, POINT_DTYPE), STAMP_NS, "f"))
    assert serialized_stamp_ns(cloud, "sensor_msgs/msg/PointCloud2") == STAMP_NS
    markers = MarkerArray(markers=[Marker(header=header(STAMP_NS, "map"))])
    assert serialized_stamp_ns(serialize_message(markers), "visualization_msgs/msg/MarkerArray") == STAMP_NS
    assert serialized_stamp_ns(serialize_message(MarkerArray()), "visualization_msgs/msg/MarkerArray") is None


def test_transforms_can_be_written_without_tf2_msgs() -> None:
    transform = TransformStamped(header=header(STAMP_NS, "map"), child_frame_id="ego/base_link")
    transform.transform.translation.y = 4.25
    message = TYPES.deserialize_cdr(serialize_transforms([transform, transform]), "tf2_msgs/msg/TFMessage")
    assert len(message.transforms) == 2
    second = message.transforms[1]
    assert (second.header.frame_id, second.child_frame_id, second.transform.translation.y) == (
        "map",
        "ego/base_link",
        4.25,
    )
    assert second.header.stamp.nanosec == STAMP_NS % 10**9


def test_odometry_has_its_twist_in_the_child_frame() -> None:
    actor = np.zeros((), ACTOR_DTYPE)
    actor["yaw"], actor["vy"], actor["x"] = np.pi / 2, 3.0, 10.0
    message = odometry_message(actor, STAMP_NS, "ego/base_link")
    assert isinstance(message, Odometry)
    assert message.twist.twist.linear.x == pytest.approx(3.0, abs=1e-6)
    assert message.twist.twist.linear.y == pytest.approx(0.0, abs=1e-6)
    assert message.pose.pose.position.x == 10.0


def test_every_sensor_is_a_child_of_base_link_and_cameras_have_an_optical_frame() -> None:
    scenario = load_scenario("demo")
    planned = next(planned_scenes(scenario))
    spec = draw_scene(scenario, planned, load_network(planned.map))
    parents = {transform.child_frame_id: transform.header.frame_id for transform in static_transforms(spec)}
    assert parents["ego/lidar"] == parents["ego/imu"] == parents["ego/cam_back"] == "ego/base_link"
    assert parents["ego/cam_back_optical"] == "ego/cam_back"
    back = next(transform for transform in static_transforms(spec) if transform.child_frame_id == "ego/cam_back")
    assert abs(back.transform.rotation.z) == pytest.approx(1.0), "it looks back"
    assert back.transform.translation.x == -1.0


def test_the_record_of_the_ego_lane_has_stamp_and_lane() -> None:
    network = load_network(MapSpec(name="Blocks"))
    strip = next(strip for strip in network.layout.strips if strip.kind is LaneKind.DRIVING and not strip.junction)
    before, after = strip.center_m[:2]
    row = np.zeros(1, ACTOR_DTYPE)
    row["id"], row["yaw"] = EGO_ID, np.arctan2(*(after - before)[1::-1])
    row["x"], row["y"], row["z"] = (before + after) / 2.0
    place_m = np.array([row["x"][0], row["y"][0], row["z"][0]])
    message = record_message(lane_record(network, place_m, float(row["yaw"][0])), STAMP_NS)
    assert serialized_stamp_ns(serialize_message(message), "std_msgs/msg/String") == STAMP_NS
    record = json.loads(message.data)
    assert (record["id"], record["lane_type"]) == (strip.lane, "Driving")
    assert record["transform"]["location"] == pytest.approx(((before + after) / 2.0).tolist(), abs=0.01)


def test_a_point_field_beyond_the_point_is_refused_wherever_it_is_said_to_be() -> None:
    message = message_from_table(np.zeros(2, SIGNAL_DTYPE), 1, "map")
    for offset in (SIGNAL_DTYPE.itemsize, 2**31 - 1, 2**32 - 1):  # numpy adds the size to it in 32 bits
        message.fields[2].offset = offset
        with pytest.raises(ValueError, match=f"'z' ends at byte {offset + 8} of a point of 45 bytes"):
            table_from_message(message)


def test_a_cloud_without_a_required_column_is_refused() -> None:
    payload = serialize_message(message_from_table(np.zeros(2, SIGNAL_DTYPE), 1, "map"))
    assert len(table_from_cdr(payload, ("x", "z"))) == 2
    with pytest.raises(ValueError, match="has no column time, ring"):
        table_from_cdr(payload, ("x", "time", "ring"))


@pytest.mark.parametrize("text", ["[1]", '{"stamp_ns": "now"}', '{"stamp_ns": 1.5}', "no JSON", "[" * 100_000])
def test_a_text_without_a_valid_stamp_is_refused(text: str) -> None:
    payload = serialize_message(String(data=text))
    with pytest.raises(ValueError, match=r"\w"):
        serialized_stamp_ns(payload, "std_msgs/msg/String")
