import numpy as np
import pytest

from simbev_ros.simulation.world.kinematics.contacts import BodyBoxes
from simbev_ros.simulation.world.kinematics.followers import PursuingPoints, SteadyPoints, TowedPoints
from simbev_ros.simulation.world.kinematics.footing import ContactPoints
from simbev_ros.simulation.world.kinematics.motion import Bodies, Motion

TICK_S = 0.05


def body(trail_m=3.0, lead_m=2.0, leans=False, mounts_m=((0.0, 0.0, 0.0),)):
    return Bodies(
        point=np.zeros(len(mounts_m), np.int64),
        trail_m=np.array([trail_m]),
        lead_m=np.array([lead_m]),
        leans=np.array([leans]),
        mount_m=np.array(mounts_m),
        contacts=ContactPoints(np.zeros(1, np.int64), np.zeros(1), np.zeros(1)),
        boxes=BodyBoxes(np.ones((1, 3)), 1),
    )


def on_road(points_m):
    """(..., 4) points of bodies that stand on the road surface."""
    return np.concatenate([points_m, np.zeros((*points_m.shape[:-1], 1))], axis=-1)


def drive(bodies, points_m, direction=(1.0, 0.0, 0.0), half_window_ticks=7):
    motion = Motion(bodies, on_road(points_m[:1]), np.array([direction]), TICK_S, half_window_ticks)
    return motion, [motion.advance_motion(point_m[None]) for point_m in on_road(points_m)]


def circle(radius_m, speed_mps, ticks):
    angle = speed_mps / radius_m * TICK_S * np.arange(ticks)
    return np.stack([radius_m * np.sin(angle), radius_m * (1 - np.cos(angle)), np.zeros(ticks)], axis=-1)


def test_a_body_on_a_circle_turns_as_a_tractrix_does():
    _, states = drive(body(trail_m=3.0, lead_m=1.0), circle(10.0, 5.0, 600))
    last = states[-1]
    # In steady state the rear axle is on a circle of radius √(10² - 3²), and everything turns at v / R.
    rear_radius_m = np.sqrt(100.0 - 9.0)
    origin_radius_m = np.hypot(rear_radius_m, 2.0)
    assert np.hypot(*(last.position_m[0, :2] - [0, 10])) == pytest.approx(origin_radius_m, rel=5e-3)
    assert last.angular_velocity_radps[0, 2] == pytest.approx(0.5, rel=1e-3)
    assert last.speed_mps[0] == pytest.approx(0.5 * rear_radius_m, rel=1e-2)
    assert np.linalg.norm(last.acceleration_mps2[0]) == pytest.approx(0.25 * origin_radius_m, rel=5e-3)


def test_the_average_delays_but_does_not_slow_down():
    points_m = np.stack([0.4 * np.arange(60), np.zeros(60), np.zeros(60)], axis=-1)
    motion, states = drive(body(lead_m=2.0), points_m)
    assert states[-1].position_m[0, 0] == pytest.approx(points_m[-1 - motion.delay_ticks, 0] - 2.0)
    assert states[-1].velocity_mps[0, 0] == pytest.approx(8.0)


def test_a_jump_of_the_point_becomes_a_smooth_movement():
    points_m = np.zeros((60, 3))
    points_m[20:, 0] = 0.2
    _, states = drive(body(), points_m)
    steps = np.diff([state.position_m[0, 0] for state in states])
    assert steps.min() >= 0.0
    assert steps.max() < 0.2 * 0.15
    assert states[-1].position_m[0, 0] == pytest.approx(-1.8)


def test_a_body_at_rest_is_at_rest_to_the_last_bit_even_after_a_drive():
    points_m = np.concatenate([circle(7.0, 3.0, 100) + 0.1, np.repeat(circle(7.0, 3.0, 100)[-1:] + 0.1, 60, axis=0)])
    _, states = drive(body(leans=True), points_m)
    last = states[-1]
    for values in (last.velocity_mps, last.acceleration_mps2, last.angular_velocity_radps, last.rpy_rad[:, 0]):
        assert np.all(values == 0.0)


def test_a_two_wheeler_leans_to_the_left_in_a_left_curve():
    state = drive(body(trail_m=1.4, lead_m=0.9, leans=True), circle(12.0, 6.0, 400))[1][-1]
    assert state.rpy_rad[0, 0] == pytest.approx(-np.arctan(6.0**2 / 12.0 / 9.81), rel=0.05)


def test_a_rider_moves_rigidly_with_the_leaning_bicycle():
    state = drive(
        body(trail_m=1.4, lead_m=0.9, leans=True, mounts_m=((0.0, 0.0, 0.0), (-0.1, 0.0, 0.5))), circle(12.0, 6.0, 400)
    )[1][-1]
    offset_m = state.position_m[1] - state.position_m[0]
    assert np.linalg.norm(offset_m) == pytest.approx(np.hypot(0.1, 0.5))
    # The circle's center is at (0, 12): leaning in brings the rider closer to it.
    center_m = np.array([0.0, 12.0])
    nearer_m = np.hypot(*(state.position_m[0, :2] - center_m)) - np.hypot(*(state.position_m[1, :2] - center_m))
    assert nearer_m == pytest.approx(0.5 * np.sin(np.arctan(36.0 / 12.0 / 9.81)), rel=0.1)
    turned = state.velocity_mps[0] + np.cross(state.angular_velocity_radps[0], offset_m)
    np.testing.assert_allclose(state.velocity_mps[1], turned, atol=2e-3)


