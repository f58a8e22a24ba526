"""Definitions of ROS 2's own message types, as bags contain them."""

from functools import lru_cache
from typing import TYPE_CHECKING

from rosbags.typesys import Stores, get_typestore

if TYPE_CHECKING:
    from foxglove import Schema

_TYPES = get_typestore(Stores.ROS2_JAZZY)


def is_known(type_name: str) -> bool:
    """Whether a type is one of those that ROS 2 Jazzy ships."""
    return type_name in _TYPES.fielddefs


@lru_cache
def schema_of(type_name: str) -> "Schema":
    """Schema of a known type, such as ``sensor_msgs/msg/Image``."""
    import foxglove

    definition, _ = _TYPES.generate_msgdef(type_name, ros_version=2)
    return foxglove.Schema(name=type_name, encoding="ros2msg", data=definition.encode())


def begins_with_stamp(type_name: str) -> bool:
    """Whether the messages of a known type begin with a Header."""
    fields = _TYPES.fielddefs[type_name][1]
    return bool(fields) and fields[0][1][1] == "std_msgs/msg/Header"
