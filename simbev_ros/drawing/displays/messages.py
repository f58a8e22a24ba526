"""Builds and serializes messages without ROS; several times faster than rclpy does.

Their types are those of ROS 2 Jazzy, of vision_msgs and of this project.
"""

from functools import lru_cache
from typing import Any

import numpy as np
from rosbags.interfaces import Nodetype

from simbev_ros.foundation.types import AnyArray, Float64Array
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.schema.messages.message_types import types_with

MAP_FRAME = "map"
MARKERS = "visualization_msgs/msg/MarkerArray"
IMAGE_MARKER = "visualization_msgs/msg/ImageMarker"
PATH = "nav_msgs/msg/Path"
GRID = "nav_msgs/msg/OccupancyGrid"
IMAGE = "sensor_msgs/msg/Image"
CLOUD = "sensor_msgs/msg/PointCloud2"
COMPRESSED_IMAGE = "sensor_msgs/msg/CompressedImage"
DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"

_ZEROS: dict[str, Any] = {"string": "", "bool": False, "float32": 0.0, "float64": 0.0}


def build(type_name: str, **fields: Any) -> Any:
    """A message; fields that are not given have the defaults of ROS."""
    return types_with(type_name).types[type_name](**{**_defaults(type_name), **fields})


def serialize(message: Any) -> bytes:
    """A message as CDR with its encapsulation header."""
    return bytes(types_with(message.__msgtype__).serialize_cdr(message, message.__msgtype__))


def stamped(stamp_ns: int, frame: str) -> Any:
    """Header."""
    return build("std_msgs/msg/Header", stamp=moment(stamp_ns), frame_id=frame)


def moment(stamp_ns: int) -> Any:
    """Time."""
    return build("builtin_interfaces/msg/Time", sec=stamp_ns // NS_PER_S, nanosec=stamp_ns % NS_PER_S)


def points(positions: Float64Array) -> list[Any]:
    """Points from (N, 3)."""
    kind = types_with("geometry_msgs/msg/Point").types["geometry_msgs/msg/Point"]
    return [kind(x=x, y=y, z=z) for x, y, z in positions.tolist()]


def pose(position: list[float], xyzw: list[float]) -> Any:
    """Pose from x, y, z and a quaternion."""
    (x, y, z), (qx, qy, qz, qw) = position, xyzw
    return build(
        "geometry_msgs/msg/Pose",
        position=build("geometry_msgs/msg/Point", x=x, y=y, z=z),
        orientation=build("geometry_msgs/msg/Quaternion", x=qx, y=qy, z=qz, w=qw),
    )


def vector(x: float, y: float, z: float) -> Any:
    """Vector3."""
    return build("geometry_msgs/msg/Vector3", x=x, y=y, z=z)


@lru_cache(maxsize=512)
def color(rgb: tuple[int, int, int], alpha: float = 1.0) -> Any:
    """ColorRGBA from sRGB, 0..255."""
    red, green, blue = (channel / 255.0 for channel in rgb)
    return build("std_msgs/msg/ColorRGBA", r=red, g=green, b=blue, a=alpha)


def rgb_image(image: AnyArray, stamp_ns: int, frame: str) -> bytes:
    """Image message from (H, W, 3) uint8, RGB."""
    height, width = image.shape[:2]
    data = np.ascontiguousarray(image).reshape(-1)
    header = stamped(stamp_ns, frame)
    return serialize(
        build(IMAGE, header=header, height=height, width=width, encoding="rgb8", step=3 * width, data=data)
    )


@lru_cache
def _defaults(type_name: str) -> dict[str, Any]:
    """Default values of a type's fields; messages share those that are messages, which nobody changes."""
    return {name: _default(kind, of) for name, (kind, of) in types_with(type_name).fielddefs[type_name][1]}


def _default(kind: Nodetype, of: Any) -> Any:
    match kind:
        case Nodetype.BASE:
            return _ZEROS.get(of[0], 0)
        case Nodetype.NAME:
            return build(of, w=1.0) if of == "geometry_msgs/msg/Quaternion" else build(of)
        case _:
            (element_kind, element), length = of
            if element_kind is Nodetype.BASE and element[0] != "string":
                return np.zeros(length, element[0])
            return [_default(element_kind, element) for _ in range(length)]
