"""The environment variables of all processes of a graph, including the supervising process."""

import os
from pathlib import Path

import rclpy
from rclpy.utilities import get_rmw_implementation_identifier

from simbev_ros.config.paths import shipped_config_dir


def profile_file(*, network: bool) -> Path:
    """Settings of Fast DDS, for the graph and for its subscribers.

    Args:
        network: Whether other hosts may take part; otherwise no socket listens beyond the loopback interface.
    """
    return shipped_config_dir() / ("fastdds_network.xml" if network else "fastdds.xml")


def graph_environment(domain: int, *, network: bool = False) -> dict[str, str]:
    """Variables to set before rclpy starts; variables set by the user are kept, except for the domain.

    Args:
        domain: ROS domain.
        network: Whether other hosts may take part.
    """
    defaults = {
        "OPENBLAS_NUM_THREADS": "1",  # its threads would spin on cores that other processes need
        "FASTRTPS_DEFAULT_PROFILES_FILE": str(profile_file(network=network)),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET" if network else "LOCALHOST",
        "RCUTILS_COLORIZED_OUTPUT": "0",
    }
    kept = {name: os.environ.get(name, value) for name, value in defaults.items()}
    return {**kept, "ROS_DOMAIN_ID": str(domain), "PYTHONHASHSEED": "0", "PYTHONUNBUFFERED": "1"}


def describe_ros() -> str:
    """Describe the middleware and the location of rclpy in one line.

    Raises:
        ImportError: ROS is not installed, or its middleware cannot be loaded.
    """
    return f"{get_rmw_implementation_identifier()} ({Path(rclpy.__file__).parent})"
