"""Scenarios like Euro NCAP's: where everybody is at each second, by hand (TB 024, AEB and LSS test protocols)."""

import math
from pathlib import Path

import numpy as np
import pytest
from storyboard_stage import (
    LANE_M,
    Y_FAR_RIGHT,
    Y_LEFT,
    Y_RIGHT,
    Show,
    after,
    car,
    dynamics,
    event,
    follow,
    kmh,
    lane,
    person,
    placed,
    polyline,
    rest_after,
    sinusoid,
    speed,
    story,
    storyboard,
    straight,
    trigger,
    world,
)

from simbev_ros.scene.storyboard import model

CM = 0.01


@pytest.fixture
def road(tmp_path: Path) -> Path:
    return straight(tmp_path)


def gap(value_m: float, *, free: bool = True, kind: str = "longitudinal", other: str = "target") -> model.Element:
    return model.RelativeDistanceCondition(
        entity_ref=other, value_m=value_m, freespace=free, rule="lessOrEqual", relative_distance_type=kind
    )


def ttc(value_s: float, target: model.Element) -> model.Element:
    return model.TimeToCollisionCondition(
        value_s=value_s, freespace=False, rule="lessOrEqual", target=target, relative_distance_type="euclidianDistance"
    )


def test_a_car_reaches_a_standing_one(road: Path) -> None:  # CCRs, 50 km/h
    v = kmh(50.0)
    show = Show(
        road,
        [car("ego"), car("target")],
        storyboard(placed("ego", lane(100.0), v), placed("target", lane(170.0)), stop=touching()),
    )
    for second in range(1, 5):
        show.run_to(second)
        assert show.xy("ego") == pytest.approx((100.0 + v * second, Y_RIGHT), abs=CM)
        assert show.xy("target") == pytest.approx((170.0, Y_RIGHT), abs=CM)
        assert not show.storyboard.has_stopped
    show.run_to(6.0)
    contact_s = (170.0 - 100.0 - 4.0) / v  # when the boxes, 4 m long, touch
    assert show.storyboard.has_stopped
    assert contact_s == pytest.approx(4.752)


def touching() -> model.Element:
    return trigger(model.CollisionCondition(targets=(model.EntityRef(entity_ref="target"),)), who=["ego"])


def test_a_car_reaches_a_slower_one(road: Path) -> None:  # CCRm, 50 and 20 km/h
    fast, slow = kmh(50.0), kmh(20.0)
    brake = event(
        "brake",
        trigger(ttc(1.5, model.EntityRef(entity_ref="target")), who=["ego"]),
        speed(slow, "linear", "rate", 6.0),
    )
    show = Show(
        road,
        [car("ego"), car("target")],
        storyboard(placed("ego", lane(50.0), fast), placed("target", lane(100.0), slow), story(["ego"], brake)),
    )
    closing = fast - slow
    start_s = math.ceil((50.0 / closing - 1.5) / 0.05) * 0.05  # the first tick with (50 - closing t) / closing <= 1.5
    lasts_s = closing / 6.0
    for second in range(1, 9):
        show.run_to(second)
        t = max(second - start_s, 0.0)
        braked_m = 3.0 * min(t, lasts_s) ** 2 + closing * max(t - lasts_s, 0.0)
        assert show.xy("ego") == pytest.approx((50.0 + fast * second - braked_m, Y_RIGHT), abs=CM)
        assert show.xy("target") == pytest.approx((100.0 + slow * second, Y_RIGHT), abs=CM)
    assert show.times("start", "brake") == [pytest.approx(start_s)]


@pytest.mark.parametrize("deceleration", [2.0, 6.0])
@pytest.mark.parametrize("headway_m", [12.0, 40.0])
def test_the_car_ahead_brakes(road: Path, deceleration: float, headway_m: float) -> None:  # CCRb, 50 km/h
    v, bumper_m = kmh(50.0), 4.0
    braking = event("brake", after(1.0), speed(0.0, "linear", "rate", deceleration))
    show = Show(
        road,
        [car("ego"), car("target")],
        storyboard(
            placed("ego", lane(50.0), v),
            placed("target", model.RelativeLanePosition(entity_ref="ego", d_lane=0, ds_m=headway_m + bumper_m), v),
            story(["target"], braking),
        ),
    )
    distance = rest_after(v, deceleration)
    for second in range(1, 10):
        show.run_to(second)
        assert show.xy("ego")[0] == pytest.approx(50.0 + v * second, abs=CM)
        expected = 50.0 + headway_m + bumper_m + v * min(second, 1.0) + distance(max(second - 1.0, 0.0))
        assert show.xy("target") == pytest.approx((expected, Y_RIGHT), abs=CM)
        assert show["target"].speed_mps == pytest.approx(max(v - deceleration * max(second - 1.0, 0.0), 0.0), abs=1e-6)
    (ends_s,) = show.times("end", "brake")
    assert ends_s == pytest.approx(1.0 + v / deceleration, abs=0.05)


