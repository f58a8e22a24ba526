from typing import Any

import pytest
from pydantic import ValidationError

from simbev_ros.config.drive import Drive, LanePoint
from simbev_ros.config.load import parse_scenario
from simbev_ros.config.places import SpawnPose
from simbev_ros.foundation.errors import InputError

START, GOAL = {"lane": "a_0", "s_m": 3.0}, {"x_m": 1.0, "y_m": 2.0}
POINTS = LanePoint(lane="a_0", s_m=3.0), SpawnPose(x_m=1.0, y_m=2.0)
BASE = "scenes: [{map: Town01, train: 1}, {map: Town02, train: 1}]\nrig: {sensors: []}\n"


@pytest.mark.parametrize("route", [[START, GOAL], {"from": START, "to": GOAL}, {"Town01": [START, GOAL]}])
def test_points_of_a_route_have_three_forms_and_survive_a_dump(route: Any) -> None:
    drive = Drive(route=route)
    assert drive.points_on("Town01")[1] == POINTS
    assert Drive.model_validate(drive.model_dump(mode="json")) == drive


def test_length_between_two_numbers_is_uniform() -> None:
    drive = Drive.model_validate({"goal_m": [100, 200]})
    assert drive.goal_m == Drive.model_validate({"goal_m": {"uniform": [100, 200]}}).goal_m
    assert drive.points_on("Town01") == (("route",), ())


@pytest.mark.parametrize(
    "section", [{"route": "random"}, {"route": [START]}, {"route": [1, 2]}, {"route": 5}, {"goal_m": [5, 10]}]
)
def test_other_routes_are_refused(section: dict[str, Any]) -> None:
    with pytest.raises(ValidationError):
        Drive.model_validate(section)


@pytest.mark.parametrize(
    ("more", "problem"),
    [
        (
            "ego: {spawn: [{x_m: 1, y_m: 2}]}\ndrive: {route: [{lane: a_0}, {lane: b_0}]}",
            "drive.route: ego.spawn is set, too; a route of points says where the vehicle drives",
        ),
        (
            "drive: {route: {Town01: [{lane: a_0}, {lane: b_0}]}}",
            "drive.route: must have points on each map with scenes, Town01, Town02; found Town01",
        ),
    ],
)
def test_contradictions_are_one_line_with_the_field(more: str, problem: str) -> None:
    with pytest.raises(InputError, match=problem):
        parse_scenario(BASE + more, "my.yaml")


def test_no_section_leaves_no_trace_in_the_stored_configuration() -> None:
    assert "\ndrive:" not in parse_scenario(BASE, "my.yaml").as_yaml()


def test_drivers_by_stamped_commands_are_waited_for_but_not_in_replays() -> None:
    agents = "ego: {driver: path}\nagents: [{name: bus, rig: {sensors: []}, driver: ackermann, count: 2}]\n"
    scenario = parse_scenario(BASE + agents, "my.yaml")
    assert scenario.participants == ("ego_driver", "bus_1_driver", "bus_2_driver")
    replayed = scenario.for_replay()
    assert (replayed.participants, replayed.is_driven_by_traffic) == ((), True)
    twist = parse_scenario(BASE + "ego: {driver: twist}", "my.yaml")
    assert (twist.participants, twist.for_replay()) == ((), twist)


@pytest.mark.parametrize(
    ("ego", "stack", "wanted"),
    [
        ("driver: traffic", "python3 mine.py", "ego.driver is traffic; it must be ackermann, trajectory or path"),
        ("driver: ackermann", "drive-truth", "ego.driver is ackermann; it must be path"),
    ],
)
def test_a_driver_must_drive_the_agent(ego: str, stack: str, wanted: str) -> None:
    with pytest.raises(InputError, match=f"drive.stack: drives nothing, as {wanted}"):
        parse_scenario(f"{BASE}ego: {{{ego}}}\ndrive: {{stack: {stack}}}\n", "mine")


def test_the_learned_driver_brings_the_stack_of_which_it_needs_the_boxes() -> None:
    scenario = parse_scenario(f"{BASE}ego: {{driver: path}}\ndrive: {{stack: drive-learned}}\n", "mine")
    assert scenario.participants == ("baseline_lidar", "ego_driver")
