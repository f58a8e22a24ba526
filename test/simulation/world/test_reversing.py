"""Vehicles driven from outside reverse: their bodies, wheels and lights, and how others react."""

from dataclasses import replace

import numpy as np
import pytest
from several_agents import car
from test_agents_in_traffic import drive, in_a_row
from test_motion import body
from world_scenes import TICK_S

from simbev_ros.foundation.types import Float64Array, Int64Array, Table
from simbev_ros.scene.blueprints import blueprint_named
from simbev_ros.schema.scene.state import EGO_ID, Light
from simbev_ros.simulation.world.driving.trajectory_prediction import TIMES_S, TrajectoryPredictor
from simbev_ros.simulation.world.kinematics.contacts import BodyBoxes
from simbev_ros.simulation.world.kinematics.followers import PursuingPoints
from simbev_ros.simulation.world.kinematics.motion import Motion
from simbev_ros.simulation.world.pedestrians.vehicle_avoidance import VehicleAvoidance

SEDAN = blueprint_named("vehicle.sedan")
HALF_WHEELBASE_M = SEDAN.wheelbase_m / 2.0


def along(actor: Table, x: str = "vx", y: str = "vy") -> tuple[Float64Array, Float64Array]:
    """Components of a vector ahead of the body and to its left."""
    cos, sin = np.cos(actor["yaw"]), np.sin(actor["yaw"])
    return actor[x] * cos + actor[y] * sin, actor[y] * cos - actor[x] * sin


def slip_mps(actor: Table) -> Float64Array:
    """(T,) velocity of the rear axle to the left; 0 for wheels that roll."""
    return along(actor)[1] - actor["wz"] * HALF_WHEELBASE_M


def test_a_straight_reverse_keeps_the_heading_and_turns_the_wheels_back() -> None:
    actors, events = drive(in_a_row(), {0: (-3.0, 0.0)})
    ego = actors[:, 0]
    speed_mps, _ = along(ego)
    assert speed_mps[100:] == pytest.approx(-3.0, abs=1e-3)
    assert np.ptp(ego["yaw"]) < 1e-6 and np.abs(ego["steer"]).max() < 1e-3
    assert np.hypot(np.diff(ego["x"]), np.diff(ego["y"]))[100:] == pytest.approx(3.0 * TICK_S, abs=1e-5)
    assert np.diff(ego["wheel"])[100:] == pytest.approx(-3.0 * TICK_S / SEDAN.wheel_radius_m, abs=1e-4)
    assert np.all(ego["lights"][speed_mps < -0.1] == Light.REVERSE)
    assert not events


def test_a_turn_in_reverse_is_a_circle_and_the_rear_axle_does_not_slip() -> None:
    spec = in_a_row(car("car", 2, driver="twist")).model_copy(update={"ticks": 400})
    turning = drive(spec, {2: (-3.0, 0.25)})[0][150:, 2]
    ahead, left = (np.stack(pair, axis=1) for pair in _axes(turning["yaw"]))
    center_m = np.stack([turning["x"], turning["y"]], axis=1) - HALF_WHEELBASE_M * ahead - 3.0 / 0.25 * left
    assert np.ptp(center_m, axis=0) == pytest.approx(0.0, abs=0.05)
    assert turning["wz"] == pytest.approx(0.25, abs=1e-3)
    assert along(turning)[0] == pytest.approx(-3.0, abs=0.01)
    assert slip_mps(turning) == pytest.approx(0.0, abs=2e-3)
    assert turning["steer"] == pytest.approx(-np.arctan(SEDAN.wheelbase_m * 0.25 / 3.0), abs=2e-3)
    assert along(turning, "ax", "ay")[1] == pytest.approx(-3.0 * 0.25, abs=0.01)  # to the center, on the right


def _axes(yaw_rad: Float64Array) -> tuple[tuple[Float64Array, Float64Array], tuple[Float64Array, Float64Array]]:
    """Unit vectors ahead and to the left."""
    cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
    return (cos, sin), (-sin, cos)


