"""The planner of drives, against what the equations of motion and the geometry of a route say."""

from typing import Any

import numpy as np
import pytest

from simbev_ros.reference_stack.driving.others import Others
from simbev_ros.reference_stack.driving.planner import Planner, ends_of
from simbev_ros.reference_stack.driving.route_line import RouteLine

TICK_S, LENGTH_M, WIDTH_M = 0.05, 4.8, 2.0


def route(points_m: Any, limit_mps: float = 10.0, lane: str = "a") -> dict[str, Any]:
    points = np.asarray(points_m, np.float64)
    distance_m = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    count = len(points)
    columns = {"x_m": points[:, 0], "y_m": points[:, 1], "distance_m": distance_m, "limit_mps": [limit_mps] * count}
    return {**columns, "lane": [lane] * count}


STRAIGHT = np.stack([np.arange(201.0), np.zeros(201)], axis=1)


def others(*rows: tuple[float, float, float, float, float]) -> Others:
    """Cars (x, y, yaw, vx, vy)."""
    table = np.array(rows, np.float64).reshape(-1, 5)
    none = np.zeros(len(table))
    size_m = np.tile([4.5, 1.9], (len(table), 1))
    return Others(table[:, :2], table[:, 2], table[:, 3:], none, none, size_m)


def drive(rows: Any, stops_m: list[float], seconds: float, speed_mps: float = 0.0) -> list[tuple[float, float, float]]:
    """Positions, speeds and accelerations of a vehicle that follows its plans exactly; rows as a function of time."""
    planner, x_m, driven = Planner(RouteLine(route(STRAIGHT)), LENGTH_M, WIDTH_M, TICK_S), 10.0, []
    for tick in range(round(seconds / TICK_S)):
        planner.advance_to(np.array([x_m, 0.0]))
        motion = planner.plan(speed_mps, others(*rows(tick * TICK_S)), stops_m)
        x_m, speed_mps = float(motion.distance_m[1]), float(motion.speed_mps[1])
        driven.append((x_m, speed_mps, float(motion.acceleration_mps2[0])))
    return driven


def test_a_free_road_is_driven_at_its_limit_and_comfortably() -> None:
    driven = np.array(drive(lambda _: (), [], 15.0))
    assert driven[-1, 1] == pytest.approx(10.0, abs=0.1)
    assert driven[:, 1].max() <= 10.0
    assert np.abs(driven[:, 2]).max() <= 1.5 + 1e-9
    assert np.abs(np.diff(driven[:, 2])).max() / TICK_S <= 3.0 + 1e-9


def test_the_front_stops_before_a_line_within_the_zone_of_a_stop_sign() -> None:
    x_m, speed_mps, _ = drive(lambda _: (), [80.0], 20.0)[-1]
    assert speed_mps < 0.05
    assert 0.3 < 80.0 - (x_m + LENGTH_M / 2.0) < 2.0


def test_a_line_that_nobody_could_stop_at_any_more_is_passed() -> None:
    assert drive(lambda _: (), [10.0 + LENGTH_M / 2.0 + 1.0], 1.0, speed_mps=10.0)[-1][1] > 9.0


def test_a_standing_car_ends_the_way_at_the_gap_of_the_driver_model() -> None:
    x_m, speed_mps, _ = drive(lambda _: ((90.0, 0.0, 0.0, 0.0, 0.0),), [], 30.0)[-1]
    assert speed_mps < 0.3
    assert 90.0 - 4.5 / 2.0 - (x_m + LENGTH_M / 2.0) == pytest.approx(2.5, abs=0.7)


def test_a_slower_car_is_followed_at_its_speed() -> None:
    driven = drive(lambda time_s: ((40.0 + 4.0 * time_s, 0.0, 0.0, 4.0, 0.0),), [], 25.0)
    assert driven[-1][1] == pytest.approx(4.0, abs=0.2)


def test_a_car_in_the_next_lane_changes_nothing() -> None:
    beside = drive(lambda _: ((40.0, 3.2, 0.0, 0.0, 0.0),), [], 8.0)
    assert beside == drive(lambda _: (), [], 8.0)


