"""Part of the relay for Autoware that lets it drive: its commands come in, ours and reports go out."""

from collections import deque

from ackermann_msgs.msg import AckermannDriveStamped
from autoware_control_msgs.msg import Control
from autoware_vehicle_msgs.msg import (
    ControlModeReport,
    Engage,
    GearCommand,
    GearReport,
    HazardLightsCommand,
    HazardLightsReport,
    SteeringReport,
    TurnIndicatorsCommand,
    TurnIndicatorsReport,
    VelocityReport,
)
from autoware_vehicle_msgs.srv import ControlModeCommand
from nav_msgs.msg import Odometry
from rclpy.duration import Duration
from rclpy.qos import QoSProfile, qos_profile_sensor_data
from sensor_msgs.msg import PointCloud2
from simbev_interfaces.msg import IndicatorsCommand

from simbev_ros.config.agents import driver_participant
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.join import Lockstep
from simbev_ros.ros.msgs.stamps import stamp_of
from simbev_ros.ros.msgs.tables import rows_from_message
from simbev_ros.ros.relays.autoware_vehicle import (
    Indicators,
    WantedIndicators,
    drive_command,
    engaged_gear,
    gear_report,
    stop_command,
    velocity_report,
)
from simbev_ros.ros.relays.running import Relay
from simbev_ros.schema.scene.drive_tables import STATUS_DTYPE
from simbev_ros.schema.scene.spec import SceneSpec, scene_number_of

_RELIABLE = QoSProfile(depth=5)
_QUEUE = 100
_SILENCE_NS = NS_PER_S // 2
_ARRIVAL = Duration(seconds=1)
_MODES = (ControlModeReport.AUTONOMOUS, ControlModeReport.MANUAL)


