"""Entry point of a node process, with one or several nodes.

Usage: ``simbev_node KIND[:[AGENT/]NAME] … [--ros-args …]``
"""

import importlib
import os
import signal
import sys

import rclpy
from rclpy.executors import Executor, SingleThreadedExecutor
from rclpy.logging import get_logger
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import try_shutdown

from simbev_ros.config.rig import SENSOR_KINDS
from simbev_ros.foundation.errors import DISK_FULL, DiskError, InputError, SimbevError
from simbev_ros.foundation.process_limits import describe_shortage, message_with_limit
from simbev_ros.foundation.process_memory import keep_freed_memory
from simbev_ros.ros.conventions.arguments import RosArguments, split_ros_arguments
from simbev_ros.ros.conventions.names import NodeName
from simbev_ros.ros.nodes.graph_node import GraphNode
from simbev_ros.ros.nodes.lifeline import end_with_supervisor, ending_middleware

KINDS = ("world", *SENSOR_KINDS, "annotator", "joint", "v2x", "referee", "recorder", "evaluator")
"""Kinds of nodes; each kind of sensor has a node kind of the same name."""

USAGE = f"""\
Usage: simbev_node KIND[:[AGENT/]NAME] … [--ros-args …]

Run nodes of a graph in one process, until SIGINT or SIGTERM. simbev run starts them all.

Kinds: {", ".join(KINDS)}
Example: simbev_node lidar:ego/lidar radar:ego/radar --ros-args --params-file nodes.yaml -r __ns:=/sim1"""

ERROR_MARK = "error: "
"""Prefix of the output, up to its end, in which a process states why it ends."""

DISK_EXIT_CODE = os.EX_IOERR
"""Exit code of a process that ends because the disk is full, which a retry does not solve."""

SHORTAGE_EXIT_CODE = os.EX_OSERR
"""Exit code of a process that ends because memory, files or threads ran out."""


def main(arguments: list[str] | None = None) -> int:
    """Run nodes until SIGTERM or SIGINT; return the exit code."""
    own, of_ros = split_ros_arguments((sys.argv if arguments is None else arguments)[1:])
    if not own or {"-h", "--help"}.intersection(own):
        print(USAGE)
        return 0
    end_with_supervisor()
    stop = _StopFlag()
    nodes: list[GraphNode] = []
    code = 1
    try:
        ros = RosArguments.parse(of_ros)
        rclpy.init(args=ros.for_nodes, signal_handler_options=SignalHandlerOptions.NO)
        requested = [_requested_node(word, ros.namespace) for word in own]
        if any(kind.reuses_large_buffers for kind, _ in requested):
            keep_freed_memory()
        for kind, name in requested:
            nodes.append(kind(name))
        executor = make_executor(takes_message_info=any(node.takes_message_info for node in nodes))
        for node in nodes:
            executor.add_node(node)
        while not stop.requested:
            executor.spin_once(timeout_sec=0.1)
            for node in nodes:
                node.raise_failure()
        code = 0
    except SimbevError as error:
        print(f"{ERROR_MARK}{message_with_limit(error)}", file=sys.stderr)
        code = DISK_EXIT_CODE if isinstance(error, DiskError) else error.exit_code
    except Exception as error:
        if (problem := describe_shortage(error)) is None:
            raise
        print(f"{ERROR_MARK}{problem}", file=sys.stderr)
        code = DISK_EXIT_CODE if isinstance(error, OSError) and error.errno in DISK_FULL else SHORTAGE_EXIT_CODE
    finally:
        for node in nodes:
            node.close()
        with ending_middleware(code):
            for node in nodes:
                node.destroy_node()
            try_shutdown()
    return code


def _requested_node(word: str, namespace: str) -> tuple[type[GraphNode], NodeName]:
    """Class and name of a node requested as ``KIND:AGENT/NAME``, ``KIND:NAME`` or ``KIND``."""
    kind, _, name = word.partition(":")
    if kind not in KINDS:
        raise InputError(f"there is no node kind {kind!r}; allowed: {', '.join(KINDS)}")
    return node_class(kind), NodeName.parse(name or kind, namespace)


def node_class(kind: str) -> type[GraphNode]:
    """Import the class of a node kind: ``LidarNode`` in ``ros/nodes/lidar_node.py`` for ``lidar``.

    Only the modules of the requested kinds are imported: a lidar process needs no OpenGL.

    Raises:
        ModuleNotFoundError: The kind has no module.
        AttributeError: The module has no class of that name.
    """
    module = importlib.import_module(f"simbev_ros.ros.nodes.{kind}_node")
    name = "".join(part.capitalize() for part in kind.split("_"))
    return getattr(module, f"{name}Node")


def make_executor(*, takes_message_info: bool) -> Executor:
    """Make the events executor, which is faster per message, if rclpy has it and it can call the nodes' callbacks."""
    if takes_message_info:
        return SingleThreadedExecutor()
    try:
        from rclpy.experimental.events_executor import EventsExecutor
    except ImportError:  # ROS 2 Jazzy has it since rclpy 7.1.4 (April 2025)
        get_logger("simbev_ros").info("rclpy is older than 7.1.4, so the single-threaded executor runs the nodes")
        return SingleThreadedExecutor()
    return EventsExecutor()


class _StopFlag:
    """Set by SIGTERM or SIGINT; the tick in progress is completed, then the nodes are closed."""

    def __init__(self) -> None:
        self.requested = False
        for signal_number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(signal_number, self._set)

    def _set(self, *_: object) -> None:
        self.requested = True


if __name__ == "__main__":
    sys.exit(main())
