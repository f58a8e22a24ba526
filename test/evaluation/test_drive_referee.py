"""The referee on hand-made drives whose infractions follow from their geometry."""

import analytic_maps
import numpy as np
import pytest
from drive_cases import (
    EGO_ID,
    LEFT_M,
    LIMIT_MPS,
    RIGHT_M,
    TICK_S,
    actor,
    braking,
    drive,
    network,
    spec,
    state,
    straight,
    with_lane,
)

from simbev_ros.evaluation.driving.infractions import Infraction, InfractionKind
from simbev_ros.evaluation.driving.moment import Moment
from simbev_ros.evaluation.driving.rules.lanes import RoadPlaces
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import Table
from simbev_ros.schema.scene.state import Behavior, SignalState

K = InfractionKind


def of_kind(found: list[Infraction], *kinds: K) -> list[Infraction]:
    return [each for each in found if each.kind in kinds]


def test_a_drive_to_the_goal_within_all_rules_has_no_infraction() -> None:
    referee, found = drive(straight(10.0), 40.0)
    record = referee.record
    assert found == []
    assert (record.completed, record.ended) == (1.0, "goal")
    assert record.driven_m == pytest.approx(298.0, abs=0.5)
    assert record.duration_s == pytest.approx(29.8, abs=2 * TICK_S)
    assert record.outside_m == record.overspeed_m == record.max_off_road_m == record.max_oncoming_m == 0.0


def test_ego_that_hits_a_standing_car_is_at_fault_at_the_speed_before_the_impact() -> None:
    wall_m = 50.0 + 4.0  # center of the car whose rear the front reaches at x = 50
    found = drive(
        lambda t: (min(10.0 + 8.0 * t, 50.0), RIGHT_M, 0.0), 8.0, others=lambda t: [actor(2, straight(0, wall_m), t)]
    )[1]
    (crash,) = of_kind(found, K.VEHICLE_COLLISION)
    assert (crash.at_fault, crash.other, crash.vulnerable) == (True, "2", False)
    assert crash.tick * TICK_S == pytest.approx(5.0, abs=TICK_S)
    assert crash.value == crash.speed_mps == pytest.approx(8.0)


def test_ego_that_is_hit_from_behind_is_not_at_fault() -> None:
    found = drive(straight(5.0, 30.0), 6.0, others=lambda t: [actor(2, straight(9.0, 10.0), t)])[1]
    (crash,) = of_kind(found, K.VEHICLE_COLLISION)
    assert not crash.at_fault
    assert crash.tick * TICK_S == pytest.approx((30.0 - 10.0 - 4.0) / 4.0, abs=TICK_S)
    assert crash.value == pytest.approx(4.0)


def test_ego_that_stands_is_not_at_fault() -> None:
    crossing = straight(6.0, 50.0, -20.0, np.pi / 2)
    found = drive(straight(0.0, 50.0), 4.0, others=lambda t: [actor(2, crossing, t, Tag.BICYCLE)])[1]
    (crash,) = of_kind(found, K.VEHICLE_COLLISION)
    assert (crash.at_fault, crash.vulnerable) == (False, True)


@pytest.mark.parametrize(("y_m", "at_fault"), [(RIGHT_M, False), (-0.5, True)])
def test_ego_that_is_hit_in_its_side_is_at_fault_unless_it_keeps_to_its_lane(y_m: float, at_fault: bool) -> None:
    drifting = straight(10.0, 10.0, 4.0, -0.1)
    found = drive(straight(10.0, 10.0, y_m), 8.0, others=lambda t: [actor(2, drifting, t)])[1]
    assert of_kind(found, K.VEHICLE_COLLISION)[0].at_fault is at_fault


def test_a_pedestrian_whom_the_front_hits_is_hit_once() -> None:
    walking = straight(1.0, 60.0, RIGHT_M - 5.0, np.pi / 2)
    found = drive(straight(10.0, 10.0), 8.0, others=lambda t: [actor(2, walking, t, Tag.PEDESTRIAN, (0.5, 0.5, 1.8))])[
        1
    ]
    (hit,) = of_kind(found, K.PEDESTRIAN_COLLISION)
    assert (hit.at_fault, hit.vulnerable) == (True, True)


