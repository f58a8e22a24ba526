"""The relay for Autoware turns commands, status, boxes and lights into what the other side means by them."""

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from nav_msgs.msg import Odometry

from simbev_ros.foundation.semantics import BOX_CLASSES
from simbev_ros.ros.msgs.stamps import header, time_message
from simbev_ros.schema.boxes import blank_boxes
from simbev_ros.schema.scene.drive_tables import STATUS_DTYPE
from simbev_ros.schema.scene.state import SIGNAL_DTYPE, SignalState

pytest.importorskip("autoware_control_msgs", reason="Autoware's messages are not made: start its relay once")
pytest.importorskip("autoware_perception_msgs")
from autoware_control_msgs.msg import Control
from autoware_perception_msgs.msg import ObjectClassification, TrafficLightElement
from autoware_vehicle_msgs.msg import (
    Engage,
    GearCommand,
    HazardLightsCommand,
    HazardLightsReport,
    TurnIndicatorsCommand,
    TurnIndicatorsReport,
)
from autoware_vehicle_msgs.srv import ControlModeCommand

from simbev_ros.ros.relays.autoware_driving import AutowareDriving
from simbev_ros.ros.relays.autoware_messages import initial_pose
from simbev_ros.ros.relays.autoware_objects import object_uuid, predicted_objects, tracked_objects
from simbev_ros.ros.relays.autoware_signals import (
    lights_message,
    read_light_groups,
    rows_of_groups,
)
from simbev_ros.ros.relays.autoware_vehicle import (
    Indicators,
    drive_command,
    engaged_gear,
    gear_report,
    velocity_report,
)

STAMP_NS = 7_200_000_000_000


def control(acceleration: float | None = None, velocity: float = 0.0, steering: float = 0.1) -> Control:
    message = Control()
    message.lateral.steering_tire_angle, message.longitudinal.velocity = steering, velocity
    message.longitudinal.is_defined_acceleration = acceleration is not None
    message.longitudinal.acceleration = acceleration or 0.0
    return message


def status(**values: float) -> Any:
    row = np.zeros(1, STATUS_DTYPE)
    for name, value in values.items():
        row[name] = value
    return row[0]


@pytest.mark.parametrize(
    ("command", "gear", "speed_mps", "speed", "acceleration"),
    [
        (control(1.5), GearCommand.DRIVE, 4.0, 5.5, 1.5),
        (control(-2.0), GearCommand.DRIVE, 4.0, 2.0, 2.0),
        (control(-2.0), GearCommand.DRIVE, 1.0, 0.0, 2.0),  # it brakes to a standstill, and does not reverse
        (control(0.0), GearCommand.DRIVE_2, 4.0, 4.0, 0.0),
        (control(1.0), GearCommand.REVERSE, -2.0, -3.0, 1.0),  # acceleration is along the gear
        (control(-1.0), GearCommand.REVERSE, -0.5, 0.0, 1.0),
        (control(1.0), GearCommand.PARK, 0.0, 0.0, 1.0),
        (control(None, velocity=8.0), GearCommand.DRIVE, 4.0, 8.0, 0.0),
        (control(None, velocity=-3.0), GearCommand.REVERSE, 0.0, -3.0, 0.0),
        (control(None, velocity=-3.0), GearCommand.DRIVE, 0.0, 0.0, 0.0),
    ],
)
def test_a_command_accelerates_along_the_gear(
    command: Control, gear: int, speed_mps: float, speed: float, acceleration: float
) -> None:
    drive = drive_command(command, gear, speed_mps)
    assert (drive.speed, drive.acceleration) == pytest.approx((speed, acceleration))
    assert drive.steering_angle == pytest.approx(0.1)


def test_the_gear_changes_direction_at_a_standstill_only() -> None:
    assert engaged_gear(GearCommand.DRIVE, GearCommand.REVERSE, 3.0) == GearCommand.DRIVE
    assert engaged_gear(GearCommand.DRIVE, GearCommand.REVERSE, 0.05) == GearCommand.REVERSE
    assert engaged_gear(GearCommand.DRIVE, GearCommand.DRIVE_3, 3.0) == GearCommand.DRIVE_3
    assert engaged_gear(GearCommand.DRIVE, GearCommand.NONE, 0.0) == GearCommand.DRIVE