def test_a_pedestrian_steps_out_so_that_both_meet(road: Path) -> None:  # CPNA-50, 40 km/h
    v, walk = kmh(40.0), kmh(5.0)
    start_m, across_m = 300.0, -Y_RIGHT  # the pedestrian starts 4 m to the right of the ego's line
    begins = Y_RIGHT - 4.0
    time_s = 4.0 / walk  # of the walk to the ego's line
    cross = event("cross", trigger(ttc(time_s, world(start_m, Y_RIGHT)), who=["ego"]), speed(walk))
    show = Show(
        road,
        [car("ego"), person("target")],
        storyboard(
            placed("ego", lane(200.0), v),
            placed("target", world(start_m, begins, math.pi / 2.0)),
            story(["target"], cross),
        ),
    )
    (expected_s,) = [math.ceil(((start_m - 200.0) / v - time_s) / 0.05 - 1e-9) * 0.05]
    for second in range(1, 10):
        show.run_to(second)
        assert show.xy("ego")[0] == pytest.approx(200.0 + v * second, abs=CM)
        walked = walk * max(second - expected_s, 0.0)
        assert show.xy("target") == pytest.approx((start_m, begins + walked), abs=CM)
    assert show.times("start", "cross") == [pytest.approx(expected_s)]
    meets_s = expected_s + time_s
    assert 200.0 + v * meets_s == pytest.approx(start_m, abs=v * 0.05)  # within one tick
    assert across_m == pytest.approx(1.75)


def test_a_child_runs_from_behind_cars_with_the_times_of_its_trajectory(road: Path) -> None:  # CPNCO-50
    v = kmh(30.0)
    path = polyline((150.0, -9.0), (150.0, -5.0), (150.0, 5.0), times_s=(0.0, 2.0, 6.0))
    timing = model.Timing(domain_absolute_relative="relative", scale=1.0, offset_s=0.0)
    away = trigger(gap(60.0, free=False), who=["ego"])
    show = Show(
        road,
        [car("ego"), person("target"), car("parked")],
        storyboard(
            placed("ego", lane(50.0), v),
            placed("target", world(150.0, -9.0, math.pi / 2.0)),
            placed("parked", lane(146.0, -2)),
            story(["target"], event("run", away, follow(path, timing))),
        ),
    )
    start_s = math.ceil(40.0 / v / 0.05) * 0.05  # 60 m of 100 m are left
    for second in range(1, 12):
        show.run_to(second)
        t = min(max(second - start_s, 0.0), 6.0)
        y = -9.0 + 2.0 * t if t <= 2.0 else -5.0 + 2.5 * (t - 2.0)
        y += 2.5 * max(second - start_s - 6.0, 0.0)  # the speed is kept
        assert show.xy("target") == pytest.approx((150.0, y), abs=CM)
        assert show.xy("parked") == (146.0, pytest.approx(Y_FAR_RIGHT))


def test_a_bicycle_crosses_at_the_same_time_as_the_car_arrives(road: Path) -> None:  # CBNA, synchronized
    v = kmh(50.0)
    meet = model.SynchronizeAction(
        master_entity_ref="ego", target_position_master=world(200.0, Y_RIGHT), target_position=world(200.0, Y_RIGHT)
    )
    show = Show(
        road,
        [car("ego"), person("target")],
        storyboard(
            placed("ego", lane(100.0), v),
            placed("target", world(200.0, -21.75, math.pi / 2.0)),
            story(["target"], event("meet", after(0.0), meet)),
        ),
    )
    arrive_s = 100.0 / v  # 7.2 s, for 20 m
    for second in range(1, 8):
        show.run_to(second)
        assert show.xy("target") == pytest.approx((200.0, -21.75 + 20.0 * second / arrive_s), abs=CM)
    show.run_to(7.2)
    assert show.xy("target") == pytest.approx((200.0, Y_RIGHT), abs=CM)
    assert show.xy("ego") == pytest.approx((200.0, Y_RIGHT), abs=CM)
    show.run_to(7.3)
    assert show.times("end", "meet")


