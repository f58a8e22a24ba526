"""Canonical serialization, in which equal messages are equal bytes.

CDR aligns numbers with padding bytes, which middleware leaves with whatever its memory held before.
"""

from rosbags.serde import SerdeError

from simbev_ros.schema.messages.message_types import types_with


def canonical_cdr(payload: bytes, type_name: str) -> memoryview:
    """A serialized message as little-endian CDR with zeros as padding; it shares no memory with ``payload``.

    Raises:
        ValueError: The bytes are not a message of this type.
    """
    types = types_with(type_name)
    try:
        return types.serialize_cdr(types.deserialize_cdr(payload, type_name), type_name)
    except SerdeError as error:
        raise ValueError(str(error)) from None


def text_of_string(message: memoryview) -> memoryview:
    """The text, in UTF-8, of a canonical std_msgs/msg/String; a part of its memory."""
    start = 8  # after the encapsulation and the length, which counts the zero at the end
    return message[start : start + int.from_bytes(message[4:start], "little") - 1]
