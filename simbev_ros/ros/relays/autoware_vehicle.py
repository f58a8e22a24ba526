"""Converts Autoware's commands to those of our vehicles, and what a vehicle reports to Autoware's reports. Pure."""

from ackermann_msgs.msg import AckermannDrive
from autoware_control_msgs.msg import Control
from autoware_vehicle_msgs.msg import (
    GearCommand,
    GearReport,
    HazardLightsCommand,
    HazardLightsReport,
    TurnIndicatorsCommand,
    TurnIndicatorsReport,
    VelocityReport,
)
from builtin_interfaces.msg import Time
from nav_msgs.msg import Odometry

from simbev_ros.foundation.types import Table
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.ros.msgs.stamps import stamp_of
from simbev_ros.schema.messages.message_rows import message_constants

_AHEAD_S = 1.0
"""Time for which an acceleration is to last; a vehicle accelerates less when it is this close to its desired speed."""
_BRAKING_MPS2 = 3.0
_STANDING_MPS = 0.1
_DARK_NS = NS_PER_S // 2
"""Indicators blink at 1.5 Hz: one that has been dark for longer is off."""
_STATUS = message_constants("VehicleStatus")
_TURNS = {
    TurnIndicatorsCommand.DISABLE: 0,
    TurnIndicatorsCommand.ENABLE_LEFT: _STATUS["INDICATOR_LEFT"],
    TurnIndicatorsCommand.ENABLE_RIGHT: _STATUS["INDICATOR_RIGHT"],
}
_HAZARDS = {
    HazardLightsCommand.DISABLE: 0,
    HazardLightsCommand.ENABLE: _STATUS["INDICATOR_LEFT"] | _STATUS["INDICATOR_RIGHT"],
}
_FORWARD = frozenset((*range(GearCommand.DRIVE, GearCommand.DRIVE_18 + 1), GearCommand.LOW, GearCommand.LOW_2))
_BACKWARD = frozenset((GearCommand.REVERSE, GearCommand.REVERSE_2))


def gear_direction(gear: int) -> int:
    """1 for gears that drive forward, -1 for those backward, 0 for others, in which our vehicles stand."""
    return int(gear in _FORWARD) - int(gear in _BACKWARD)


def engaged_gear(engaged: int, wanted: int, speed_mps: float) -> int:
    """The gear after a command: one in the other direction is engaged only at a standstill."""
    if wanted == GearCommand.NONE or wanted > GearCommand.LOW_2:
        return engaged
    may_change = abs(speed_mps) < _STANDING_MPS or gear_direction(wanted) == gear_direction(engaged)
    return wanted if may_change else engaged


def drive_command(control: Control, gear: int, speed_mps: float) -> AckermannDrive:
    """Our command for one of Autoware's.

    Autoware's acceleration is that in the direction of the gear, as in its simple_planning_simulator, and comes from a
    controller that knows the speed: it is what the vehicle follows. Only a command without one is a desired speed.

    Args:
        control: The command.
        gear: The engaged gear.
        speed_mps: Speed of the vehicle, forward positive.
    """
    direction, motion = gear_direction(gear), control.longitudinal
    drive = AckermannDrive(steering_angle=control.lateral.steering_tire_angle)
    if motion.is_defined_acceleration or motion.acceleration:
        drive.acceleration = abs(motion.acceleration)
        drive.speed = speed_mps + _AHEAD_S * motion.acceleration * direction
    else:
        drive.speed = motion.velocity
    drive.speed = max(drive.speed * direction, 0.0) * direction  # never against the gear
    return drive


def stop_command(steering_rad: float) -> AckermannDrive:
    """The command while Autoware gives none: brake, with the wheels as they are."""
    return AckermannDrive(steering_angle=steering_rad, acceleration=_BRAKING_MPS2)


def velocity_report(odometry: Odometry, frame: str) -> VelocityReport:
    """The motion of the vehicle in its own frame."""
    linear, angular = odometry.twist.twist.linear, odometry.twist.twist.angular
    report = VelocityReport(longitudinal_velocity=linear.x, lateral_velocity=linear.y, heading_rate=angular.z)
    report.header.stamp, report.header.frame_id = odometry.header.stamp, frame
    return report


def gear_report(status: Table, stamp: Time, engaged: int | None) -> GearReport:
    """The gear that commands engaged, else the direction in which the vehicle reports to drive."""
    reverse = status["gear"] == _STATUS["GEAR_REVERSE"]
    own = GearReport.REVERSE if reverse else GearReport.DRIVE
    return GearReport(stamp=stamp, report=own if engaged is None else engaged)


class WantedIndicators:
    """Indicators that Autoware's commands ask for; hazard lights go before turns, NO_COMMAND changes nothing."""

    def __init__(self) -> None:
        self._turn: int | None = None
        self._hazard: int | None = None
        self._taken: int | None = None

    def turn(self, command: TurnIndicatorsCommand) -> None:
        """Remember the side of a turn."""
        self._turn = _TURNS.get(command.command, self._turn)

    def warn(self, command: HazardLightsCommand) -> None:
        """Remember whether hazard lights are on."""
        self._hazard = _HAZARDS.get(command.command, self._hazard)

    def take_change(self) -> int | None:
        """INDICATOR_ bits if others are wanted than at the last call; None if not, or before the first command."""
        before, wanted = self._taken, self._hazard or self._turn
        self._taken = self._hazard if wanted is None else wanted
        return None if self._taken == before else self._taken


class Indicators:
    """Turns lamps that blink into reports of indicators that are on."""

    def __init__(self) -> None:
        self._bright_ns = dict.fromkeys(("INDICATOR_LEFT", "INDICATOR_RIGHT"), -_DARK_NS)

    def reports(self, status: Table, stamp: Time) -> tuple[TurnIndicatorsReport, HazardLightsReport]:
        """Reports for one ``STATUS_DTYPE`` row, the next one in time."""
        now_ns = stamp_of(stamp)
        for side in self._bright_ns:
            if status["indicators"] & _STATUS[side]:
                self._bright_ns[side] = now_ns
        left, right = (0 <= now_ns - bright_ns < _DARK_NS for bright_ns in self._bright_ns.values())
        turn, hazard = TurnIndicatorsReport(stamp=stamp, report=TurnIndicatorsReport.DISABLE), HazardLightsReport
        if left != right:
            turn.report = TurnIndicatorsReport.ENABLE_LEFT if left else TurnIndicatorsReport.ENABLE_RIGHT
        return turn, hazard(stamp=stamp, report=hazard.ENABLE if left and right else hazard.DISABLE)
