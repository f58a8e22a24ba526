"""Definitions of message types, as bags contain them."""

from functools import lru_cache
from typing import TYPE_CHECKING

from simbev_ros.recording.video import VIDEO_TYPE
from simbev_ros.schema.messages.message_types import message_definition, types_with

if TYPE_CHECKING:
    from foxglove import Schema


@lru_cache
def schema_of(type_name: str) -> "Schema":
    """Schema of a known type, such as ``sensor_msgs/msg/Image``."""
    import foxglove

    return foxglove.Schema(name=type_name, encoding="ros2msg", data=message_definition(type_name).encode())


def begins_with_stamp(type_name: str) -> bool:
    """Whether the messages of a known type begin with a Header or the time of a video's image."""
    fields = types_with(type_name).fielddefs[type_name][1]
    return bool(fields) and (fields[0][1][1] == "std_msgs/msg/Header" or type_name == VIDEO_TYPE)