def test_yaw_rate_is_small_where_yaw_wraps_from_plus_to_minus_pi():
    motion = Motion(body(), np.zeros((1, 4)), np.array([[-1.0, 0.0, 0.0]]), TICK_S, 3)
    points_m = circle(20.0, 4.0, 80) * [-1.0, -1.0, 0.0]
    rates = [motion.advance_motion(point_m[None]).angular_velocity_radps[0, 2] for point_m in on_road(points_m)]
    assert np.abs(rates).max() == pytest.approx(0.2, rel=0.02)


def test_a_pursuing_point_keeps_its_speed_and_acceleration_limits_and_stops_at_its_target():
    target_m = np.zeros((200, 2, 3))
    target_m[:, 0, 0] = np.minimum(0.4 * np.arange(200), 40.0)  # runs at 8 m/s at once, and stops at once
    target_m[:, 1, 1] = np.where(np.arange(200) < 20, 0.0, 0.6)  # jumps aside
    change_m = 5.0 * TICK_S**2
    pursuit = PursuingPoints(target_m[0], np.array([0.5, 0.1]), change_m)
    points_m = np.array([pursuit.pursue(each) for each in target_m])
    steps_m = np.diff(points_m, axis=0)
    assert np.all(np.linalg.norm(steps_m, axis=2).max(axis=0) <= [0.5 + 1e-9, 0.1 + 1e-9])
    assert np.linalg.norm(np.diff(steps_m, axis=0), axis=2).max() < 1.3 * change_m
    assert points_m[..., 0].max() <= 40.0 + 1e-9
    assert np.array_equal(points_m[-30:], target_m[-30:])


def test_a_towed_point_follows_the_same_path_behind():
    angle = 0.03 * np.arange(1, 200)
    lead_m = np.stack([10.0 * np.sin(angle), 10.0 * (1.0 - np.cos(angle)), 0.0 * angle], axis=-1)
    tow = TowedPoints(np.zeros((2, 3)), np.array([[1.0, 0.0, 0.0]] * 2), np.array([2.0, 0.0]))
    points_m = np.array([tow.follow(np.repeat(each[None], 2, axis=0), np.zeros(2))[1] for each in lead_m])
    assert np.array_equal(points_m[:, 1], lead_m)
    behind = angle - 0.2
    circle_m = np.stack([10.0 * np.sin(behind), 10.0 * (1.0 - np.cos(behind))], axis=-1)
    np.testing.assert_allclose(points_m[behind > 0.0, 0, :2], circle_m[behind > 0.0], atol=0.01)
    np.testing.assert_allclose(points_m[behind < 0.0, 0, 0], 10.0 * behind[behind < 0.0], atol=0.01)


def test_a_towed_point_falls_back_along_the_path_of_its_leader():
    angle = np.minimum(0.03 * np.arange(1, 200), 3.0)
    lead_m = np.stack([10.0 * np.sin(angle), 10.0 * (1.0 - np.cos(angle)), 0.0 * angle], axis=-1)
    tow = TowedPoints(np.zeros((1, 3)), np.array([[1.0, 0.0, 0.0]]), np.array([2.0]), max_back_m=4.0)
    back_m = np.clip(0.1 * (np.arange(199) - 120), 0.0, 4.0)
    rows = [tow.follow(each[None], np.array([back])) for each, back in zip(lead_m, back_m, strict=True)]
    for points_m, behind_m in zip(np.swapaxes([np.concatenate(row) for row in rows], 0, 1), (0.0, 2.0), strict=True):
        at = angle[30:] - (behind_m + back_m[30:]) / 10.0
        circle_m = np.stack([10.0 * np.sin(at), 10.0 * (1.0 - np.cos(at))], axis=-1)
        np.testing.assert_allclose(points_m[30:, :2], circle_m, atol=0.02)


def test_a_target_that_jumps_sideways_is_followed_like_a_lane_change():
    path_m = np.cumsum(np.minimum(0.05 * np.arange(160), 1.2))
    jump = int(np.argmax(path_m > 80.0))
    target_m = np.stack([path_m, np.where(np.arange(160) >= jump, 3.5, 0.0), np.zeros(160)], axis=-1)[:, None]
    steady = SteadyPoints(target_m[0], 0.08)
    points_m = np.array([steady.follow(each)[0] for each in target_m])
    assert np.array_equal(points_m[:jump], target_m[:jump, 0])
    assert np.abs(np.diff(points_m[:, 1])).max() < 0.25
    np.testing.assert_allclose(points_m[-1], target_m[-1, 0], atol=1e-6)
    _, states = drive(body(), points_m)
    assert np.abs([state.acceleration_mps2[0, 1] for state in states]).max() < 10.0


def test_a_sharp_corner_is_followed_and_a_standing_target_is_kept():
    corner_m = np.concatenate([[[0.5 * k, 0.0, 0.0] for k in range(20)], [[9.5, 0.5 * k, 0.0] for k in range(1, 60)]])
    steady = SteadyPoints(corner_m[:1], 0.08)
    points_m = np.array([steady.follow(each[None])[0] for each in corner_m])
    assert np.linalg.norm(points_m - corner_m, axis=1).max() < 2.5
    assert np.array_equal(points_m[-1], corner_m[-1])
    standing_m = np.concatenate([corner_m[:22], np.repeat(corner_m[21:22], 30, axis=0)])
    steady = SteadyPoints(standing_m[:1], 0.08)
    points_m = np.array([steady.follow(each[None])[0] for each in standing_m])
    assert np.array_equal(points_m[-1], points_m[-10])
