"""Serialized ROS messages, made without ROS by rosbags."""

from typing import Any

import numpy as np
from rosbags.typesys import Stores, get_typestore

from simbev_ros.foundation.geometry.transforms import quaternion_from_rpy
from simbev_ros.foundation.types import AnyArray, Float64Array, Table
from simbev_ros.recording import image_codecs

TYPES = get_typestore(Stores.ROS2_JAZZY)
_POINT_FIELD_TYPES = {"i1": 1, "u1": 2, "i2": 3, "u2": 4, "i4": 5, "u4": 6, "f4": 7, "f8": 8}


def serialize(type_name: str, **fields: Any) -> bytes:
    return bytes(TYPES.serialize_cdr(message(type_name, **fields), type_name))


def message(type_name: str, **fields: Any) -> Any:
    return TYPES.types[type_name](**fields)


def header(stamp_ns: int, frame_id: str = "map") -> Any:
    seconds, nanoseconds = divmod(stamp_ns, 10**9)
    stamp = message("builtin_interfaces/msg/Time", sec=seconds, nanosec=nanoseconds)
    return message("std_msgs/msg/Header", stamp=stamp, frame_id=frame_id)


def string(text: str) -> bytes:
    return serialize("std_msgs/msg/String", data=text)


def image(stamp_ns: int, encoding: str, array: AnyArray) -> bytes:
    return serialize(
        "sensor_msgs/msg/Image",
        header=header(stamp_ns),
        height=array.shape[0],
        width=array.shape[1],
        encoding=encoding,
        is_bigendian=0,
        step=array.nbytes // array.shape[0],
        data=np.frombuffer(array.tobytes(), np.uint8),
    )


def compressed_image(stamp_ns: int, encoding: str, array: AnyArray) -> bytes:
    return serialize(
        "sensor_msgs/msg/CompressedImage",
        header=header(stamp_ns),
        format=image_codecs.compressed_format(encoding),
        data=np.frombuffer(image_codecs.encode_image(encoding, array), np.uint8),
    )


def odometry(
    stamp_ns: int,
    xyz_m: Float64Array,
    rpy_rad: Float64Array,
    velocity_mps: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> bytes:
    """Odometry message of an ego, by default at rest."""
    place, turn = np.asarray(xyz_m, float).tolist(), quaternion_from_rpy(rpy_rad).tolist()
    pose = message(
        "geometry_msgs/msg/Pose",
        position=message("geometry_msgs/msg/Point", **dict(zip("xyz", place, strict=True))),
        orientation=message("geometry_msgs/msg/Quaternion", **dict(zip("xyzw", turn, strict=True))),
    )
    linear = message("geometry_msgs/msg/Vector3", **dict(zip("xyz", velocity_mps, strict=True)))
    angular = message("geometry_msgs/msg/Vector3", x=0.0, y=0.0, z=0.0)
    twist = message("geometry_msgs/msg/Twist", linear=linear, angular=angular)
    return serialize(
        "nav_msgs/msg/Odometry",
        header=header(stamp_ns),
        child_frame_id="ego/base_link",
        pose=message("geometry_msgs/msg/PoseWithCovariance", pose=pose, covariance=np.zeros(36)),
        twist=message("geometry_msgs/msg/TwistWithCovariance", twist=twist, covariance=np.zeros(36)),
    )


def point_cloud(stamp_ns: int, table: Table) -> bytes:
    assert table.dtype.fields is not None
    fields = [
        message(
            "sensor_msgs/msg/PointField",
            name=name,
            offset=entry[1],
            datatype=_POINT_FIELD_TYPES[entry[0].str[1:]],
            count=1,
        )
        for name, entry in table.dtype.fields.items()
    ]
    return serialize(
        "sensor_msgs/msg/PointCloud2",
        header=header(stamp_ns),
        height=1,
        width=len(table),
        fields=fields,
        is_bigendian=False,
        point_step=table.dtype.itemsize,
        row_step=table.nbytes,
        data=np.frombuffer(table.tobytes(), np.uint8),
        is_dense=True,
    )
