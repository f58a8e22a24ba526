"""Runs a driver until Ctrl-C: ``python -m simbev_ros.baselines.driving truth``, next to ``simbev run``."""

import argparse
import sys

from rclpy.node import Node

from simbev_ros.baselines.driving.drivers import DriverKind
from simbev_ros.baselines.driving.node import RouteDriverNode
from simbev_ros.ros.conventions.arguments import split_ros_arguments
from simbev_ros.ros.relays.running import run


def main() -> int:
    """Run the node until SIGINT or SIGTERM; return the exit code."""
    own, _ = split_ros_arguments(sys.argv[1:])
    parser = argparse.ArgumentParser(prog="python -m simbev_ros.baselines.driving", description="Drives a route.")
    parser.add_argument("driver", choices=[each.value for each in DriverKind], help="what drives")
    parser.add_argument("--agent", default="ego", help="name of the agent that is driven")
    options = parser.parse_args(own)

    def make_node() -> Node:
        node = Node(f"{options.agent}_driver")
        RouteDriverNode(node, DriverKind(options.driver), options.agent)
        return node

    run(make_node)
    return 0


if __name__ == "__main__":
    sys.exit(main())