def test_a_bridge_above_and_what_touched_from_the_start_are_no_collisions() -> None:
    def others(time_s: float) -> list[Table]:
        above = actor(2, straight(0.0, 50.0), time_s)
        above["z"] = 5.0
        return [above, actor(3, straight(10.0, 6.5), time_s)]

    assert not of_kind(drive(straight(10.0), 8.0, others=others)[1], K.VEHICLE_COLLISION)


@pytest.mark.parametrize(
    ("red_from_s", "red_until_s", "is_infraction"),
    [(0.0, 60.0, True), (0.0, 8.6, False), (8.9, 60.0, False)],
)
def test_red_light_counts_at_the_moment_at_which_the_front_crosses_the_line(
    red_from_s: float, red_until_s: float, is_infraction: bool
) -> None:
    # 10 m/s from x = 10: the front crosses x = 100 at 8.8 s, the center at 9.0 s
    def light(time_s: float) -> SignalState:
        return SignalState.RED if red_from_s <= time_s < red_until_s else SignalState.GREEN

    found = of_kind(drive(straight(10.0), 12.0, roads=network(signal=True), light=light)[1], K.RED_LIGHT)
    assert [each.other for each in found] == ["in"] * is_infraction
    assert [each.tick * TICK_S for each in found] == pytest.approx([9.05] * is_infraction)


def test_a_car_that_stops_with_its_front_behind_the_line_has_not_run_the_red_light() -> None:
    stops = braking(10.0, 5.0, 7.9)  # stops at x = 10 + 79 + 10 = 99, front at 101
    found = drive(stops, 20.0, roads=network(signal=True), light=lambda _: SignalState.RED)[1]
    assert not of_kind(found, K.RED_LIGHT)


def test_traffic_of_the_other_direction_does_not_run_our_red_light() -> None:
    found = drive(
        straight(10.0, 150.0, LEFT_M, np.pi), 8.0, roads=network(signal=True), light=lambda _: SignalState.RED
    )[1]
    assert not of_kind(found, K.RED_LIGHT)


@pytest.mark.parametrize(("stands_at_m", "is_infraction"), [(97.0, False), (94.5, True), (None, True)])
def test_a_stop_sign_wants_standstill_within_4_m_before_the_line(
    stands_at_m: float | None, is_infraction: bool
) -> None:
    def at(time_s: float) -> tuple[float, float, float]:
        if stands_at_m is None:
            return 80.0 + 5.0 * time_s, RIGHT_M, 0.0
        front_m = 82.0 + 5.0 * time_s
        waited = max(front_m - stands_at_m, 0.0)
        return min(front_m, stands_at_m) - 2.0 + max(waited - 10.0, 0.0), RIGHT_M, 0.0

    found = of_kind(drive(at, 12.0, roads=network(stop=True))[1], K.STOP_SIGN)
    assert [each.other for each in found] == ["in"] * is_infraction


def test_an_emergency_vehicle_behind_must_be_let_pass_within_10_s() -> None:
    scene = spec(vehicles=[{"emergency_lights": True}, {"emergency_lights": False}])

    def follow(t: float) -> list[Table]:
        return [actor(2, straight(8.0, 0.0), t)]

    found = of_kind(drive(straight(8.0), 14.0, scene, others=follow)[1], K.YIELD)
    assert [(each.other, round(each.tick * TICK_S)) for each in found] == [("2", 10)]

    def beside(t: float) -> tuple[float, float, float]:
        return (10.0 + 8.0 * t, RIGHT_M - 2.2, 0.0)

    assert not of_kind(drive(beside, 14.0, scene, others=follow)[1], K.YIELD)

    def plain(t: float) -> list[Table]:
        return [actor(3, straight(8.0, 0.0), t)]

    assert not of_kind(drive(straight(8.0), 14.0, scene, others=plain)[1], K.YIELD)


