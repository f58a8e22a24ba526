"""A running graph answers ROS's own tools: ros2 param dump, rqt_console, nodes that start while the world is paused."""

from collections.abc import Sequence
from typing import Any

import pytest
from commands import Command
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from nav_msgs.msg import Odometry
from nav_msgs.msg import Path as Path_
from rcl_interfaces.msg import Log, ParameterType
from rcl_interfaces.srv import DescribeParameters, GetParameters, ListParameters
from rclpy.qos import DurabilityPolicy, QoSProfile
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import PointCloud2
from subscriber import Caller, clock_ns, keep, outside_node

pytestmark = pytest.mark.graph

ROSOUT = QoSProfile(depth=1000, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""Profile of /rosout, as rqt_console has it."""


def stamp_ns(message: Any) -> int:
    return int(message.header.stamp.sec * 10**9 + message.header.stamp.nanosec)


def check_parameters(caller: Caller) -> None:
    """Every parameter has a value and a description; time comes with the messages, not from /clock."""
    for name in ("/world", "/ego/camera", "/ego/lidar", "/ego/gnss", "/ego/imu", "/ego/annotator"):
        names = caller.call(ListParameters, f"{name}/list_parameters", ListParameters.Request()).result.names
        assert {"live", "use_sim_time"} <= set(names)
        values = caller.call(GetParameters, f"{name}/get_parameters", GetParameters.Request(names=names)).values
        assert len(values) == len(names)
        assert ParameterType.PARAMETER_NOT_SET not in {value.type for value in values}
        assert dict(zip(names, values, strict=True))["use_sim_time"].bool_value is False
        request = DescribeParameters.Request(names=[each for each in names if each not in OF_RCLPY])
        described = caller.call(DescribeParameters, f"{name}/describe_parameters", request).descriptors
        assert all(each.description and each.read_only for each in described)


def check_diagnostics(arrays: Sequence[DiagnosticArray]) -> None:
    """Names, ids, stamps and values are those that diagnostic_updater would write, and an analyzer takes each one."""
    statuses = {status.name: status for array in arrays for status in array.status}
    nodes = ("world", "ego/camera", "ego/lidar", "ego/gnss", "ego/imu", "ego/annotator")
    assert statuses.keys() == {f"{node}: {task}" for node in nodes for task in ("load", "Frequency Status")}
    assert all(status.name.startswith(f"{status.hardware_id}: ") for status in statuses.values())
    assert max(array.header.stamp.sec for array in arrays) >= 3600  # simulated time: scenes have an hour each
    frequency = {each.key: float(each.value) for each in statuses["ego/lidar: Frequency Status"].values}
    assert frequency["Actual frequency (Hz)"] == pytest.approx(
        frequency["Events in window"] / frequency["Duration of window (s)"], rel=0.01
    )
    assert {status.level for name, status in statuses.items() if name.endswith(": load")} == {DiagnosticStatus.OK}


def test_a_live_graph_answers_tools_and_says_that_time_jumps_back_before_it_does(graph: Command) -> None:
    logged: list[Log] = []
    clocks: list[Clock] = []
    diagnostics: list[DiagnosticArray] = []
    seen: list[tuple[str, int]] = []
    with outside_node("tools") as (node, spin_until):
        node.create_subscription(Log, "/rosout", keep(logged), ROSOUT)
        node.create_subscription(Clock, "/clock", keep(clocks), 1000)
        node.create_subscription(DiagnosticArray, "/diagnostics", keep(diagnostics), 1000)
        graph.wait_for(lambda: len(clocks) > 10, spin_until)
        caller = Caller(node, spin_until)
        check_parameters(caller)
        diagnostics.clear()
        spin_until(lambda: len({status.name for array in diagnostics for status in array.status}) >= 12)
        check_diagnostics(diagnostics)

        node.create_subscription(Clock, "/clock", lambda each: seen.append(("clock", clock_ns(each))), 1000)
        node.create_subscription(Odometry, "/ego/odom", lambda each: seen.append(("odom", stamp_ns(each))), 1000)
        node.create_subscription(PointCloud2, "/ego/boxes", lambda each: seen.append(("boxes", stamp_ns(each))), 1000)
        paths: list[Path_] = []
        node.create_subscription(Path_, "/ego/path", keep(paths), 1000)
        spin_until(lambda: {"clock", "odom", "boxes"} == {name for name, _ in seen} and bool(paths))
        before_ns, length = seen[-1][1], len(paths[-1].poses)
        assert caller.trigger("/world/reset").success
        start_ns = before_ns - before_ns % (3600 * 10**9)
        spin_until(lambda: seen[-1] == ("boxes", seen[-1][1]) and seen[-1][1] < before_ns)
        earlier = [name for name, stamp in seen if start_ns <= stamp < before_ns - 10**9]
        assert earlier[0] == "clock" and length > len(paths[-1].poses) >= 1
        expected = {
            ("world", "scene Blocks-0000 is loaded"),
            ("ego.lidar", "scene Blocks-0000 is loaded"),
            ("world", "scene Blocks-0000 starts: 6000 ticks"),
            ("world", "scene Blocks-0000 starts again"),
        }
        spin_until(lambda: expected <= {(each.name, each.msg) for each in logged})
    assert len(logged) < 30


OF_RCLPY = ("use_sim_time", "start_type_description_service")
"""Parameters that rclpy declares for every node, without a description."""
