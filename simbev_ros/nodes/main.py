"""Runs one or several nodes in one process: ``python -m simbev_ros.nodes.main KIND:NAME … --ros-args …``."""

import ctypes
import importlib
import signal
import sys

import rclpy
from rclpy.experimental import EventsExecutor
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args

from simbev_ros.errors import SimbevError

KINDS = {
    "world": ("world_node", "WorldNode"),
    "camera": ("camera_node", "CameraNode"),
    "lidar": ("lidar_node", "LidarNode"),
    "gnss": ("gnss_node", "GnssNode"),
    "imu": ("imu_node", "ImuNode"),
    "annotator": ("annotator_node", "AnnotatorNode"),
    "recorder": ("recorder_node", "RecorderNode"),
}
"""Kind of node → module and class. Imported on demand: a lidar process needs no OpenGL."""

_PR_SET_PDEATHSIG = 1


def main(arguments: list[str] | None = None) -> int:
    """Run nodes until SIGTERM or SIGINT; give the exit code."""
    arguments = sys.argv if arguments is None else arguments
    _end_with_parent()
    stop = _StopFlag()
    rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
    nodes = []
    try:
        for word in remove_ros_args(arguments)[1:]:
            kind, _, name = word.partition(":")
            module, node_class = KINDS[kind]
            nodes.append(getattr(importlib.import_module(f"simbev_ros.nodes.{module}"), node_class)(name or kind))
        executor = EventsExecutor()
        for node in nodes:
            executor.add_node(node)
        while not stop.requested:
            executor.spin_once(timeout_sec=0.1)
    except SimbevError as error:
        print(f"error: {error}", file=sys.stderr)
        return error.exit_code
    finally:
        for node in nodes:
            node.close()
            node.destroy_node()
        rclpy.shutdown()
    return 0


class _StopFlag:
    """Set by the first signal; the tick in progress is finished, then the nodes close what they have open."""

    def __init__(self) -> None:
        self.requested = False
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, self._set)

    def _set(self, *_: object) -> None:
        self.requested = True


def _end_with_parent() -> None:
    """Get SIGTERM from the kernel when the parent dies, whatever killed it."""
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)


if __name__ == "__main__":
    sys.exit(main())
