"""Which release of ROS 2 nodes run with, and what differs between releases."""

from functools import cache
from importlib import metadata

_FIRST_OF_KILTED = 9
"""Major version of rclpy since Kilted; that of Jazzy is 7."""


@cache
def is_jazzy() -> bool:
    """Whether the installed ROS 2 is Jazzy, as if none is; otherwise it is Kilted or newer."""
    versions = [each.version for each in metadata.distributions(name="rclpy")]
    return not versions or int(versions[0].partition(".")[0]) < _FIRST_OF_KILTED


def profile_variable() -> str:
    """Name of the variable with the file of Fast DDS's profiles."""
    return "FASTRTPS_DEFAULT_PROFILES_FILE" if is_jazzy() else "FASTDDS_DEFAULT_PROFILES_FILE"
