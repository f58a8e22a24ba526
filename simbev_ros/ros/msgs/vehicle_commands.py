"""Reads the stamped commands of outside drivers: message in, command of the vehicle model out."""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.ros.msgs.stamps import stamp_of
from simbev_ros.ros.msgs.world import MAP_FRAME
from simbev_ros.schema.messages.message_rows import message_constants
from simbev_ros.simulation.world.driving.commands import (
    AckermannCommand,
    DriverCommand,
    IndicatorsCommand,
    TrajectoryCommand,
)

_BITS = message_constants("IndicatorsCommand")


class CommandKind(NamedTuple):
    """Last part of the topic of a kind of command, its type, and the function that reads a message.

    The function raises ValueError if the command is impossible.
    """

    name: str
    type: str
    read: Callable[[Any], DriverCommand]


def _read_ackermann(message: Any) -> AckermannCommand:
    """The command of an AckermannDriveStamped; its jerk is not used."""
    drive = message.drive
    return AckermannCommand(drive.steering_angle, drive.speed, drive.acceleration, drive.steering_angle_velocity)


def _read_trajectory(message: Any) -> TrajectoryCommand:
    """The command of a MultiDOFJointTrajectory, whose first joint is the center of the rear axle, map frame."""
    _require_map(message.header.frame_id)
    begin_ns = stamp_of(message.header.stamp)
    times_ns = [
        begin_ns + each.time_from_start.sec * NS_PER_S + each.time_from_start.nanosec for each in message.points
    ]
    if not all(each.transforms for each in message.points):
        raise ValueError("every point of a trajectory needs a transform; the vehicle keeps its last valid one")
    places = [each.transforms[0].translation for each in message.points]
    return TrajectoryCommand.of(times_ns, [(each.x, each.y) for each in places])


def _read_path(message: Any) -> TrajectoryCommand:
    """The command of a Path, whose poses have the times at which the center of the rear axle is there, map frame."""
    _require_map(message.header.frame_id)
    places = [each.pose.position for each in message.poses]
    times_ns = [stamp_of(each.header.stamp) for each in message.poses]
    return TrajectoryCommand.of(times_ns, [(each.x, each.y) for each in places])


def _read_indicators(message: Any) -> IndicatorsCommand:
    """The command of an IndicatorsCommand; bits that have no meaning are not used."""
    left, right = (bool(message.indicators & _BITS[f"INDICATOR_{side}"]) for side in ("LEFT", "RIGHT"))
    return IndicatorsCommand(left, right)


def _require_map(frame: str) -> None:
    if frame != MAP_FRAME:
        raise ValueError(f"header.frame_id must be {MAP_FRAME!r}, not {frame!r}; the vehicle keeps its last valid one")


COMMAND_KINDS: Mapping[str, CommandKind] = {
    "ackermann": CommandKind("ackermann_cmd", "ackermann_msgs/msg/AckermannDriveStamped", _read_ackermann),
    "trajectory": CommandKind("trajectory", "trajectory_msgs/msg/MultiDOFJointTrajectory", _read_trajectory),
    "path": CommandKind("planned_path", "nav_msgs/msg/Path", _read_path),
}
"""Kinds of commands by drivers, of which a vehicle follows one."""

INDICATORS = CommandKind("indicators_cmd", "simbev_interfaces/msg/IndicatorsCommand", _read_indicators)
"""Commands that drivers of all these kinds may send, too."""