def test_a_queue_ahead_holds_an_emergency_vehicle_up_and_not_the_ego_that_stands_in_it() -> None:
    scene = spec(vehicles=[{"emergency_lights": True}])

    def queue(leaves_s: float) -> list[Infraction]:
        def others(t: float) -> list[Table]:
            return [actor(2, straight(0.0, 0.0), t), actor(3, straight(0.0, 17.0 if t < leaves_s else 60.0), t)]

        return of_kind(drive(straight(0.0), 24.0, scene, others=others)[1], K.YIELD)

    assert not queue(leaves_s=30.0)
    assert [round(each.tick * TICK_S) for each in queue(leaves_s=5.0)] == [15]


def test_driving_in_the_lane_of_the_other_direction_counts_by_meters_within_a_second() -> None:
    referee, found = drive(straight(5.0, 10.0, LEFT_M), 10.0)
    (wrong,) = of_kind(found, K.WRONG_DIRECTION)
    assert wrong.tick * TICK_S == pytest.approx(2.0 / 5.0, abs=2 * TICK_S)
    assert referee.record.max_oncoming_m == pytest.approx(5.0)
    assert referee.record.outside_share == pytest.approx(1.0)


def test_crossing_the_other_lane_is_not_driving_against_it() -> None:
    referee, found = drive(straight(5.0, 50.0, -2.0, np.radians(75.0)), 0.9)
    assert referee.record.max_oncoming_m == pytest.approx(0.5 * 5.0 * np.cos(np.radians(75.0)), abs=0.2)
    assert (of_kind(found, K.WRONG_DIRECTION), referee.record.outside_m) == ([], 0.0)


def test_off_the_road_counts_from_30_cm_beyond_the_pavement() -> None:
    # the road ends at y = -3.5, and the right side of the car is 1 m to the right of its center
    for y_m, off_m in ((-2.7, 0.2), (-3.0, 0.5)):
        referee, found = drive(straight(10.0, 10.0, y_m), 5.0)
        assert referee.record.max_off_road_m == pytest.approx(off_m, abs=0.02)
        assert len(of_kind(found, K.OFF_ROAD)) == (off_m > 0.3)
        assert referee.record.outside_m == 0.0
    referee, _ = drive(lambda t: (10.0 + 10.0 * t, RIGHT_M if t <= 5.0 else -4.2, 0.0), 10.0)
    assert referee.record.outside_share == pytest.approx(0.5, abs=0.02)


def test_a_bridge_is_one_road_with_those_before_and_behind_it_and_apart_from_the_one_below() -> None:
    places = RoadPlaces(analytic_maps.crossing())

    def at(x_m: float, y_m: float, z_m: float, yaw_rad: float) -> Moment:
        row = actor(EGO_ID, straight(0.0, x_m, y_m, yaw_rad), 0.0)
        row["z"] = z_m
        return Moment(state(spec(), 0, [row]), TICK_S, None, 0.0)

    for x_m in np.arange(100.0, 400.0, 7.3).tolist():
        above = at(x_m, 252.625, 7.0 * np.exp(-(((x_m - 256.0) / 110.0) ** 4)), 0.0)
        assert places.off_road_m(above, above.corners_m).max() == 0.0, x_m
        assert places.lane_headings(above) == pytest.approx(np.array([[1.0, 0.0]]))
    below = at(257.75, 252.0, 0.0, np.pi / 2)
    assert places.off_road_m(below, below.corners_m).max() == 0.0
    assert places.lane_headings(below) == pytest.approx(np.array([[0.0, 1.0]]))
    beside = at(265.0, 252.0, 0.0, np.pi / 2)
    assert places.off_road_m(beside, beside.corners_m).max() > 3.0


def test_the_limit_in_a_junction_is_the_highest_of_the_lanes_around() -> None:
    roads = with_lane(network(), "inside", speed_mps=5.0)
    referee, found = drive(straight(LIMIT_MPS - 1.0), 10.0, roads=roads)
    assert (found, referee.record.overspeed_m) == ([], 0.0)
    roads = with_lane(with_lane(roads, "in", speed_mps=10.0), "out", speed_mps=20.0)
    referee, found = drive(straight(12.0), 12.0, roads=roads)
    assert [each.value for each in of_kind(found, K.SPEED_LIMIT)] == pytest.approx([2.0])
    assert referee.record.overspeed_m == pytest.approx(2.0 * 90.0 / 12.0, abs=0.2)