class AutowareDriving:
    """Drives the ego as Autoware commands, one command for each tick, and reports its motion.

    It takes part in the lockstep of scenes whose ego has the driver ``ackermann``. While the mode is not autonomous, or
    Autoware is silent for 0.5 s, the vehicle brakes.

    Args:
        node: The relay.
        base_frame: Frame of the reports.
        waits: Whether the world waits at each tick for a command that is not older, once there has been one.
    """

    def __init__(self, node: Relay, base_frame: str, *, waits: bool) -> None:
        self._node, self._base_frame, self._waits = node, base_frame, waits
        self._mode, self._gear, self._has_gear = int(ControlModeReport.AUTONOMOUS), int(GearCommand.DRIVE), False
        self._control: Control | None = None
        self._heard_ns = self._now_ns = 0
        self._steering_rad = self._speed_mps = 0.0
        self._unanswered = deque[Odometry]()
        self._lockstep: Lockstep | None = None
        self._indicators, self._wanted = Indicators(), WantedIndicators()
        publish = node.create_publisher
        self._velocity = publish(VelocityReport, "/vehicle/status/velocity_status", _RELIABLE)
        self._steering = publish(SteeringReport, "/vehicle/status/steering_status", _RELIABLE)
        self._gears = publish(GearReport, "/vehicle/status/gear_status", _RELIABLE)
        self._modes = publish(ControlModeReport, "/vehicle/status/control_mode", _RELIABLE)
        self._turns = publish(TurnIndicatorsReport, "/vehicle/status/turn_indicators_status", _RELIABLE)
        self._hazards = publish(HazardLightsReport, "/vehicle/status/hazard_lights_status", _RELIABLE)
        self._commands = publish(AckermannDriveStamped, "/ego/ackermann_cmd", _QUEUE)
        self._lamps = publish(IndicatorsCommand, "/ego/indicators_cmd", _QUEUE)
        node.listen(PointCloud2, "/ego/vehicle_status", self._on_status, qos_profile_sensor_data)
        node.listen(Control, "/control/command/control_cmd", self._on_control, _RELIABLE)
        node.listen(GearCommand, "/control/command/gear_cmd", self._on_gear, _RELIABLE)
        turn, warn = (lambda message: self._wanted.turn(message)), (lambda message: self._wanted.warn(message))
        node.listen(TurnIndicatorsCommand, "/control/command/turn_indicators_cmd", turn, _RELIABLE)
        node.listen(HazardLightsCommand, "/control/command/hazard_lights_cmd", warn, _RELIABLE)
        node.listen(Engage, "/vehicle/engage", self._on_engage, _RELIABLE)
        node.create_service(ControlModeCommand, "/control/control_mode_request", self._on_mode_request)

    def start_scene(self, scene: SceneSpec, odometry: str) -> None:
        """Forget the commands for the scene before, and drive the ego if it is to be driven.

        Args:
            scene: The scene.
            odometry: The only topic of the relay that the scene has to wait for.
        """
        self._control, self._steering_rad = None, 0.0
        self._indicators, self._wanted = Indicators(), WantedIndicators()
        self._unanswered.clear()
        if scene.agents[0].driver == "ackermann" and self._lockstep is None:
            self._lockstep = Lockstep(self._node, driver_participant(scene.agents[0].rig.agent))
            self._lockstep.optional |= {each.topic_name for each in self._node.subscriptions} - {odometry}
            self._lockstep.outputs += [self._commands, self._lamps]

    def on_odometry(self, odometry: Odometry) -> None:
        """Report the motion, and drive on."""
        self._now_ns, self._speed_mps = stamp_of(odometry.header.stamp), odometry.twist.twist.linear.x
        self._velocity.publish(velocity_report(odometry, self._base_frame))
        self._modes.publish(ControlModeReport(stamp=odometry.header.stamp, mode=self._mode))
        if self._lockstep is not None and self._lockstep.scene is not None:
            self._unanswered.append(odometry)
            self._answer()

    def _answer(self) -> None:
        """Send a command for each tick that has none, unless that of Autoware is to come first."""
        while self._unanswered and self._lockstep is not None:
            odometry = self._unanswered[0]
            if self._is_awaited(stamp_of(odometry.header.stamp)):
                return
            self._unanswered.popleft()
            command = AckermannDriveStamped(header=odometry.header)
            is_driving = self._control is not None and 0 <= self._now_ns - self._heard_ns <= _SILENCE_NS
            if is_driving and self._mode == ControlModeReport.AUTONOMOUS:
                command.drive = drive_command(self._control, self._gear, odometry.twist.twist.linear.x)
            else:
                command.drive = stop_command(self._steering_rad)
            self._steering_rad = command.drive.steering_angle
            self._indicate(odometry)
            self._commands.publish(command)
            self._lockstep.finished(odometry.header.stamp)

    def _indicate(self, odometry: Odometry) -> None:
        """Send the indicators if they change, before the command without which the world does not start their tick."""
        if self._mode == ControlModeReport.AUTONOMOUS and (bits := self._wanted.take_change()) is not None:
            self._lamps.publish(IndicatorsCommand(header=odometry.header, indicators=bits))
            self._lamps.wait_for_all_acked(_ARRIVAL)

    def _is_awaited(self, stamp_ns: int) -> bool:
        if not self._waits or self._control is None or self._mode != ControlModeReport.AUTONOMOUS:
            return False
        control_ns = stamp_of(self._control.stamp)
        return control_ns < stamp_ns and scene_number_of(control_ns) == scene_number_of(stamp_ns)

    def _on_status(self, message: PointCloud2) -> None:
        (status,) = rows_from_message(message, STATUS_DTYPE)
        stamp = message.header.stamp
        self._steering.publish(SteeringReport(stamp=stamp, steering_tire_angle=float(status["steering"])))
        self._gears.publish(gear_report(status, stamp, self._gear if self._has_gear else None))
        turn, hazard = self._indicators.reports(status, stamp)
        self._turns.publish(turn)
        self._hazards.publish(hazard)

    def _on_control(self, message: Control) -> None:
        self._control, self._heard_ns = message, self._now_ns
        self._answer()

    def _on_gear(self, message: GearCommand) -> None:
        self._gear, self._has_gear = engaged_gear(self._gear, message.command, self._speed_mps), True

    def _on_engage(self, message: Engage) -> None:
        self._mode = _MODES[0] if message.engage else _MODES[1]
        self._answer()

    def _on_mode_request(
        self, request: ControlModeCommand.Request, response: ControlModeCommand.Response
    ) -> ControlModeCommand.Response:
        response.success = request.mode in _MODES
        if response.success:
            self._mode = int(request.mode)
            self._answer()
        return response
