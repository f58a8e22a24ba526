"""A node drives a route in lockstep: stamped commands lead to the same bytes, however long the node thinks."""

import math
import signal
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from commands import SCENE, Simbev, write_small
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Odometry
from nav_msgs.msg import Path as PlannedPath
from std_msgs.msg import String
from subscriber import outside_node

from simbev_ros.dataset import open_dataset
from simbev_ros.evaluation.driving.recorded_drives import drives_of
from simbev_ros.join import Driver
from simbev_ros.recording.arrays import point_array
from simbev_ros.recording.digest import topic_digests
from simbev_ros.recording.reader import SceneBag
from simbev_ros.ros.msgs.stamps import header, stamp_of

pytestmark = pytest.mark.graph

SPEED_MPS = 6.0
MORE = "ego: {driver: path}\ngraph: {window_ticks: 3}\ndrive: {goal_m: 70, standstill_s: STANDSTILL}\n"


@pytest.fixture(autouse=True)
def no_leftovers() -> None:
    """The graph of the module runs on after each test."""


def route_planner(pauses_s: tuple[float, ...]) -> Callable[..., PlannedPath]:
    """A planner that drives along the route from its place at the time of the input; it thinks for some time."""
    begun_ns: list[int] = []

    def decide(inputs: dict[str, Any], scene: dict[str, Any]) -> PlannedPath:
        stamp_ns = stamp_of(inputs["/ego/odom"].header.stamp)
        begun_ns[:] = begun_ns or [stamp_ns]
        time.sleep(pauses_s[len(begun_ns) % len(pauses_s)])
        begun_ns.append(stamp_ns)
        route, plan = scene["drive"]["route"], PlannedPath()
        plan.header.frame_id = "map"
        for step in range(40):
            at_s = (stamp_ns - begun_ns[0]) / 1e9 + 0.1 * step
            along_m = SPEED_MPS * max(at_s - 1.0, 0.0)
            pose = PoseStamped(header=header(stamp_ns + step * 100_000_000, "map"))
            for axis in ("x", "y"):
                value = float(np.interp(along_m, route["distance_m"], route[f"{axis}_m"]))
                setattr(pose.pose.position, axis, value)
            plan.poses.append(pose)
        return plan

    return decide


def drive(simbev: Simbev, config: Path, folder: Path, decide: Callable[..., PlannedPath]) -> SceneBag:
    command = simbev("run", config, "--record", folder)
    with outside_node("driver") as (node, spin_until):
        driver = Driver(node, decide, {"/ego/odom": Odometry}, ("/ego/planned_path", PlannedPath))
        spin_until(lambda: command.process.poll() is not None)
        driver.lockstep.close()
    code, output = command.finish()
    assert code == 0, output
    return SceneBag(folder / SCENE)


def street(folder: Path, standstill_s: float = 20.0) -> Path:
    more = MORE.replace("STANDSTILL", f"{standstill_s:g}")
    config = write_small(folder, 30, more, without=["camera", "lidar", "radar"])
    config.write_text(config.read_text().replace("vehicles: 15, pedestrians: 15", "vehicles: 0, pedestrians: 0"))
    return config


@pytest.mark.slow
def test_a_planned_route_is_driven_to_its_goal_the_same_whatever_the_driver_takes(
    simbev: Simbev, tmp_path: Path
) -> None:
    config, digests = street(tmp_path), []
    for name, pauses_s in (("quick", (0.0,)), ("slow", (0.0, 0.05, 0.0, 0.01, 0.2))):
        with drive(simbev, config, tmp_path / name, route_planner(pauses_s)) as bag:
            assert bag.custom_data["complete"] == "true"
            assert "ego reached its goal" in bag.custom_data["ended"]
            digests.append(topic_digests(bag))
            rows = [point_array(bag.decode(each))[0] for each in bag.messages(["/drive/progress"])]
            status = [point_array(bag.decode(each))[0] for each in bag.messages(["/ego/vehicle_status"])]
        assert max(abs(row["lateral"]) for row in rows) < 0.4
        assert status[-1]["speed"] == pytest.approx(SPEED_MPS, abs=0.3)
        assert rows[-1]["remaining"] <= 5.0
    assert digests[0] == digests[1]


@pytest.mark.slow
def test_an_interrupted_drive_has_its_last_score_and_every_infraction(simbev: Simbev, tmp_path: Path) -> None:
    scores: list[String] = []
    command = simbev("run", street(tmp_path), "--record", tmp_path / "out")
    with outside_node("driver") as (node, spin_until):
        driver = Driver(node, route_planner((0.0,)), {"/ego/odom": Odometry}, ("/ego/planned_path", PlannedPath))
        node.create_subscription(String, "/drive/score", scores.append, 10)
        spin_until(lambda: len(scores) > 4)
        command.process.send_signal(signal.SIGINT)
        spin_until(lambda: command.process.poll() is not None)
        driver.lockstep.close()
    code, output = command.finish()
    assert code == 130, output
    (scene,) = open_dataset(tmp_path / "out", threads=1).scenes
    with SceneBag(tmp_path / "out" / SCENE) as bag:
        assert (bag.custom_data["ended"], bag.custom_data["complete"]) == ("interrupted", "true")
    score = dict(scene[-1]["drive/score"])
    assert score.pop("stamp_ns") == scene.stamps_ns[-1]
    (recorded,), (judged,) = drives_of([scene]), drives_of([scene], again=True)
    assert recorded.infractions == judged.infractions != ()
    assert score == judged.figures


@pytest.mark.slow
def test_impossible_commands_are_one_line_and_the_vehicle_stands(simbev: Simbev, tmp_path: Path) -> None:
    def decide(inputs: dict[str, Any], scene: dict[str, Any]) -> PlannedPath:
        plan = PlannedPath(poses=[PoseStamped(), PoseStamped()])
        plan.header.frame_id = "map"
        plan.poses[1].pose.position.x = math.nan
        return plan

    with drive(simbev, street(tmp_path, 3.0), tmp_path / "bad", decide) as bag:
        assert bag.custom_data["ended"].startswith("ego stood still for 3 s after 0.0 of 70")