def test_standstill_ends_the_drive_and_what_follows_is_free() -> None:
    scene = spec(standstill_s=10.0)
    referee, found = drive(lambda t: (40.0 if t < 15.0 else 40.0 + 100.0 * (t - 15.0), RIGHT_M, 0.0), 18.0, scene)
    assert [(each.kind, each.tick * TICK_S) for each in found] == [(K.STANDSTILL, pytest.approx(9.95))]
    assert referee.record.ended == "standstill"
    assert referee.record.completed == pytest.approx(30.0 / 300.0)


def test_speed_is_compared_with_the_moving_traffic_nearby_four_times_up_to_the_goal() -> None:
    def others(time_s: float) -> list[Table]:
        parked = actor(4, straight(0.0, 15.0, -6.0), time_s)
        parked["behavior"] = Behavior.PARKED
        lanes = [actor(2, straight(6.0, x_m, LEFT_M), time_s) for x_m in (30.0, -60.0, -150.0)]
        return [*lanes, parked, actor(5, straight(20.0, 900.0), time_s)]

    _, found = drive(straight(3.0), 40.0, spec(goal_m=110.0), others=others)
    slow = of_kind(found, K.MIN_SPEED)
    # the goal is reached after 98 m; traffic that starts at 2 m/s² is at 6 m/s after 3 s, and 9 m behind
    assert [round(each.position_m[0], 1) for each in slow] == pytest.approx([34.5, 59.0, 83.5, 108.0], abs=0.15)
    assert slow[0].value == pytest.approx(24.5 / (2.0 * 24.5 - 9.0), rel=0.01)
    assert [each.value for each in slow[1:]] == pytest.approx([0.5] * 3)


def test_an_ego_that_starts_as_the_traffic_could_have_done_is_not_slow() -> None:
    def start(time_s: float) -> tuple[float, float, float]:
        until_s = min(time_s, 5.0)
        return 10.0 + until_s**2 + 10.0 * (time_s - until_s), RIGHT_M, 0.0

    def fast(time_s: float) -> list[Table]:
        return [actor(2, straight(9.9, x_m, LEFT_M), time_s) for x_m in (0.0, -30.0)]

    assert not of_kind(drive(start, 40.0, others=fast)[1], K.MIN_SPEED)
    late = drive(lambda time_s: start(max(time_s - 1.0, 0.0)), 40.0, others=fast)[1]
    assert len(of_kind(late, K.MIN_SPEED)) == 1


def test_time_to_collision_is_the_gap_over_the_closing_speed() -> None:
    referee, found = drive(straight(10.0), 3.0, others=lambda t: [actor(2, straight(4.0, 40.0), t)])
    # gap 26 m at the start, closing at 6 m/s: below 0.95 s when the gap is below 5.7 m
    first = of_kind(found, K.TIME_TO_COLLISION)
    assert first == []
    assert referee.record.min_time_to_collision_s == pytest.approx((26.0 - 18.0) / 6.0, abs=0.1)
    _, found = drive(straight(10.0), 4.2, others=lambda t: [actor(2, straight(4.0, 40.0), t)])
    (first,) = of_kind(found, K.TIME_TO_COLLISION)
    assert first.tick * TICK_S == pytest.approx((26.0 - 0.9 * 6.0) / 6.0, abs=2 * TICK_S)

    def beside(t: float) -> list[Table]:
        return [actor(2, straight(4.0, 40.0, LEFT_M), t)]

    assert drive(straight(10.0), 8.0, others=beside)[0].record.min_time_to_collision_s == np.inf


def test_hard_braking_begins_one_phase_of_discomfort() -> None:
    _, found = drive(braking(12.0, 6.0, 2.0), 6.0)
    (rough,) = of_kind(found, K.DISCOMFORT)
    assert rough.tick * TICK_S == pytest.approx(2.0, abs=2 * TICK_S)
    assert rough.value == pytest.approx(6.0 / 4.05, abs=0.8)
    assert not of_kind(drive(braking(12.0, 3.0, 2.0), 8.0)[1], K.DISCOMFORT)