def test_reports_have_the_values_of_odometry_and_status() -> None:
    odometry = Odometry(header=header(STAMP_NS, "map"))
    odometry.twist.twist.linear.x, odometry.twist.twist.linear.y, odometry.twist.twist.angular.z = 6.0, -0.2, 0.3
    report = velocity_report(odometry, "base_link")
    assert report.header.frame_id == "base_link" and report.header.stamp == odometry.header.stamp
    values = report.longitudinal_velocity, report.lateral_velocity, report.heading_rate
    assert values == pytest.approx((6.0, -0.2, 0.3))
    stamp = time_message(STAMP_NS)
    assert gear_report(status(gear=2), stamp, None).report == GearCommand.REVERSE
    assert gear_report(status(gear=1), stamp, None).report == GearCommand.DRIVE
    assert gear_report(status(gear=1), stamp, GearCommand.PARK).report == GearCommand.PARK


def test_indicators_stay_on_between_the_bright_halves_of_their_blinking() -> None:
    indicators, turns, hazards = Indicators(), [], []
    for step, bits in enumerate([0, 1, 0, 0, 1, 0, 0, 0, 3]):
        turn, hazard = indicators.reports(status(indicators=bits), time_message(STAMP_NS + step * 200_000_000))
        turns.append(turn.report)
        hazards.append(hazard.report)
    off, left = TurnIndicatorsReport.DISABLE, TurnIndicatorsReport.ENABLE_LEFT
    assert turns == [off, left, left, left, left, left, left, off, off]
    assert hazards == [HazardLightsReport.DISABLE] * 8 + [HazardLightsReport.ENABLE]


def boxes() -> Any:
    """A car that drives along y at 5 m/s, a cone, and a traffic light."""
    rows = blank_boxes(3)
    rows["class"] = [BOX_CLASSES.index(name) for name in ("car", "traffic_cone", "traffic_light")]
    rows["id"], rows["x"], rows["y"] = [7, 8, 70_000], [10.0, 1.0, 2.0], [20.0, 1.0, 2.0]
    rows["yaw"], rows["vy"], rows["ay"] = math.pi / 2.0, [5.0, 0.0, 0.0], [-1.0, 0.0, 0.0]
    rows["length"], rows["width"], rows["height"] = 4.0, 2.0, 1.5
    return rows


def test_boxes_become_tracked_objects_with_velocities_in_their_own_frame() -> None:
    car, cone = tracked_objects(boxes(), STAMP_NS).objects
    assert [each.classification[0].label for each in (car, cone)] == [
        ObjectClassification.CAR,
        ObjectClassification.UNKNOWN,
    ]
    linear, accel = car.kinematics.twist_with_covariance.twist.linear, car.kinematics.acceleration_with_covariance.accel
    assert (linear.x, linear.y) == pytest.approx((5.0, 0.0), abs=1e-6)
    assert accel.linear.x == pytest.approx(-1.0)
    assert (car.kinematics.is_stationary, cone.kinematics.is_stationary) == (False, True)
    assert (car.shape.dimensions.x, car.shape.dimensions.y, car.shape.dimensions.z) == (4.0, 2.0, 1.5)
    assert list(car.object_id.uuid) == object_uuid(1, 7) == [0] * 11 + [1, 0, 0, 0, 7]


def test_predicted_paths_keep_the_velocity_for_ten_seconds() -> None:
    car, cone = predicted_objects(boxes(), STAMP_NS).objects
    (path,) = car.kinematics.predicted_paths
    assert (len(path.path), path.time_step.sec, path.time_step.nanosec) == (21, 0, 500_000_000)
    assert (path.path[0].position.x, path.path[0].position.y) == pytest.approx((10.0, 20.0))
    assert (path.path[-1].position.x, path.path[-1].position.y) == pytest.approx((10.0, 70.0))
    assert {pose.position.y for pose in cone.kinematics.predicted_paths[0].path} == {1.0}


def signals(*states: SignalState) -> Any:
    rows = np.zeros(len(states), SIGNAL_DTYPE)
    rows["x"], rows["state"] = np.arange(len(states)) * 10.0, states
    return rows


def test_traffic_lights_get_the_ids_of_the_groups_at_their_positions() -> None:
    groups = {11: np.array([[0.0, 0.1], [20.0, 0.0]]), 12: np.array([[10.1, 0.0]]), 13: np.array([[500.0, 0.0]])}
    heads = signals(SignalState.RED, SignalState.RED_YELLOW, SignalState.RED)
    rows = rows_of_groups(groups, heads)
    assert rows == {11: [0, 2], 12: [1]}
    first, second = lights_message(rows, heads, time_message(STAMP_NS)).traffic_light_groups
    element = TrafficLightElement
    assert (first.traffic_light_group_id, [lamp.color for lamp in first.elements]) == (11, [element.RED])
    assert (first.elements[0].shape, first.elements[0].status) == (element.CIRCLE, element.SOLID_ON)
    assert [lamp.color for lamp in second.elements] == [element.RED, element.AMBER]
    heads["state"][2] = SignalState.GREEN  # the lights of one group contradict each other
    (lamp,) = lights_message(rows, heads, time_message(STAMP_NS)).traffic_light_groups[0].elements
    assert (lamp.color, lamp.shape) == (element.UNKNOWN, element.UNKNOWN)


