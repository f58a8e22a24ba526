"""Messages in one form: equal messages become equal bytes.

CDR aligns numbers, and middleware leaves in the gaps whatever its memory held before.
"""

from rosbags.typesys import Stores, get_typestore

_TYPES = get_typestore(Stores.ROS2_JAZZY)


def canonical(payload: bytes, type_name: str) -> memoryview:
    """A message in little-endian CDR, with zeros in all gaps; it shares no memory with the one given."""
    return _TYPES.serialize_cdr(_TYPES.deserialize_cdr(payload, type_name), type_name)
