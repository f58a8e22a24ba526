"""Conversion of decoded ROS messages to numpy arrays and plain values, the values of a frame.

| message | value |
|---|---|
| Image, CompressedImage | (H, W) or (H, W, C) array: rgb, semantic uint8; instance uint16; depth, flow float32 |
| CompressedVideo | (H, W, 3) uint8 array, decoded with the images since the key frame |
| PointCloud2, CompressedPointCloud2 | (N,) structured array, one row per point, box, actor, signal or voxel |
| Actors, TrafficSignals, Boxes, Views, RadarScan | (N,) structured array, like that of the topic's table |
| Odometry, Imu, NavSatFix | (K,) structured array, a row each: ``ODOMETRY_DTYPE``, ``IMU_DTYPE``, ``FIX_DTYPE`` |
| CameraInfo | dict of ``width_px``, ``height_px``, ``distortion_model`` and the arrays ``d``, ``k``, ``r``, ``p`` |
| TFMessage | dict from (parent, child) to the (4, 4) transform parent from child |
| String | the parsed JSON, or the text if it is not JSON; for /world/events a list with all events of the tick |
| Clock | int, ns |
| others | the message as rosbags decodes it |
"""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from rosbags.serde import SerdeError

from simbev_ros.foundation.errors import FOREIGN_ERRORS, BagError
from simbev_ros.foundation.files.structured_text import parse_json
from simbev_ros.foundation.geometry.transforms import matrices_from_xyz_quaternion
from simbev_ros.foundation.types import AnyArray, Float64Array, Table
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.recording.arrays import image_array, point_array
from simbev_ros.recording.compressed_clouds import COMPRESSED_CLOUD
from simbev_ros.schema.messages.message_types import types_with
from simbev_ros.schema.messages.table_messages import TABLE_TYPES, table_of

ODOMETRY_TYPE = "nav_msgs/msg/Odometry"

ODOMETRY_DTYPE = np.dtype(
    [
        ("stamp_ns", "<i8"),
        ("position_m", "<f8", 3),  # origin of the ego frame, map frame, even if base_link is elsewhere
        ("orientation_xyzw", "<f8", 4),  # ego frame in the map frame
        ("velocity_mps", "<f8", 3),  # of that origin, ego frame
        ("angular_velocity_radps", "<f8", 3),  # ego frame
    ]
)
IMU_DTYPE = np.dtype(
    [
        ("stamp_ns", "<i8"),
        ("orientation_xyzw", "<f8", 4),  # sensor frame in the map frame; NaN in /imu/data_raw, which has none
        ("angular_velocity_radps", "<f8", 3),  # sensor frame
        ("acceleration_mps2", "<f8", 3),  # specific force, sensor frame: +g upward at rest
    ]
)
FIX_DTYPE = np.dtype(
    [
        ("stamp_ns", "<i8"),
        ("latitude_deg", "<f8"),
        ("longitude_deg", "<f8"),
        ("altitude_m", "<f8"),
        ("covariance_m2", "<f8", (3, 3)),  # east, north, up
    ]
)


def decode_message(type_name: str, payload: memoryview) -> Any:
    """Deserialize a message into an object with the fields of its ROS type.

    Raises:
        BagError: The bytes are not a message of this type, or the type is unknown.
    """
    try:
        return types_with(type_name).deserialize_cdr(payload, type_name)
    except (SerdeError, *FOREIGN_ERRORS) as error:
        raise BagError(f"no {type_name}: {error}") from None


def value_of(type_name: str, messages: Sequence[Any]) -> Any:
    """Value of the messages of one topic at one tick, as the table at the top of this module says.

    Args:
        type_name: ROS type.
        messages: At least one message; types that are not collected into rows give the value of the last one.

    Raises:
        BagError: A message's data do not match its description.
    """
    if type_name in _ROWS:
        dtype, row = _ROWS[type_name]
        return np.array([row(message) for message in messages], dtype)
    reader = _READERS.get(type_name)
    return messages[-1] if reader is None else reader(messages[-1])


def poses_from_odometry(rows: Table) -> Float64Array:
    """(…, 4, 4) poses map_from_ego of rows of ``ODOMETRY_DTYPE``."""
    return matrices_from_xyz_quaternion(rows["position_m"], rows["orientation_xyzw"])


