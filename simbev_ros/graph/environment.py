"""The environment that every process of the graph runs in, and the graph's own process too."""

import os
from pathlib import Path

import rclpy
from rclpy.utilities import get_rmw_implementation_identifier

from simbev_ros.config.paths import shipped_config_dir


def graph_environment(domain: int) -> dict[str, str]:
    """Variables to set for ROS before rclpy starts; what the user has set already stays, except the domain.

    Discovery stays on this host unless ``ROS_AUTOMATIC_DISCOVERY_RANGE`` says otherwise.
    """
    defaults = {
        "OPENBLAS_NUM_THREADS": "1",  # its threads spin while others want the cores; our products are small
        "FASTRTPS_DEFAULT_PROFILES_FILE": str(shipped_config_dir() / "fastdds.xml"),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "RCUTILS_COLORIZED_OUTPUT": "0",
    }
    kept = {name: os.environ.get(name, value) for name, value in defaults.items()}
    return {**kept, "ROS_DOMAIN_ID": str(domain), "PYTHONHASHSEED": "0", "PYTHONUNBUFFERED": "1"}


def describe_ros() -> str:
    """The middleware, and where rclpy comes from.

    Raises:
        ImportError: ROS is not installed, or its middleware cannot be loaded.
    """
    return f"{get_rmw_implementation_identifier()} ({Path(rclpy.__file__).parent})"