def test_every_light_of_an_exported_town_is_in_a_group(tmp_path: Path) -> None:
    from simbev_ros.export.maps.lanelet2_file import lanelet2_of
    from simbev_ros.maps.build import load_network
    from simbev_ros.maps.source import map_spec

    network = load_network(map_spec("Blocks"))
    (tmp_path / "lanelet2_map.osm").write_bytes(lanelet2_of(network))
    heads = np.zeros(len(network.signals), SIGNAL_DTYPE)
    heads["x"], heads["y"], heads["z"] = np.array([signal.position_m for signal in network.signals]).T
    rows = rows_of_groups(read_light_groups(tmp_path / "lanelet2_map.osm"), heads)
    assert {row for members in rows.values() for row in members} == set(range(len(heads)))
    for members in rows.values():
        assert len({network.signals[row].programme for row in members}) == 1


def test_the_initial_pose_is_that_of_the_odometry() -> None:
    odometry = Odometry(header=header(STAMP_NS, "map"))
    odometry.pose.pose.position.x = 3.0
    message = initial_pose(odometry)
    assert (message.header.frame_id, message.pose.pose.position.x) == ("map", 3.0)
    assert (message.pose.covariance.reshape(6, 6).diagonal() > 0.0).all()


class FakeRelay:
    """Keeps what is published, and the callbacks, by topic."""

    def __init__(self) -> None:
        self.sent: dict[str, list[Any]] = {}
        self.callbacks: dict[str, Any] = {}
        self.order: list[str] = []

    def create_publisher(self, kind: Any, topic: str, qos: Any) -> Any:
        sent = self.sent.setdefault(topic, [])
        acked = lambda timeout: self.order.append(topic)  # noqa: E731
        return SimpleNamespace(publish=sent.append, wait_for_all_acked=acked)

    def listen(self, kind: Any, topic: str, callback: Any, qos: Any) -> None:
        self.callbacks[topic] = callback

    def create_service(self, kind: Any, name: str, callback: Any) -> None:
        self.callbacks[name] = callback

    @property
    def commands(self) -> list[tuple[float, float]]:
        """Stamp in s after the first one and speed of each command of ours."""
        return [
            ((each.header.stamp.sec * 10**9 + each.header.stamp.nanosec - STAMP_NS) / 1e9, each.drive.speed)
            for each in self.sent["/ego/ackermann_cmd"]
        ]


def driving(*, waits: bool = False) -> tuple[FakeRelay, AutowareDriving]:
    """The part that drives, in a scene, without ROS."""
    relay: Any = FakeRelay()
    part = AutowareDriving(relay, "base_link", waits=waits)
    lockstep: Any = SimpleNamespace(scene={}, finished=lambda stamp: None)
    part._lockstep = lockstep
    return relay, part


def moving(at_s: float, speed_mps: float = 5.0) -> Odometry:
    odometry = Odometry(header=header(STAMP_NS + round(at_s * 1e9), "map"))
    odometry.twist.twist.linear.x = speed_mps
    return odometry


def stamped(at_s: float) -> Control:
    message = control(1.0)
    message.stamp = time_message(STAMP_NS + round(at_s * 1e9))
    return message


def test_the_ego_brakes_before_the_first_command_and_when_autoware_is_silent() -> None:
    relay, part = driving()
    part.on_odometry(moving(0.0))
    relay.callbacks["/control/command/control_cmd"](stamped(0.0))
    for at_s in (0.05, 0.5, 0.55):
        part.on_odometry(moving(at_s))
    assert relay.commands == [(0.0, 0.0), (0.05, 6.0), (0.5, 6.0), (0.55, 0.0)]


