"""Message classes by the names of types, which strangers announce."""

import sys

import pytest

from simbev_ros.ros.msgs.message_types import is_installed, message_class


def test_a_class_is_found_by_the_name_of_its_type() -> None:
    assert message_class("sensor_msgs/msg/Image").__name__ == "Image"
    assert is_installed("std_msgs/msg/Header") and not is_installed("std_msgs/msg/None")


@pytest.mark.parametrize(
    "type_name",
    [
        "antigravity/msg/X",
        "this/msg/X",
        "numpy/msg/X",
        "simbev_ros/msg/X",
        "a.b/msg/X",
        "../msg/X",
        "X",
        "",
        "a/b/c/d",
        "std_msgs/srv/X",
    ],
)
def test_nothing_but_message_packages_is_imported(type_name: str) -> None:
    before = set(sys.modules)
    with pytest.raises(ModuleNotFoundError, match="No message package"):
        message_class(type_name)
    assert set(sys.modules) == before