def test_the_car_turns_across_the_path_of_an_oncoming_one(road: Path) -> None:  # CCFtap, radius 8 m to the left
    v, radius = kmh(15.0), 8.0
    arc = model.Clothoid(
        curvature_per_m=1.0 / radius,
        curvature_prime_per_m2=0.0,
        length_m=radius * math.pi / 2.0,
        position=world(210.0, Y_RIGHT),
    )
    turn = event(
        "turn",
        trigger(model.ReachPositionCondition(position=world(210.0, Y_RIGHT), tolerance_m=v * 0.025), who=["ego"]),
        follow(model.Trajectory(name="arc", closed=False, shape=arc)),
    )
    show = Show(
        road,
        [car("ego"), car("target")],
        storyboard(
            placed("ego", lane(210.0 - 2.0 * v), v), placed("target", lane(260.0, 1), kmh(45.0)), story(["ego"], turn)
        ),
    )
    assert show.xy("target")[1] == Y_LEFT
    for second in range(1, 7):
        show.run_to(second)
        assert show.xy("target") == pytest.approx((260.0 - kmh(45.0) * second, Y_LEFT), abs=CM)  # the lane's direction
        along = v * (second - 2.0)
        if along <= 0.0:
            expected = (210.0 + along, Y_RIGHT)
        elif along <= radius * math.pi / 2.0:
            expected = (210.0 + radius * math.sin(along / radius), Y_RIGHT + radius * (1.0 - math.cos(along / radius)))
        else:
            expected = (210.0 + radius, Y_RIGHT + radius + along - radius * math.pi / 2.0)
        assert show.xy("ego") == pytest.approx(expected, abs=CM)
    assert show["ego"].yaw_rad == pytest.approx(math.pi / 2.0)


def test_the_car_drifts_out_of_its_lane(road: Path) -> None:  # LSS, 72 km/h, 0.5 m/s to the left
    v, rate = kmh(72.0), 0.5
    drift = model.LaneChangeAction(
        dynamics=dynamics("linear", "rate", rate), target=model.RelativeTargetLane(entity_ref="ego", value=1)
    )
    show = Show(
        road, [car("ego")], storyboard(placed("ego", lane(100.0), v), story(["ego"], event("drift", after(1.0), drift)))
    )
    for second in range(1, 9):
        show.run_to(second)
        shift = min(rate * max(second - 1.0, 0.0), LANE_M)
        along = v + math.sqrt(v**2 - rate**2) * (second - 1.0)  # 72 km/h is the speed in all
        assert show.xy("ego") == pytest.approx((100.0 + along, Y_RIGHT + shift), abs=CM)
    show.run_to(8.05)
    assert show.times("end", "drift") == [pytest.approx(8.0)]


def test_an_overtaker_changes_lanes_twice(road: Path) -> None:  # LSS, overtaking vehicle
    v = kmh(80.0)
    out = model.LaneChangeAction(
        dynamics=dynamics("sinusoidal", "time", 4.0), target=model.RelativeTargetLane(entity_ref="ego", value=1)
    )
    back = model.LaneChangeAction(
        dynamics=dynamics("cubic", "distance", 100.0), target=model.AbsoluteTargetLane(value=-2)
    )
    ended = trigger(
        model.StoryboardElementStateCondition(
            storyboard_element_type="event", storyboard_element_ref="out", state="completeState"
        )
    )
    show = Show(
        road,
        [car("ego")],
        storyboard(
            placed("ego", lane(0.0, -2), v), story(["ego"], event("out", after(1.0), out), event("back", ended, back))
        ),
    )
    fine_s = 1e-4  # the speed in all is 80 km/h: the one along the lane is integrated
    out_s = np.arange(0.0, 4.0, fine_s) + fine_s / 2.0
    along_out = np.cumsum(np.sqrt(v**2 - (LANE_M * math.pi / 8.0 * np.sin(math.pi * out_s / 4.0)) ** 2)) * fine_s
    back_m = np.arange(0.0, 100.0, 0.01) + 0.005
    arc_back = np.cumsum(np.hypot(1.0, LANE_M * 0.06 * back_m / 100.0 * (1.0 - back_m / 100.0))) * 0.01
    for second in range(1, 11):
        show.run_to(second)
        x = v + float(np.interp(second - 1.0, out_s, along_out, left=0.0))
        back = max(v * (second - 5.0), 0.0)
        beyond = max(back - arc_back[-1], 0.0)
        u = float(np.interp(back, arc_back, back_m, left=0.0, right=100.0)) / 100.0
        y = Y_FAR_RIGHT + LANE_M * (sinusoid((second - 1.0) / 4.0) - u * u * (3.0 - 2.0 * u))
        assert show.xy("ego") == pytest.approx((x + 100.0 * u + beyond, y), abs=CM)
