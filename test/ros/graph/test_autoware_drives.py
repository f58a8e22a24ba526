"""Autoware's topics drive the ego: a stand-in for it sends commands, the relay runs as a user starts it."""

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from commands import SCENE, Simbev, write_small
from nav_msgs.msg import Odometry
from ros_domain import DOMAIN
from subscriber import Caller, outside_node

from simbev_ros.export.maps.lanelet2_file import lanelet2_of
from simbev_ros.maps.build import load_network
from simbev_ros.maps.source import map_spec
from simbev_ros.recording.arrays import point_array
from simbev_ros.recording.reader import SceneBag
from simbev_ros.ros.msgs.stamps import stamp_of

pytest.importorskip("autoware_control_msgs", reason="Autoware's messages are not made: start its relay once")
pytest.importorskip("autoware_perception_msgs")
from autoware_control_msgs.msg import Control
from autoware_perception_msgs.msg import PredictedObjects, TrackedObjects, TrafficLightGroupArray
from autoware_vehicle_msgs.msg import (
    ControlModeReport,
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
from geometry_msgs.msg import PoseWithCovarianceStamped

pytestmark = [pytest.mark.graph, pytest.mark.slow]

MORE = "ego: {driver: ackermann}\ngraph: {window_ticks: 3}\n"
ACCELERATION_MPS2, STEERING_RAD, TICKS = 1.5, 0.02, 80
START_NS, TICK_NS = 3601 * 10**9, 50_000_000
LEFT_TICK, HAZARD_TICK = 20, 50
"""Ticks at which Autoware switches its left indicator on, and its hazard lights."""
STRETCHES = ((0, LEFT_TICK), (LEFT_TICK + 18, HAZARD_TICK), (HAZARD_TICK + 18, TICKS))
"""Ticks in which the vehicle shows nothing, the left indicator, and hazard lights."""
OUTPUTS = {
    "/vehicle/status/velocity_status": VelocityReport,
    "/vehicle/status/steering_status": SteeringReport,
    "/vehicle/status/gear_status": GearReport,
    "/vehicle/status/control_mode": ControlModeReport,
    "/vehicle/status/turn_indicators_status": TurnIndicatorsReport,
    "/vehicle/status/hazard_lights_status": HazardLightsReport,
    "/perception/object_recognition/objects": PredictedObjects,
    "/perception/object_recognition/tracking/objects": TrackedObjects,
    "/perception/traffic_light_recognition/traffic_signals": TrafficLightGroupArray,
    "/initialpose3d": PoseWithCovarianceStamped,
}


@contextmanager
def relay(*parameters: str) -> Iterator[subprocess.Popen[bytes]]:
    """The relay as a process; at the end it must have run until it was told to end."""
    words = [word for each in parameters for word in ("-p", each)]
    environment = {**os.environ, "ROS_DOMAIN_ID": str(DOMAIN)}
    process = subprocess.Popen(
        [sys.executable, "-m", "simbev_ros.ros.relays.autoware", "--ros-args", *words], env=environment
    )
    try:
        yield process
        assert process.poll() is None
    finally:
        process.terminate()
        process.wait()


def stamp_ns_of(message: Any) -> int:
    """Stamp of a message with a header or a time."""
    return stamp_of(message.header.stamp if hasattr(message, "header") else message.stamp)


def test_commands_of_autoware_move_the_ego_and_reports_agree_with_its_odometry(simbev: Simbev, tmp_path: Path) -> None:
    map_file = tmp_path / "lanelet2_map.osm"
    map_file.write_bytes(lanelet2_of(load_network(map_spec("Blocks"))))
    config = write_small(tmp_path, TICKS * 0.05, MORE, without=["camera", "lidar", "radar"])
    received: dict[str, list[Any]] = {topic: [] for topic in OUTPUTS}
    motions: list[Odometry] = []
    with outside_node("autoware") as (node, spin_until), relay("lockstep:=true", f"lanelet2_map:={map_file}"):
        turns = node.create_publisher(TurnIndicatorsCommand, "/control/command/turn_indicators_cmd", 10)
        hazards = node.create_publisher(HazardLightsCommand, "/control/command/hazard_lights_cmd", 10)
        controls = node.create_publisher(Control, "/control/command/control_cmd", 10)
        gears = node.create_publisher(GearCommand, "/control/command/gear_cmd", 10)

        def command(odometry: Odometry) -> None:
            motions.append(odometry)
            stamp = odometry.header.stamp
            tick = (stamp_of(stamp) - START_NS) // TICK_NS
            turns.publish(TurnIndicatorsCommand(stamp=stamp, command=2 if tick >= LEFT_TICK else 1))
            hazards.publish(HazardLightsCommand(stamp=stamp, command=2 if tick >= HAZARD_TICK else 1))
            message = Control(stamp=odometry.header.stamp)
            message.lateral.steering_tire_angle = STEERING_RAD
            message.longitudinal.acceleration, message.longitudinal.is_defined_acceleration = ACCELERATION_MPS2, True
            gears.publish(GearCommand(stamp=odometry.header.stamp, command=GearCommand.DRIVE_2))
            controls.publish(message)

        node.create_subscription(Odometry, "/ego/odom", command, 100)
        for topic, kind in OUTPUTS.items():
            node.create_subscription(kind, topic, received[topic].append, 100)
        refused = Caller(node, spin_until).call(
            ControlModeCommand, "/control/control_mode_request", ControlModeCommand.Request(mode=2)
        )
        assert not refused.success
        run = simbev("run", config, "--record", tmp_path / "recorded")
        spin_until(lambda: run.process.poll() is not None)
        reports = received["/vehicle/status/velocity_status"]
        spin_until(lambda: bool(reports) and stamp_ns_of(reports[-1]) == stamp_of(motions[-1].header.stamp))
    code, output = run.finish()
    assert code == 0, output
    check_motion(tmp_path / "recorded", motions)
    check_reports(received, motions)


def check_motion(recorded: Path, motions: list[Odometry]) -> None:
    """The vehicle accelerates as commanded in the last two seconds, and its wheels turn."""
    with SceneBag(recorded / SCENE) as bag:
        assert bag.custom_data["complete"] == "true"
        status = [point_array(bag.decode(each))[0] for each in bag.messages(["/ego/vehicle_status"])]
    assert status[-1]["speed"] - status[-41]["speed"] == pytest.approx(ACCELERATION_MPS2 * 40 * 0.05, rel=0.02)
    assert status[-1]["steering"] == pytest.approx(STEERING_RAD, abs=1e-3)
    shown = [{int(row["indicators"]) for row in status[first:last]} for first, last in STRETCHES]
    assert shown == [{0}, {0, 1}, {0, 3}]
    assert motions[-1].twist.twist.linear.x == pytest.approx(float(status[-1]["speed"]), abs=0.05)


def check_reports(received: dict[str, list[Any]], motions: list[Odometry]) -> None:
    """Reports have the values of the odometry with their stamp; the truth is there at each tick."""
    speeds = {stamp_of(each.header.stamp): each.twist.twist for each in motions}
    reports = [each for each in received["/vehicle/status/velocity_status"] if stamp_ns_of(each) in speeds]
    assert len(reports) > TICKS / 2
    for report in reports:
        twist = speeds[stamp_ns_of(report)]
        assert report.longitudinal_velocity == pytest.approx(twist.linear.x, abs=1e-4)
        assert report.heading_rate == pytest.approx(twist.angular.z, abs=1e-4)
    assert received["/vehicle/status/gear_status"][-1].report == GearReport.DRIVE_2
    assert received["/vehicle/status/control_mode"][-1].mode == ControlModeReport.AUTONOMOUS
    turns = {each.report for each in received["/vehicle/status/turn_indicators_status"]}
    assert turns == {TurnIndicatorsReport.DISABLE, TurnIndicatorsReport.ENABLE_LEFT}
    assert received["/vehicle/status/hazard_lights_status"][-1].report == HazardLightsReport.ENABLE
    assert received["/vehicle/status/steering_status"][-1].steering_tire_angle == pytest.approx(STEERING_RAD, abs=1e-3)
    predicted = received["/perception/object_recognition/objects"][-1]
    tracked = received["/perception/object_recognition/tracking/objects"][-1]
    assert predicted.header.frame_id == "map" and len(predicted.objects) == len(tracked.objects) > 0
    lights = received["/perception/traffic_light_recognition/traffic_signals"][-1]
    assert len(lights.traffic_light_groups) > 0
    (start,) = received["/initialpose3d"]
    assert start.pose.pose == next(each.pose.pose for each in motions if each.header.stamp == start.header.stamp)
