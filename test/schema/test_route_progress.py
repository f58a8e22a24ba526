"""Progress along a route and the end of a drive, on a made-up route that crosses itself."""

from itertools import pairwise

import numpy as np
import pytest

from simbev_ros.schema.scene.drive_spec import Command, DriveSpec, RouteSpec
from simbev_ros.schema.scene.drive_tables import COMMAND_NUMBERS, ProgressTables, route_table
from simbev_ros.schema.scene.route_progress import DriveEnd, DriveRule, RouteProgress
from simbev_ros.schema.scene.state import ACTOR_DTYPE

TICK_NS = 50_000_000


def route_of(corners: list[tuple[float, float]], turn: tuple[int, int] = (0, 0)) -> RouteSpec:
    """A route along straight lines between corners, with points 1 m apart; the rows of ``turn`` are a left turn."""
    parts = [np.linspace(a, b, round(np.hypot(*np.subtract(b, a))), endpoint=False) for a, b in pairwise(corners)]
    points_m = np.concatenate([*parts, [corners[-1]]])
    count = len(points_m)
    commands = [Command.FOLLOW] * count
    commands[slice(*turn)] = [Command.LEFT] * (turn[1] - turn[0])
    steps_m = np.linalg.norm(np.diff(points_m, axis=0), axis=1)
    return RouteSpec(
        x_m=tuple(points_m[:, 0]),
        y_m=tuple(points_m[:, 1]),
        z_m=(0.0,) * count,
        distance_m=(0.0, *np.cumsum(steps_m)),
        limit_mps=(10.0,) * count,
        lane=("a",) * count,
        command=tuple(commands),
    )


LINE = route_of([(0, 0), (100, 0)], turn=(40, 50))
LOOP = route_of([(0, 0), (60, 0), (60, 40), (30, 40), (30, -40)])


def test_progress_is_measured_along_and_beside_the_route() -> None:
    progress = RouteProgress(LINE).advance_to(np.array([20.5, 3.0]))
    assert (progress.distance_m, progress.lateral_m, progress.offset_m) == pytest.approx((20.5, 3.0, 3.0))
    assert (progress.remaining_m, progress.completed) == pytest.approx((79.5, 0.205))


def test_driving_back_does_not_undo_what_was_completed() -> None:
    follower = RouteProgress(LINE)
    follower.advance_to(np.array([20.0, 0.0]))
    progress = follower.advance_to(np.array([15.0, -1.0]))
    assert (progress.distance_m, progress.furthest_m, progress.lateral_m) == pytest.approx((15.0, 20.0, -1.0))
    assert progress.completed == pytest.approx(0.2)


def test_where_a_route_crosses_itself_the_position_belongs_to_the_part_that_comes() -> None:
    follower = RouteProgress(LOOP)
    found = [follower.advance_to(np.array(point)).distance_m for point in LOOP.points_m[:, :2]]
    assert found == pytest.approx(list(LOOP.distance_m))


def test_a_vehicle_beyond_the_ends_is_at_the_ends() -> None:
    follower = RouteProgress(LINE)
    assert follower.advance_to(np.array([-3.0, 0.0])).distance_m == 0.0
    for x in (50.0, 90.0, 103.0):
        progress = follower.advance_to(np.array([x, 0.0]))
    assert (progress.distance_m, progress.offset_m) == pytest.approx((100.0, 3.0))


@pytest.mark.parametrize(
    ("x", "command", "ahead_m"), [(10.0, "LEFT", 30.0), (45.0, "LEFT", 0.0), (60.0, "FOLLOW", 40.0)]
)
def test_next_command_comes_with_its_distance(x: float, command: str, ahead_m: float) -> None:
    follower = RouteProgress(LINE)
    follower.advance_to(np.array([x / 2.0, 0.0]))
    found = follower.next_command(follower.advance_to(np.array([x, 0.0])))
    assert found == (Command[command], pytest.approx(ahead_m))


def rule(**limits: float) -> DriveRule:
    return DriveRule(
        DriveSpec(route=LINE, **{"goal_radius_m": 5.0, "standstill_s": 1.0, "off_route_m": 10.0, **limits}), TICK_NS
    )


def end_of(drive: DriveRule, positions: list[tuple[float, float]], speed_mps: float) -> tuple[int, DriveEnd, str]:
    for tick, position in enumerate(positions):
        if (end := drive.end_at(tick, np.array(position), speed_mps)) is not None:
            return tick, *end
    raise AssertionError("the drive does not end")


def test_a_drive_ends_at_its_goal() -> None:
    tick, kind, words = end_of(rule(), [(x, 0.0) for x in range(101)], 20.0)
    assert (tick, kind, words) == (95, DriveEnd.GOAL, "ego reached its goal after 95.0 of 100.0 m at tick 95")


def test_a_drive_ends_in_standstill() -> None:
    tick, kind, words = end_of(rule(), [(7.0, 0.0)] * 40, 0.05)
    assert (tick, kind) == (19, DriveEnd.STANDSTILL)
    assert words == "ego stood still for 1 s after 7.0 of 100.0 m at tick 19"


def test_a_drive_ends_off_its_route() -> None:
    tick, kind, _ = end_of(rule(), [(20.0, y) for y in range(20)], 20.0)
    assert (tick, kind) == (11, DriveEnd.OFF_ROUTE)


def test_a_drive_ends_after_its_time() -> None:
    tick, kind, _ = end_of(rule(timeout_s=2.0), [(20.0, 0.0)] * 60, 1.0)
    assert (tick, kind) == (39, DriveEnd.TIMEOUT)


def test_tables_have_the_values_of_route_and_progress() -> None:
    table = route_table(LINE)
    assert table["distance"].tolist() == pytest.approx(list(LINE.distance_m))
    assert set(table["command"][40:50]) == {COMMAND_NUMBERS[Command.LEFT]}
    ego = np.zeros(1, ACTOR_DTYPE)[0]
    ego["x"], ego["y"], ego["yaw"] = 30.0, -1.5, 0.25
    (row,) = ProgressTables(LINE).table_at(ego)
    assert row.tolist() == pytest.approx((30.0, 70.0, -1.5, 0.25, 10.0, 10.0, COMMAND_NUMBERS[Command.LEFT]))