def test_what_crosses_the_path_at_the_same_time_passes_first() -> None:
    """A car from the right at 8 m/s would be at x = 45 m when the vehicle is."""
    crossing = lambda time_s: ((45.0, -32.0 + 8.0 * time_s, np.pi / 2.0, 0.0, 8.0),)  # noqa: E731
    closest_m = min(
        max(abs(45.0 - x_m) - (LENGTH_M + 1.9) / 2.0, abs(-32.0 + 8.0 * (tick + 1) * TICK_S) - (WIDTH_M + 4.5) / 2.0)
        for tick, (x_m, *_) in enumerate(drive(crossing, [], 12.0, speed_mps=9.0))
    )
    assert closest_m > 0.5
    assert drive(crossing, [], 12.0, speed_mps=9.0)[-1][1] > 8.0


def test_a_bend_is_slow_enough_for_its_radius_and_so_is_what_comes_before_it() -> None:
    angle_rad = np.linspace(0.0, np.pi / 2.0, 33)[1:]
    arc = np.stack([100.0 + 20.0 * np.sin(angle_rad), 20.0 - 20.0 * np.cos(angle_rad)], axis=1)
    line = RouteLine(route(np.concatenate([STRAIGHT[:101], arc]), 14.0))
    middle = np.searchsorted(line.distance_m, 115.0)
    assert line.speed_mps[middle] == pytest.approx(np.sqrt(2.0 * 20.0), rel=0.03)
    slowing_mps2 = -np.diff(line.speed_mps[:middle] ** 2) / 2.0 / np.diff(line.distance_m[:middle])
    assert slowing_mps2.max() <= 1.3 + 1e-6