def in_ego_frame(rows: Table, base_link_x_m: float) -> Table:
    """The ego's motion from that of its base_link.

    Args:
        rows: (K,) ``ODOMETRY_DTYPE`` of base_link.
        base_link_x_m: X of the origin of base_link in the ego frame.

    Returns:
        (K,) ``ODOMETRY_DTYPE`` of the ego frame.
    """
    if not base_link_x_m:
        return rows
    arm_m = np.array([-base_link_x_m, 0.0, 0.0])
    moved = rows.copy()
    moved["position_m"] += poses_from_odometry(rows)[..., :3, :3] @ arm_m
    moved["velocity_mps"] += np.cross(rows["angular_velocity_radps"], arm_m)
    return moved


def columns(table: Table, *names: str) -> np.ndarray[Any, Any]:
    """(N, K) array of K columns of an (N,) table, for example ``columns(frame["lidar/points"], "x", "y", "z")``."""
    return np.stack([table[name] for name in names], axis=1)


def _image(message: Any) -> AnyArray:
    """Array of an image message; never a view of a chunk, which it would keep in memory."""
    image = image_array(message)
    return image if image.flags.writeable else image.copy()


def _points(message: Any) -> Table:
    return point_array(message).copy()


def _camera_info(message: Any) -> dict[str, Any]:
    return {
        "width_px": message.width,
        "height_px": message.height,
        "distortion_model": message.distortion_model,
        "d": np.array(message.d),
        "k": np.array(message.k).reshape(3, 3),
        "r": np.array(message.r).reshape(3, 3),
        "p": np.array(message.p).reshape(3, 4),
    }


def _transforms(message: Any) -> dict[tuple[str, str], Float64Array]:
    return {
        (each.header.frame_id, each.child_frame_id): matrices_from_xyz_quaternion(
            np.array(_numbers(each.transform.translation, "xyz")), np.array(_numbers(each.transform.rotation, "xyzw"))
        )
        for each in message.transforms
    }


def _text(message: Any) -> Any:
    try:
        return parse_json(message.data)
    except ValueError:
        return message.data


def _nanoseconds(stamp: Any) -> int:
    return int(stamp.sec) * NS_PER_S + int(stamp.nanosec)


def _numbers(vector: Any, names: str) -> tuple[float, ...]:
    return tuple(getattr(vector, name) for name in names)


def _odometry_row(message: Any) -> tuple[Any, ...]:
    pose, twist = message.pose.pose, message.twist.twist
    return (
        _nanoseconds(message.header.stamp),
        _numbers(pose.position, "xyz"),
        _numbers(pose.orientation, "xyzw"),
        _numbers(twist.linear, "xyz"),
        _numbers(twist.angular, "xyz"),
    )


def _imu_row(message: Any) -> tuple[Any, ...]:
    is_oriented = message.orientation_covariance[0] >= 0
    return (
        _nanoseconds(message.header.stamp),
        _numbers(message.orientation, "xyzw") if is_oriented else (np.nan,) * 4,
        _numbers(message.angular_velocity, "xyz"),
        _numbers(message.linear_acceleration, "xyz"),
    )


def _fix_row(message: Any) -> tuple[Any, ...]:
    covariance = np.reshape(message.position_covariance, (3, 3))
    position = message.latitude, message.longitude, message.altitude
    return _nanoseconds(message.header.stamp), *position, covariance


_ROWS: dict[str, tuple[np.dtype[np.void], Callable[[Any], tuple[Any, ...]]]] = {
    ODOMETRY_TYPE: (ODOMETRY_DTYPE, _odometry_row),
    "sensor_msgs/msg/Imu": (IMU_DTYPE, _imu_row),
    "sensor_msgs/msg/NavSatFix": (FIX_DTYPE, _fix_row),
}
_READERS: dict[str, Callable[[Any], Any]] = {
    "sensor_msgs/msg/Image": _image,
    "sensor_msgs/msg/CompressedImage": _image,
    "sensor_msgs/msg/PointCloud2": _points,
    COMPRESSED_CLOUD: _points,
    "sensor_msgs/msg/CameraInfo": _camera_info,
    "tf2_msgs/msg/TFMessage": _transforms,
    "std_msgs/msg/String": _text,
    "rosgraph_msgs/msg/Clock": lambda message: _nanoseconds(message.clock),
    **{type_name: partial(table_of, type_name) for type_name in TABLE_TYPES},
}