def test_the_ego_brakes_in_manual_mode() -> None:
    relay, part = driving()
    relay.callbacks["/control/command/control_cmd"](stamped(0.0))
    relay.callbacks["/vehicle/engage"](Engage(engage=False))
    part.on_odometry(moving(0.0))
    request = relay.callbacks["/control/control_mode_request"]
    answers = [
        request(ControlModeCommand.Request(mode=mode), ControlModeCommand.Response()).success
        for mode in (ControlModeCommand.Request.AUTONOMOUS_STEER_ONLY, ControlModeCommand.Request.AUTONOMOUS)
    ]
    part._heard_ns = part._now_ns
    part.on_odometry(moving(0.05))
    assert answers == [False, True]
    assert relay.commands == [(0.0, 0.0), (0.05, 6.0)]
    assert [report.mode for report in relay.sent["/vehicle/status/control_mode"]] == [4, 1]


def indicate(relay: FakeRelay, turn: int, hazard: int) -> None:
    relay.callbacks["/control/command/turn_indicators_cmd"](TurnIndicatorsCommand(command=turn))
    relay.callbacks["/control/command/hazard_lights_cmd"](HazardLightsCommand(command=hazard))


def test_indicators_are_sent_when_other_ones_are_wanted_and_before_the_command_of_the_tick() -> None:
    relay, part = driving()
    relay.callbacks["/control/command/control_cmd"](stamped(0.0))
    lamps = relay.sent["/ego/indicators_cmd"]
    found = []
    for step, wanted in enumerate([(0, 0), (1, 1), (2, 0), (2, 1), (2, 2), (0, 0), (3, 1), (1, 1)]):
        indicate(relay, *wanted)
        before = len(lamps)
        part.on_odometry(moving(0.05 * step))
        found.append(lamps[-1].indicators if len(lamps) > before else None)
    assert found == [None, 0, 1, None, 3, None, 2, 0]
    assert [each.header.stamp for each in lamps] == [moving(0.05 * step).header.stamp for step in (1, 2, 4, 6, 7)]
    assert relay.order == ["/ego/indicators_cmd"] * len(lamps)


def test_indicators_are_left_alone_in_manual_mode_and_sent_again_in_each_scene() -> None:
    relay, part = driving()
    indicate(relay, TurnIndicatorsCommand.ENABLE_LEFT, HazardLightsCommand.DISABLE)
    relay.callbacks["/vehicle/engage"](Engage(engage=False))
    part.on_odometry(moving(0.0))
    assert relay.sent["/ego/indicators_cmd"] == []
    relay.callbacks["/vehicle/engage"](Engage(engage=True))
    part.on_odometry(moving(0.05))
    scene: Any = SimpleNamespace(agents=[SimpleNamespace(driver="ackermann")])
    part.start_scene(scene, "/ego/odom")
    part.on_odometry(moving(0.0))
    indicate(relay, TurnIndicatorsCommand.ENABLE_LEFT, HazardLightsCommand.NO_COMMAND)
    part.on_odometry(moving(0.05))
    assert [each.indicators for each in relay.sent["/ego/indicators_cmd"]] == [1, 1]


def test_in_lockstep_a_tick_waits_for_a_command_that_is_not_older() -> None:
    relay, part = driving(waits=True)
    relay.callbacks["/control/command/control_cmd"](stamped(0.0))
    for at_s in (0.0, 0.05, 0.1):
        part.on_odometry(moving(at_s))
    assert [at_s for at_s, _ in relay.commands] == [0.0]
    relay.callbacks["/control/command/control_cmd"](stamped(0.05))
    assert [at_s for at_s, _ in relay.commands] == [0.0, 0.05]
    relay.callbacks["/control/command/control_cmd"](stamped(0.12))
    assert [at_s for at_s, _ in relay.commands] == [0.0, 0.05, 0.1]


@pytest.mark.parametrize("start_s", [0.0, 3600.0])
def test_a_late_command_for_the_scene_before_neither_drives_nor_holds_up_the_next_one(start_s: float) -> None:
    relay, part = driving(waits=True)
    part.on_odometry(moving(60.0))
    scene: Any = SimpleNamespace(agents=[SimpleNamespace(driver="ackermann")])
    part.start_scene(scene, "/ego/odom")  # the next one, or the same one again
    relay.callbacks["/control/command/control_cmd"](stamped(60.0))
    for at_s in (start_s, start_s + 0.05):
        part.on_odometry(moving(at_s))
    assert relay.commands[1:] == [(start_s, 0.0), (start_s + 0.05, 0.0)]
    relay.callbacks["/control/command/control_cmd"](stamped(start_s + 0.05))
    part.on_odometry(moving(start_s + 0.1))
    assert len(relay.commands) == 3
    relay.callbacks["/control/command/control_cmd"](stamped(start_s + 0.1))
    assert relay.commands[3:] == [(start_s + 0.1, 6.0)]
