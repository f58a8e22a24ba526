"""Messages of drivers become commands; impossible ones are refused with what the vehicle does instead."""

from types import SimpleNamespace

import pytest
from geometry_msgs.msg import PoseStamped, Transform
from nav_msgs.msg import Path
from trajectory_msgs.msg import MultiDOFJointTrajectory, MultiDOFJointTrajectoryPoint

from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.ros.msgs.stamps import header
from simbev_ros.ros.msgs.vehicle_commands import COMMAND_KINDS, INDICATORS
from simbev_ros.simulation.world.driving.commands import AckermannCommand, IndicatorsCommand

BEGIN_NS = 7 * NS_PER_S


def path(*points: tuple[float, float], frame: str = "map") -> Path:
    message = Path(header=header(BEGIN_NS, frame))
    for number, (x, y) in enumerate(points):
        pose = PoseStamped(header=header(BEGIN_NS + number * NS_PER_S, frame))
        pose.pose.position.x, pose.pose.position.y = x, y
        message.poses.append(pose)
    return message


def test_an_ackermann_command_has_the_limits_of_the_message() -> None:
    drive = SimpleNamespace(
        steering_angle=0.1, speed=-2.0, acceleration=1.5, steering_angle_velocity=0.3, jerk=float("nan")
    )
    found = COMMAND_KINDS["ackermann"].read(SimpleNamespace(drive=drive))
    assert found == AckermannCommand(0.1, -2.0, acceleration_mps2=1.5, steer_rate_radps=0.3)


def test_an_indicators_command_has_the_sides_of_its_bits() -> None:
    found = [INDICATORS.read(SimpleNamespace(indicators=bits)) for bits in (0, 1, 2, 3, 252)]
    sides = [(False, False), (True, False), (False, True), (True, True), (False, False)]
    assert found == [IndicatorsCommand(*each) for each in sides]


def test_a_path_and_a_trajectory_of_the_same_poses_are_the_same_plan() -> None:
    message = MultiDOFJointTrajectory(header=header(BEGIN_NS, "map"))
    for number in range(3):
        point = MultiDOFJointTrajectoryPoint(transforms=[Transform()])
        point.transforms[0].translation.x, point.transforms[0].translation.y = 5.0 * number, 1.0
        point.time_from_start.sec = number
        message.points.append(point)
    trajectory = COMMAND_KINDS["trajectory"].read(message)
    plan = COMMAND_KINDS["path"].read(path((0.0, 1.0), (5.0, 1.0), (10.0, 1.0)))
    for found in (trajectory, plan):
        assert found.stamp_ns.tolist() == [BEGIN_NS + number * NS_PER_S for number in range(3)]
        assert found.points_m.tolist() == [[0, 1], [5, 1], [10, 1]]


@pytest.mark.parametrize(
    ("kind", "message", "problem"),
    [
        ("path", path((0.0, 0.0), (1.0, 0.0), frame="odom"), "header.frame_id must be 'map', not 'odom'; the vehicle"),
        ("path", path((0.0, 0.0)), "at least 2 poses"),
        ("path", path((0.0, 0.0), (float("inf"), 0.0)), "finite numbers"),
        (
            "trajectory",
            MultiDOFJointTrajectory(header=header(0, "map"), points=[MultiDOFJointTrajectoryPoint()]),
            "needs a transform",
        ),
    ],
)
def test_impossible_plans_are_refused(kind: str, message: object, problem: str) -> None:
    with pytest.raises(ValueError, match=problem):
        COMMAND_KINDS[kind].read(message)