def test_positions_are_projected_onto_the_route_and_its_straight_extensions() -> None:
    line = RouteLine(route([(0.0, 0.0), (10.0, 0.0), (10.0, 10.0)]))
    along_m, left_m = line.project(np.array([(4.0, 2.0), (12.0, 6.0), (-3.0, -1.0), (10.0, 14.0)]), 0.0, 20.0)
    np.testing.assert_allclose(along_m, [4.0, 16.0, -3.0, 24.0])
    np.testing.assert_allclose(left_m, [2.0, -2.0, -1.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(line.points_at(np.array([-3.0, 24.0])), [(-3.0, 0.0), (10.0, 14.0)])


def test_beyond_the_searched_part_nothing_is_beside_the_route() -> None:
    _, left_m = RouteLine(route(STRAIGHT)).project(np.array([(150.0, 0.0)]), 0.0, 80.0)
    assert np.isinf(left_m).all()


LANE_M = 3.5
BLOCK = 90.0, 0.0, 0.0, 0.0, 0.0


def pass_by(rows: Any, seconds: float, last_m: float = 200.0) -> np.ndarray:
    """(K, 3) time, x and y of a vehicle with a lane to its left, which ends somewhere; it follows its plans exactly."""
    line, position_m, speed_mps, driven = RouteLine(route(STRAIGHT)), np.array([10.0, 0.0]), 0.0, []
    beside_m = np.where(STRAIGHT[:, :1] < last_m, LANE_M, np.nan)
    planner = Planner(line, LENGTH_M, WIDTH_M, TICK_S, beside_m)
    for tick in range(round(seconds / TICK_S)):
        planner.advance_to(position_m)
        motion = planner.plan(speed_mps, others(*rows(tick * TICK_S)), [])
        position_m, speed_mps = planner.line.points_at(motion.distance_m[1:2])[0], float(motion.speed_mps[1])
        driven.append((tick * TICK_S, *position_m))
    return np.array(driven)


def gaps_m(driven: np.ndarray, x_m: Any, y_m: float) -> np.ndarray:
    """(K,) distances between a driven vehicle and a car, both along the road, in the larger direction."""
    along_m = np.abs(driven[:, 1] - x_m) - (LENGTH_M + 4.5) / 2.0
    return np.maximum(along_m, np.abs(driven[:, 2] - y_m) - (WIDTH_M + 1.9) / 2.0)


def test_what_stands_in_the_lane_is_passed_beside_it_and_the_route_taken_again() -> None:
    driven = pass_by(lambda _: (BLOCK,), 19.0)
    beside = np.abs(driven[:, 1] - 90.0) < 2.2
    assert driven[beside, 2] == pytest.approx(LANE_M, abs=0.01)
    assert gaps_m(driven, 90.0, 0.0).min() > 0.8
    assert driven[-1, 1] > 150.0 and driven[-1, 2] == 0.0


def test_with_ticks_of_a_second_what_stands_in_the_lane_is_passed_too() -> None:
    planner = Planner(RouteLine(route(STRAIGHT)), LENGTH_M, WIDTH_M, 1.0, np.full((len(STRAIGHT), 1), LANE_M))
    for _ in range(8):
        planner.advance_to(np.array([70.0, 0.0]))
        planner.plan(0.0, others(BLOCK), [])
    assert planner.line.points_at(np.array([90.0]))[0, 1] == pytest.approx(LANE_M, abs=0.01)


def test_one_that_has_only_just_stopped_is_waited_for() -> None:
    stops = lambda time_s: ((min(40.0 + 8.0 * time_s, 120.0), 0.0, 0.0, 8.0 * (time_s < 10.0), 0.0),)  # noqa: E731
    driven = pass_by(stops, 25.0)
    assert np.all(driven[driven[:, 0] < 16.0, 2] == 0.0)
    assert driven[-1, 1] > 150.0


def test_nobody_who_comes_in_the_other_lane_is_met_there() -> None:
    """Five cars, one each 4 s, are let by before."""
    x_m = [lambda time_s, first=first: 170.0 + first - 8.0 * time_s for first in range(0, 160, 32)]
    driven = pass_by(lambda time_s: (BLOCK, *((each(time_s), LANE_M, np.pi, -8.0, 0.0) for each in x_m)), 60.0)
    assert min(gaps_m(driven, each(driven[:, 0]), LANE_M).min() for each in x_m) > 1.0
    out_s = driven[np.argmax(driven[:, 2] > 0.5), 0]
    assert out_s > 20.0 and driven[-1, 1] > 150.0


@pytest.mark.parametrize(
    ("more", "last_m"),
    [
        pytest.param((), 100.0, id="before a junction"),
        pytest.param(((102.0, 0.0, 0.0, 1.0, 0.0),), 200.0, id="behind traffic"),
        pytest.param(((88.0, LANE_M, 0.0, 0.0, 0.0),), 200.0, id="beside another"),
    ],
)
def test_what_waits_or_leaves_no_room_is_not_passed(more: Any, last_m: float) -> None:
    driven = pass_by(lambda _: (BLOCK, *more), 25.0, last_m)
    assert np.all(driven[:, 2] == 0.0)
    assert driven[-1, 1] < 90.0


def test_ends_of_lanes_are_where_the_route_leaves_them() -> None:
    lanes = ["a", "a", "b", "c", "c"]
    assert ends_of(lanes, np.arange(5.0), frozenset("ac")) == [("a", 1.0)]


PARKED = 90.0, -2.9, 0.0, 0.0, 0.0


def drive_beside(
    rows: Any, room_m: float, seconds: float = 14.0, grip: float = 1.0, speed_mps: float = 8.0, lane: float = np.nan
) -> np.ndarray:
    """(K, 3) x, y and speed of a vehicle with some room in its lane, and maybe another lane to its left."""
    line = RouteLine(route(STRAIGHT), grip)
    rooms_m, position_m, driven = np.full(201, room_m), np.array([10.0, 0.0]), []
    planner = Planner(line, LENGTH_M, WIDTH_M, TICK_S, np.full((201, 1), lane), rooms_m, grip)
    for tick in range(round(seconds / TICK_S)):
        planner.advance_to(position_m)
        motion = planner.plan(speed_mps, rows(tick * TICK_S), [])
        position_m, speed_mps = planner.line.points_at(motion.distance_m[1:2])[0], float(motion.speed_mps[1])
        driven.append((*position_m, speed_mps))
    return np.array(driven)


def test_a_vehicle_keeps_away_from_what_is_parked_beside_its_lane_as_far_as_the_lane_has_room() -> None:
    driven = drive_beside(lambda _: others(PARKED), 0.6)
    assert driven[np.abs(driven[:, 0] - 90.0) < 2.0, 1] == pytest.approx(0.6)
    assert driven[driven[:, 0] < 50.0, 1] == pytest.approx(0.0)
    assert driven[-1, 1] == pytest.approx(0.0)
    assert np.abs(np.diff(driven[:, 1])).max() < 0.03
    assert driven[:, 1].max() <= 0.6 + 1e-9


def test_what_is_parked_far_enough_away_or_on_both_sides_moves_nobody() -> None:
    for rows in (((90.0, -3.7, 0.0, 0.0, 0.0),), (PARKED, (90.0, 2.9, 0.0, 0.0, 0.0))):
        assert np.all(drive_beside(lambda _, rows=rows: others(*rows), 0.6)[:, 1] == 0.0)


def test_without_room_a_slippery_road_is_driven_slowly_beside_what_is_parked() -> None:
    beside = [
        driven[np.abs(driven[:, 0] - 90.0) < 3.0, 2].max()
        for driven in (drive_beside(lambda _: others(PARKED), 0.0, 30.0, grip) for grip in (1.0, 0.25))
    ]
    assert beside[0] > 9.0
    assert beside[1] < 2.0 * 7.8 * 0.25 * 0.8 + 0.3


def test_an_open_door_is_passed_partly_in_the_lane_beside() -> None:
    """The door opens when the vehicle is near, and reaches to within 0.9 m of the middle of the lane."""
    opened = others((PARKED[0], -2.4, *PARKED[2:]))
    opened.size_m[0, 1] = 3.0
    driven = drive_beside(lambda time_s: opened if time_s > 6.0 else others(PARKED), 0.2, 20.0, lane=LANE_M)
    beside = np.abs(driven[:, 0] - 90.0) < (LENGTH_M + 4.5) / 2.0
    assert driven[-1, 0] > 140.0
    assert (driven[beside, 1] - WIDTH_M / 2.0).min() > -0.9 + 0.25
    assert driven[:, 1].max() < 1.0


def test_on_ice_braking_begins_earlier_and_never_asks_for_more_than_the_road_gives() -> None:
    """A car stands on the lane from 60 m on."""
    for grip, most_mps2 in ((1.0, 7.5), (0.25, 7.8 * 0.25)):
        driven = drive_beside(lambda _: others((110.0, 0.0, 0.0, 0.0, 0.0)), 0.0, 40.0, grip)
        assert -np.diff(driven[:, 2]).min() / TICK_S <= most_mps2 + 1e-6
        assert driven[-1, 0] + LENGTH_M / 2.0 < 110.0 - 4.5 / 2.0
    first_m = [
        driven[np.argmax(np.diff(driven[:, 2]) < -1e-3), 0]
        for driven in (
            drive_beside(lambda _: others((110.0, 0.0, 0.0, 0.0, 0.0)), 0.0, 40.0, grip, 9.9) for grip in (1.0, 0.25)
        )
    ]
    assert first_m[1] < first_m[0] - 5.0


def test_one_that_overtakes_and_cuts_in_far_ahead_is_not_braked_for() -> None:
    """It is beside the vehicle after 1 s, and drifts into its lane with 1 m/s."""
    overtakes = lambda time_s: ((2.0 + 18.0 * time_s, 3.5 - 1.0 * time_s, -0.055, 18.0, -1.0),)  # noqa: E731
    assert min(acceleration for *_, acceleration in drive(overtakes, [], 3.0, speed_mps=8.0)) > -0.5
