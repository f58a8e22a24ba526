"""Runs the stack until Ctrl-C: ``python -m simbev_ros.baselines.node lidar [FILE]``, next to ``simbev run``."""

import argparse
import sys
from pathlib import Path

import rclpy
import rclpy.utilities
from rclpy.executors import ExternalShutdownException

from simbev_ros.baselines.modality import Modality
from simbev_ros.baselines.model_file import load_baseline
from simbev_ros.baselines.node.node import BaselineNode
from simbev_ros.foundation.errors import InputError
from simbev_ros.ros.conventions.arguments import split_ros_arguments
from simbev_ros.ros.nodes.lifeline import ending_middleware
from simbev_ros.ros.nodes.main import ERROR_MARK


def main() -> int:
    """Run the node until SIGINT or SIGTERM; return the exit code."""
    own, of_ros = split_ros_arguments(sys.argv[1:])
    options = _parser().parse_args(own)
    node: BaselineNode | None = None
    code = 1
    try:
        baseline = load_baseline(Modality(options.modality), options.weights)
        rclpy.init(args=["--ros-args", *of_ros])
        node = BaselineNode(baseline, tracks=options.track)
        rclpy.spin(node)
        code = 0
    except (KeyboardInterrupt, ExternalShutdownException):
        code = 0
    except InputError as error:
        print(f"{ERROR_MARK}{error}", file=sys.stderr)
        code = error.exit_code
    finally:
        if node is not None:
            node.close()
        with ending_middleware(code):
            if node is not None:
                node.destroy_node()
            rclpy.utilities.try_shutdown()
    return code


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m simbev_ros.baselines.node",
        description="Answers the frames of a running graph with a trained baseline.",
        epilog="What follows --ros-args goes to ROS: remapping, and the parameters agent, lidar_topic and live.",
    )
    parser.add_argument("modality", choices=[each.value for each in Modality], help="what the baseline sees")
    parser.add_argument(
        "weights", nargs="?", type=Path, help="ONNX file that simbev train wrote; default: the weights in the package"
    )
    parser.add_argument("--track", action="store_true", help="track the boxes: they get ids")
    return parser


if __name__ == "__main__":
    sys.exit(main())
