"""The environment variables of all processes of a graph, including the supervising process."""

import os
from pathlib import Path

import rclpy
from rclpy.utilities import get_rmw_implementation_identifier

from simbev_ros.foundation.files.private_folder import substitute_home, writable_home
from simbev_ros.foundation.installation.arithmetic import rounding_variables
from simbev_ros.ros.graph.exposure import LOCAL, Exposure

_LOG_FORMAT = {
    "RCUTILS_COLORIZED_OUTPUT": "0",
    "RCUTILS_CONSOLE_OUTPUT_FORMAT": "[{severity}] [{time}] [{name}]: {message}",
    "RCUTILS_LOGGING_BUFFERED_STREAM": "0",
    "RCUTILS_LOGGING_USE_STDOUT": "0",
}
"""The form of logs in which the graph looks for warnings."""


def graph_environment(domain: int, exposure: Exposure = LOCAL) -> dict[str, str]:
    """Variables to set before rclpy starts; some that the user may have set for a purpose are kept.

    Args:
        domain: ROS domain.
        exposure: Who can take part in the graph.
    """
    # OpenBLAS's threads would spin on cores that other processes need.
    kept = {"OPENBLAS_NUM_THREADS": os.environ.get("OPENBLAS_NUM_THREADS", "1")}
    if writable_home() is None and not {"ROS_LOG_DIR", "ROS_HOME"} & os.environ.keys():
        kept["ROS_LOG_DIR"] = str(substitute_home() / ".ros" / "log")
    return {
        **kept,
        **rounding_variables(os.environ),
        **subscriber_environment(exposure),
        **_LOG_FORMAT,
        "ROS_DOMAIN_ID": str(domain),
        "PYTHONHASHSEED": "0",
        "PYTHONUNBUFFERED": "1",
    }


def subscriber_environment(exposure: Exposure = LOCAL) -> dict[str, str]:
    """Variables with which other nodes find a graph and receive large messages.

    The user's own values are kept. Ours do not count as such: ``simbev env`` may have set them for a graph of another
    exposure.

    Args:
        exposure: Who can take part in the graph.
    """
    others = Exposure(network=not exposure.network).variables
    kept = {name: value for name in others if (value := os.environ.get(name, "")) not in ("", others[name])}
    return {name: value for name, value in {**exposure.variables, **kept}.items() if value or name in os.environ}


def describe_ros() -> str:
    """Describe the middleware and the location of rclpy in one line.

    Raises:
        ImportError: ROS is not installed, or its middleware cannot be loaded.
    """
    return f"{get_rmw_implementation_identifier()} ({Path(rclpy.__file__).parent})"
