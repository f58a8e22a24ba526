"""Serialized messages do not depend on the previous contents of memory."""

import pytest
from ros_messages import header, message, serialize

from simbev_ros.recording.canonical import canonical_cdr, text_of_string

POINT = "geometry_msgs/msg/PointStamped"


def test_padding_becomes_zeros_and_nothing_else_changes() -> None:
    clean = serialize(POINT, header=header(5, "a"), point=message("geometry_msgs/msg/Point", x=1.0, y=-2.0, z=3.5))
    gap = slice(18, 20)  # after 4 bytes of encapsulation, 8 of stamp, 4 of length and "a\0", before doubles
    assert clean[gap] == b"\0\0"
    dirty = clean[: gap.start] + b"\xaa\x55" + clean[gap.stop :]
    assert canonical_cdr(dirty, POINT) == clean


@pytest.mark.parametrize("text", ["", "a", "Straße", "x" * 1000])
def test_the_text_of_a_string_is_found_in_its_bytes(text: str) -> None:
    payload = canonical_cdr(serialize("std_msgs/msg/String", data=text), "std_msgs/msg/String")
    assert bytes(text_of_string(payload)) == text.encode()
