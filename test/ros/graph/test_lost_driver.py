"""A drive is recorded and scored although its driver dies, stops or never comes; one line says so."""

import sys
from pathlib import Path

import pytest
from commands import SCENE, Simbev, write_small

from simbev_ros.dataset import open_dataset
from simbev_ros.evaluation.driving.recorded_drives import drives_of
from simbev_ros.recording.reader import SceneBag

pytestmark = pytest.mark.graph

DRIVER = """
import copy, os, time
import rclpy
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Odometry, Path
from simbev_ros.join import Driver

received = []

def decide(inputs, scene):
    received.append(inputs)
    if len(received) > 40:
        AFTER
    route, plan = scene["drive"]["route"], Path()
    plan.header.frame_id = "map"
    for row in range(20):
        pose = PoseStamped(header=copy.deepcopy(inputs["/ego/odom"].header))
        pose.header.stamp.sec += row
        pose.pose.position.x, pose.pose.position.y = route["x_m"][3 * row], route["y_m"][3 * row]
        plan.poses.append(pose)
    return plan

rclpy.init()
node = rclpy.create_node("driver")
Driver(node, decide, {"/ego/odom": Odometry}, ("/ego/planned_path", Path))
rclpy.spin(node)
"""


def drive(simbev: Simbev, folder: Path, script: str) -> tuple[str, SceneBag]:
    (folder / "driver.py").write_text(script)
    stack = f"{sys.executable} {folder / 'driver.py'}"
    more = (
        f"ego: {{driver: path}}\ngraph: {{window_ticks: 3, silence_timeout_s: 25}}\n"
        f"drive: {{goal_m: 70, standstill_s: 3, stack: '{stack}'}}\n"
    )
    config = write_small(folder, 30, more, without=["camera", "lidar", "radar"])
    config.write_text(config.read_text().replace("vehicles: 15, pedestrians: 15", "vehicles: 0, pedestrians: 0"))
    code, output = simbev("run", config, "--record", folder / "out").finish()
    assert code == 0, output
    return output, SceneBag(folder / "out" / SCENE)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("script", "reason"),
    [
        (DRIVER.replace("AFTER", "os._exit(3)"), "died after tick"),
        (DRIVER.replace("AFTER", "time.sleep(1000)"), "node ego_driver has been silent for 25 s, after tick"),
        ("import time; time.sleep(1000)", "node ego_driver has been silent for 25 s, while the scene was loading"),
        ("raise ValueError('no model')", "no model"),
    ],
)
def test_a_drive_goes_on_without_its_driver(simbev: Simbev, tmp_path: Path, script: str, reason: str) -> None:
    output, opened = drive(simbev, tmp_path, script)
    with opened as bag:
        assert bag.custom_data["complete"] == "true"
        assert bag.custom_data["ended"].startswith("ego stood still for 3 s")
    (line,) = [line for line in output.splitlines() if "the drive goes on without it" in line]
    assert reason in line
    (judged,) = drives_of(open_dataset(tmp_path / "out", threads=1).scenes)
    assert judged.figures["ended"] == "standstill"
    assert (judged.figures["completed"] > 0.02) == ("AFTER" not in script and "decide" in script)


UNSTAMPED = """
import rclpy
from nav_msgs.msg import Odometry, Path
from simbev_ros.join import Lockstep

rclpy.init()
node = rclpy.create_node("driver")
commands = node.create_publisher(Path, "/ego/planned_path", 100)
lockstep = Lockstep(node, "ego_driver")
lockstep.outputs.append(commands)

def drive(odometry):
    commands.publish(Path())
    lockstep.finished(odometry.header.stamp)

node.create_subscription(Odometry, "/ego/odom", drive, 100)
rclpy.spin(node)
"""


@pytest.mark.slow
def test_commands_without_stamps_are_one_line_and_the_drive_ends(simbev: Simbev, tmp_path: Path) -> None:
    output, opened = drive(simbev, tmp_path, UNSTAMPED)
    with opened as bag:
        assert bag.custom_data["ended"].startswith("ego stood still for 3 s")
    (line,) = [line for line in output.splitlines() if "planned_path" in line]
    assert "header.stamp must be that of the input" in line
