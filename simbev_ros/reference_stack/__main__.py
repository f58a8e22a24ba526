"""Runs the stack until Ctrl-C: ``python -m simbev_ros.reference_stack``, next to ``simbev run live --live``."""

import sys

import rclpy
import rclpy.utilities
from rclpy.executors import ExternalShutdownException

from simbev_ros.reference_stack.node import ReferenceStack
from simbev_ros.reference_stack.scene import NoLidarError


def main() -> None:
    """Run the node until SIGINT or SIGTERM."""
    rclpy.init()
    node = ReferenceStack()
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    except NoLidarError as error:
        sys.exit(f"error: {error}")
    finally:
        node.destroy_node()
        rclpy.utilities.try_shutdown()


if __name__ == "__main__":
    main()
