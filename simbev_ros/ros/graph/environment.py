"""The environment variables of all processes of a graph, including the supervising process."""

import os
from pathlib import Path

import rclpy
from rclpy.utilities import get_rmw_implementation_identifier

from simbev_ros.foundation.files.private_folder import substitute_home, writable_home
from simbev_ros.ros.graph.exposure import LOCAL, Exposure


def graph_environment(domain: int, exposure: Exposure = LOCAL) -> dict[str, str]:
    """Variables to set before rclpy starts; variables set by the user are kept, except for the domain.

    Args:
        domain: ROS domain.
        exposure: Who can take part in the graph.
    """
    defaults = {
        "OPENBLAS_NUM_THREADS": "1",  # its threads would spin on cores that other processes need
        "RCUTILS_COLORIZED_OUTPUT": "0",
    }
    kept = {name: os.environ.get(name, value) for name, value in defaults.items()}
    if writable_home() is None and not {"ROS_LOG_DIR", "ROS_HOME"} & os.environ.keys():
        kept["ROS_LOG_DIR"] = str(substitute_home() / ".ros" / "log")
    return {
        **kept,
        **subscriber_environment(exposure),
        "ROS_DOMAIN_ID": str(domain),
        "PYTHONHASHSEED": "0",
        "PYTHONUNBUFFERED": "1",
    }


def subscriber_environment(exposure: Exposure = LOCAL) -> dict[str, str]:
    """Variables with which other nodes find a graph and receive large messages.

    The user's own values are kept. Our profile does not count as one: ``simbev env`` may have set it for a graph
    of another exposure.

    Args:
        exposure: Who can take part in the graph.
    """
    defaults = {
        "FASTRTPS_DEFAULT_PROFILES_FILE": str(exposure.profile_file),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": exposure.discovery_range,
    }
    ours = [str(Exposure(network=network).profile_file) for network in (False, True)]
    if os.environ.get("FASTRTPS_DEFAULT_PROFILES_FILE") in ours:
        return defaults
    return {name: os.environ.get(name, value) for name, value in defaults.items()}


def describe_ros() -> str:
    """Describe the middleware and the location of rclpy in one line.

    Raises:
        ImportError: ROS is not installed, or its middleware cannot be loaded.
    """
    return f"{get_rmw_implementation_identifier()} ({Path(rclpy.__file__).parent})"