def test_forward_reverse_forward_is_smooth_with_lights_to_match() -> None:
    phases = (4.0, 0.2), (-3.0, 0.3), (4.0, -0.2)
    spec = in_a_row().model_copy(update={"ticks": 360})
    ego = drive(spec, lambda tick: {0: phases[tick // 120]})[0][:, 0]
    speed_mps, speed_change_mps2 = along(ego)[0], along(ego, "ax", "ay")[0]
    assert speed_mps[[110, 230, 350]] == pytest.approx([4.0, -3.0, 4.0], abs=0.01)
    assert ego["wz"][[110, 230, 350]] == pytest.approx([0.2, 0.3, -0.2], abs=2e-3)
    assert np.count_nonzero(np.diff(np.sign(speed_mps[20:]))) == 2
    assert np.abs(speed_change_mps2).max() < SEDAN.decel + 0.2 and np.abs(slip_mps(ego)).max() < 0.05
    moves, gains_mps2 = np.abs(speed_mps) > 0.1, np.sign(speed_mps) * speed_change_mps2
    assert np.array_equal((ego["lights"] & Light.REVERSE > 0)[moves], speed_mps[moves] < 0.0)
    is_clear = moves & (np.abs(gains_mps2 + 0.6) > 0.1)
    assert np.array_equal((ego["lights"] & Light.BRAKE > 0)[is_clear], gains_mps2[is_clear] < -0.6)


def test_traffic_behind_a_reversing_vehicle_stops_and_a_contact_is_reported() -> None:
    actors, events = drive(in_a_row(car("car", 2, driver="twist"), ego_driver="traffic"), {2: (-4.0, 0.0)})
    follower, reversing = actors[:, 1], actors[:, 2]
    gap_m = np.hypot(follower["x"] - reversing["x"], follower["y"] - reversing["y"]) - SEDAN.size_m[0]
    speed_mps, _ = along(follower)
    assert speed_mps[0] > 3.0 and np.all(speed_mps[(gap_m > 0.1) & (gap_m < 10.0)] < 0.1)
    (event,) = events
    assert (event.type, event.ids) == ("collision", (EGO_ID + 1, EGO_ID + 2))
    assert event.relative_speed_mps == pytest.approx(4.0, abs=0.1)


def test_a_two_wheeler_leans_to_the_right_in_a_left_turn_in_reverse() -> None:
    speed_mps, radius_m = -4.0, 12.0
    (ahead, left), zeros = _axes(-speed_mps / radius_m * TICK_S * np.arange(300)), np.zeros(300)
    forward, axle_m = np.stack([*ahead, zeros], axis=1), radius_m * np.stack([*left, zeros], axis=1)
    points = np.column_stack([axle_m + 1.4 * forward, zeros])
    bodies = body(trail_m=1.4, lead_m=0.9, leans=True)
    motion = Motion(bodies, points[:1], forward[:1], TICK_S, 7, axle_m=axle_m[:1])
    last = [motion.advance_motion(point[None], axle[None]) for point, axle in zip(points, axle_m, strict=True)][-1]
    assert last.speed_mps[0] == pytest.approx(speed_mps, rel=5e-3)
    assert last.angular_velocity_radps[0, 2] == pytest.approx(-speed_mps / radius_m, rel=1e-3)
    assert last.rpy_rad[0, 0] == pytest.approx(np.arctan(speed_mps**2 / radius_m / 9.81), rel=0.02)


class _AlongX:
    """Roads on which everything drives along x."""

    def ahead_m(self, vehicle: Int64Array, distance_m: Float64Array, left_m: Float64Array) -> Float64Array:
        return np.stack([distance_m, left_m, np.zeros_like(left_m)], axis=-1)


def test_drivers_expect_a_reversing_vehicle_to_back_up() -> None:
    bodies = replace(body(trail_m=3.0, lead_m=1.0), boxes=BodyBoxes(np.array([[5.0, 2.0, 1.5]]), 1))
    to_point_m, to_rear_m = np.array([-1.5, 0.0, 0.0]), np.array([-4.5, 0.0, 0.0])
    predictor = TrajectoryPredictor(bodies, np.zeros((1, 3)), _AlongX(), TICK_S)
    for tick in range(1, 100):
        front_m = np.array([[-2.0 * TICK_S * tick, 0.0, 0.0]])
        predictor.observe(front_m, front_m + to_point_m, front_m + to_rear_m, np.array([True]))
    prediction = predictor.predict(np.array([0]), is_released=False)
    assert prediction.center_m[0, :, 0] == pytest.approx(front_m[0, 0] - 2.5 - 2.0 * TIMES_S)
    assert np.all(prediction.forward == [1.0, 0.0])


@pytest.mark.parametrize("heading", [-1.0, 1.0])
def test_pedestrians_keep_off_a_vehicle_that_comes_forward_or_in_reverse(heading: float) -> None:
    """It moves along -x; with a heading along +x, in reverse."""
    two, size_m = np.zeros(2), np.array([[4.0, 2.0, 1.5], [0.5, 0.5, 1.8]])
    bodies = replace(body(), trail_m=two + 2.0, lead_m=two, boxes=BodyBoxes(size_m, 1))
    ahead = np.array([[heading, 0.0, 0.0]])
    avoidance = VehicleAvoidance(bodies, np.zeros((1, 3)), ahead)
    point_m, pedestrian_m = np.array([[-0.2, 0.0, 0.0]]), np.array([[-4.0, 1.2, 0.0]])
    axle_m = point_m - 2.0 * ahead if heading > 0.0 else np.full((1, 3), np.nan)
    moved_m = avoidance.avoid_paths(point_m, axle_m, ~np.isnan(axle_m[:, 0]), pedestrian_m, pedestrian_m, TICK_S)
    assert moved_m[0] == pytest.approx([-4.0, 1.8, 0.0])
    assert avoidance.is_reversing.tolist() == [heading > 0.0]


@pytest.mark.parametrize("speed_mps", [1.4, 3.0, 6.3, 8.0])
@pytest.mark.parametrize("target_m", [(-6.0, 3.0), (-1.0, 2.5), (1.0, 3.0)])
def test_the_average_path_of_a_pedestrian_around_a_vehicle_keeps_off_its_corner(
    speed_mps: float, target_m: tuple[float, float]
) -> None:
    """Published positions are averages over 0.7 s; the pedestrian gets from the vehicle's front to its side."""
    two, size_m = np.zeros(2), np.array([[4.4, 1.9, 1.5], [1.47, 0.55, 1.8]])
    bodies = replace(body(), trail_m=two + 2.0, lead_m=two, boxes=BodyBoxes(size_m, 1))
    max_mps = np.array([speed_mps])
    avoidance = VehicleAvoidance(bodies, np.zeros((1, 3)), np.array([[1.0, 0.0, 0.0]]), max_mps)
    points = PursuingPoints(np.array([[3.5, 0.3, 0.0]]), 1.3 * max_mps * TICK_S, 4.0 * TICK_S**2)
    positions_m = []
    for _ in range(round(12.0 / TICK_S)):
        desired_m = points.pursue(np.array([[*target_m, 0.0]]))
        points.position_m = avoidance.avoid_bodies(desired_m, (1.3 * max_mps + 1.0) * TICK_S)
        positions_m.append(points.position_m[0, :2])
    assert positions_m[-1] == pytest.approx(target_m, abs=0.01)
    window = np.lib.stride_tricks.sliding_window_view(positions_m, round(0.7 / TICK_S) + 1, axis=0)
    gap_m = np.linalg.norm(np.maximum(np.abs(window.mean(axis=-1)) - size_m[0, :2] / 2.0, 0.0), axis=1)
    assert gap_m.min() > size_m[1, 0] / 2.0
