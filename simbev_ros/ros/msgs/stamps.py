"""Converts between integer nanoseconds and builtin_interfaces/Time, and reads the stamp of a serialized message."""

import struct

from builtin_interfaces.msg import Time
from std_msgs.msg import Header

from simbev_ros.foundation.files.structured_text import parse_json
from simbev_ros.foundation.units import NS_PER_S


def time_message(stamp_ns: int) -> Time:
    """Time message from integer nanoseconds."""
    return Time(sec=stamp_ns // NS_PER_S, nanosec=stamp_ns % NS_PER_S)


def header(stamp_ns: int, frame: str) -> Header:
    """Header message from integer nanoseconds and a frame name."""
    return Header(stamp=time_message(stamp_ns), frame_id=frame)


def stamp_of(time: Time) -> int:
    """Integer nanoseconds from a Time message."""
    return int(time.sec) * NS_PER_S + int(time.nanosec)


def serialized_stamp_ns(payload: bytes | memoryview, type_name: str) -> int | None:
    """Stamp of a message in little-endian CDR, without deserializing it.

    Messages that begin with a Header or a Time have the stamp after the 4 bytes of encapsulation, arrays of such
    messages after their length, and our JSON strings in ``stamp_ns``.

    Args:
        payload: The serialized message.
        type_name: Its type, such as ``sensor_msgs/msg/Image``.

    Returns:
        Nanoseconds, or None if the message has no stamp (a JSON string without ``stamp_ns``, an empty array).

    Raises:
        ValueError: The text is not a JSON object, or its ``stamp_ns`` is not a whole number.
        struct.error: The message ends too early.
    """
    if type_name == "std_msgs/msg/String":
        fields = parse_json(bytes(payload[8:]).rstrip(b"\0"))
        if not isinstance(fields, dict):
            raise ValueError("its text is not a JSON object")
        stamp_ns = fields.get("stamp_ns")
        if stamp_ns is not None and type(stamp_ns) is not int:
            raise ValueError(f"its stamp_ns is {stamp_ns!r:.60}; it must be a whole number")
        return stamp_ns
    offset = 4
    if type_name in ("visualization_msgs/msg/MarkerArray", "tf2_msgs/msg/TFMessage"):
        if struct.unpack_from("<I", payload, 4)[0] == 0:
            return None
        offset = 8
    seconds, nanoseconds = struct.unpack_from("<iI", payload, offset)
    return int(seconds) * NS_PER_S + int(nanoseconds)
