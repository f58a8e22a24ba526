"""Bags of small scenes with every kind of message, recorded without a graph."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from ros_messages import compressed_image, header, image, message, odometry, point_cloud, serialize, string
from scene_edits import ego

from simbev_ros.foundation.types import AnyArray, Table
from simbev_ros.recording.bag_writer import SceneBagWriter
from simbev_ros.recording.qos import QosProfile
from simbev_ros.schema.boxes import LIGHT_IDS, blank_boxes
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.weather import Weather
from simbev_ros.schema.trajectories import Tracks, tracks_to_npz

TICK_NS, TICKS = 50_000_000, 7
WIDTH, HEIGHT = 24, 16
LATCHED = QosProfile(durability="transient_local", depth=1)
POINT_DTYPE = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("intensity", "<f4"), ("ring", "<u2")])
IMAGES = {"rgb": "rgb8", "semantic": "mono8", "instance": "mono16", "depth": "32FC1", "flow": "32FC2"}
CAMERA = {"type": "camera", "name": "cam_front", "pose": {"x_m": 1.0, "z_m": 2.0, "yaw_deg": 90.0}}
SENSORS: Sequence[dict[str, Any]] = (
    {**CAMERA, "width_px": WIDTH, "height_px": HEIGHT, "fx_px": 20.0, "distortion": [0.01, 0, 0, 0, 0]},
    {"type": "camera", "name": "cam_slow", "width_px": WIDTH, "height_px": HEIGHT, "modalities": ["rgb"], "rate_hz": 5},
    {"type": "lidar", "name": "lidar", "pose": {"z_m": 1.8}},
    {"type": "gnss", "name": "gnss"},
    {"type": "imu", "name": "imu", "rate_hz": 80},
)
EGO = {"blueprint": "vehicle.sedan", "color": 0, "start": {"lane": "a", "s_m": 0}, "speed_factor": 1, "min_gap_m": 1}


def spec(number: int = 0, split: str = "train", sensors: Sequence[dict[str, Any]] = SENSORS) -> SceneSpec:
    return SceneSpec.model_validate(
        {
            "number": number,
            "split": split,
            "seed": number,
            "map": {"name": "Blocks"},
            "tick_ns": TICK_NS,
            "warm_up_ticks": 1,
            "ticks": TICKS,
            "weather": dict.fromkeys(Weather.model_fields, 1.0),
            "agents": [ego(sensors)],
            "vehicles": [EGO],
            "pedestrians": [],
            "green_time_s": [],
        }
    )


def pixels(encoding: str, tick: int, seed: int = 0) -> AnyArray:
    rng = np.random.default_rng([seed, tick, *encoding.encode()])
    match encoding:
        case "rgb8":
            return rng.integers(0, 256, (HEIGHT, WIDTH, 3), np.uint8)
        case "mono8":
            return rng.integers(0, 29, (HEIGHT, WIDTH), np.uint8)
        case "mono16":
            return rng.integers(0, 65536, (HEIGHT, WIDTH), np.uint16)
        case "32FC1":
            depth_m = rng.uniform(2, 90, (HEIGHT, WIDTH)).astype(np.float32)
            depth_m[:3] = np.inf
            return depth_m
        case _:
            flow_px = rng.normal(0, 20, (HEIGHT, WIDTH, 2)).astype(np.float32)
            flow_px[:2] = np.nan
            return flow_px


def points(tick: int) -> Table:
    rng = np.random.default_rng(tick)
    table = np.zeros(20 + 3 * tick, POINT_DTYPE)
    for name in "xyz":
        table[name] = rng.normal(0, 10, len(table))
    table["ring"] = np.arange(len(table))
    return table


def boxes(tick: int) -> Table:
    """A car that drives along x at 10 m/s, and a traffic light."""
    table = blank_boxes(2)
    table["id"], table["x"], table["y"], table["z"] = [5, LIGHT_IDS + 1], [0.5 * tick, 3.0], [20.0, 30.0], 1.0
    return table


def tracks(scene: SceneSpec) -> Tracks:
    """Tracks of the ego and the car."""
    shape = 2, TICKS
    position_m = np.zeros((*shape, 3))
    position_m[1] = np.stack([0.5 * np.arange(TICKS), np.full(TICKS, 20.0), np.ones(TICKS)], axis=1)
    return Tracks(
        tick_ns=TICK_NS,
        stamp_ns=np.array([scene.stamp_ns(tick) for tick in range(TICKS)], np.int64),
        id=np.array([1, 5], np.uint32),
        box_class=np.zeros(2, np.uint8),
        size_m=np.ones((2, 3), np.float32),
        valid=np.ones(shape, np.bool_),
        position_m=position_m,
        yaw_rad=np.zeros(shape, np.float32),
        velocity_mps=np.zeros((*shape, 3), np.float32),
    )


def record(path: Path, scene: SceneSpec, *, seed: int = 0, only: Sequence[str] | None = None) -> Path:
    """Record the bag of a scene in many chunks, with all topics or only those that start with one of ``only``."""
    with SceneBagWriter(path, chunk_bytes=3000) as writer:
        writer.add_attachment("scene.json", "application/json", scene.model_dump_json().encode())
        writer.add_attachment("trajectories.npz", "application/zip", tracks_to_npz(tracks(scene)))
        known: set[str] = set()
        for tick in range(TICKS):
            for topic, type_name, stamp_ns, payload in _messages(scene, tick, seed):
                if only is None or topic.startswith(tuple(only)):
                    if topic not in known:
                        writer.add_topic(topic, type_name, LATCHED if topic in _LATCHED else QosProfile())
                        known.add(topic)
                    writer.write(topic, stamp_ns, payload)
        return writer.finish({"complete": "true", "ticks": str(TICKS)})


_LATCHED = ("/world/legend", "/tf_static")


def _messages(scene: SceneSpec, tick: int, seed: int) -> list[tuple[str, str, int, bytes]]:
    now_ns = scene.stamp_ns(tick)
    messages = []
    if tick == 0:
        messages.append(("/world/legend", "std_msgs/msg/String", now_ns, string(json.dumps({"box_classes": ["car"]}))))
        messages.append(
            ("/tf_static", "tf2_msgs/msg/TFMessage", now_ns, _transform(now_ns, "ego/base_link", "ego/lidar"))
        )
    messages.append(("/clock", "rosgraph_msgs/msg/Clock", now_ns, _clock(now_ns)))
    if tick in (2, 3):
        event = string(json.dumps({"type": "collision", "stamp_ns": now_ns}))
        messages += [("/world/events", "std_msgs/msg/String", now_ns, event)] * tick
    turn = np.array([0.0, 0.0, 0.1 * tick])
    messages.append(("/ego/odom", "nav_msgs/msg/Odometry", now_ns, odometry(now_ns, np.array([tick, 2.0, 0.5]), turn)))
    messages.append(("/tf", "tf2_msgs/msg/TFMessage", now_ns, _transform(now_ns, "map", "ego/base_link")))
    for modality, encoding in IMAGES.items():
        form = "compressedDepth" if modality == "depth" else "compressed"
        data = compressed_image(now_ns, encoding, pixels(encoding, tick, seed))
        topic = f"/ego/cam_front/{modality}/image_raw/{form}"
        messages.append((topic, "sensor_msgs/msg/CompressedImage", now_ns, data))
        info = f"/ego/cam_front/{modality}/camera_info"
        messages.append((info, "sensor_msgs/msg/CameraInfo", now_ns, _camera_info(now_ns)))
    if tick % 4 == 0:
        raw = image(now_ns, "rgb8", pixels("rgb8", tick, 9))
        messages.append(("/ego/cam_slow/rgb/image_raw", "sensor_msgs/msg/Image", now_ns, raw))
    messages.append(("/ego/lidar/points", "sensor_msgs/msg/PointCloud2", now_ns, point_cloud(now_ns, points(tick))))
    messages.append(("/ego/gnss/fix", "sensor_msgs/msg/NavSatFix", now_ns, _fix(now_ns, tick)))
    for part in range(-3 if tick else 0, 1):
        stamp_ns = now_ns + part * TICK_NS // 4
        messages.append(("/ego/imu/data_raw", "sensor_msgs/msg/Imu", stamp_ns, _imu(stamp_ns, tick + part / 4)))
    messages.append(
        ("/ego/bev/labels", "sensor_msgs/msg/Image", now_ns, image(now_ns, "mono16", pixels("mono16", tick)))
    )
    messages.append(("/ego/boxes", "sensor_msgs/msg/PointCloud2", now_ns, point_cloud(now_ns, boxes(tick))))
    return messages


def _clock(stamp_ns: int) -> bytes:
    return serialize("rosgraph_msgs/msg/Clock", clock=header(stamp_ns).stamp)


def _transform(stamp_ns: int, parent: str, child: str) -> bytes:
    transform = message(
        "geometry_msgs/msg/Transform",
        translation=message("geometry_msgs/msg/Vector3", x=1.0, y=2.0, z=3.0),
        rotation=message("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=1.0),
    )
    stamped = message(
        "geometry_msgs/msg/TransformStamped", header=header(stamp_ns, parent), child_frame_id=child, transform=transform
    )
    return serialize("tf2_msgs/msg/TFMessage", transforms=[stamped])


def _fix(stamp_ns: int, tick: int) -> bytes:
    return serialize(
        "sensor_msgs/msg/NavSatFix",
        header=header(stamp_ns),
        status=message("sensor_msgs/msg/NavSatStatus", status=0, service=1),
        latitude=48.0 + tick,
        longitude=9.0,
        altitude=300.0,
        position_covariance=np.arange(9.0),
        position_covariance_type=3,
    )


def _imu(stamp_ns: int, value: float) -> bytes:
    return serialize(
        "sensor_msgs/msg/Imu",
        header=header(stamp_ns),
        orientation=message("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=1.0),
        orientation_covariance=np.array([-1.0] + [0.0] * 8),
        angular_velocity=message("geometry_msgs/msg/Vector3", x=value, y=0.0, z=0.0),
        angular_velocity_covariance=np.zeros(9),
        linear_acceleration=message("geometry_msgs/msg/Vector3", x=0.0, y=value, z=9.81),
        linear_acceleration_covariance=np.zeros(9),
    )


def _camera_info(stamp_ns: int) -> bytes:
    roi = message("sensor_msgs/msg/RegionOfInterest", x_offset=0, y_offset=0, height=0, width=0, do_rectify=False)
    return serialize(
        "sensor_msgs/msg/CameraInfo",
        header=header(stamp_ns),
        height=HEIGHT,
        width=WIDTH,
        distortion_model="plumb_bob",
        d=np.array([0.01, 0, 0, 0, 0]),
        k=np.array([20.0, 0, 11.5, 0, 20.0, 7.5, 0, 0, 1]),
        r=np.eye(3).ravel(),
        p=np.arange(12.0),
        binning_x=0,
        binning_y=0,
        roi=roi,
    )
