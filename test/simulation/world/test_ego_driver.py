"""An ego driven from outside: where commands take it, and its limits; see also test_agents_in_traffic.py."""

import numpy as np
import pytest
from scene_edits import ego as ego_fields
from world_scenes import TICK_S, blocks, scene

from simbev_ros.scene.blueprints import blueprint_named
from simbev_ros.simulation.world.driving.driven_vehicles import EgoDriver
from simbev_ros.simulation.world.simulation import Simulation

SEDAN = blueprint_named("vehicle.sedan")


def driver() -> EgoDriver:
    return EgoDriver(
        SEDAN, np.array([10.0, 5.0, 0.0]), np.array([1.0, 0.0, 0.0]), 20.0, TICK_S, lambda points: points[:, 2]
    )


def drive(car: EgoDriver, speed_mps: float, yaw_rate_radps: float, ticks: int) -> np.ndarray:
    """(T, 3) x and y of the front bumper, and the heading."""
    path = []
    for _ in range(ticks):
        car.set_command(speed_mps, yaw_rate_radps)
        car.advance_tick()
        path.append([*car.front_m[:2], car.yaw_rad])
    return np.array(path)


def rear_axle_m(path: np.ndarray) -> np.ndarray:
    rear_to_front_m = (SEDAN.size_m[0] + SEDAN.wheelbase_m) / 2.0
    return path[:, :2] - rear_to_front_m * np.stack([np.cos(path[:, 2]), np.sin(path[:, 2])], axis=1)


def test_the_ego_reaches_the_desired_speed_at_its_maximum_acceleration() -> None:
    path = drive(driver(), 10.0, 0.0, 200)
    speed_mps = np.diff(path[:, 0]) / TICK_S
    assert speed_mps[-1] == pytest.approx(10.0)
    assert np.diff(speed_mps).max() / TICK_S == pytest.approx(SEDAN.accel)
    assert np.all(path[:, 1] == 5.0)


def test_a_steady_turn_is_a_circle_of_radius_speed_over_yaw_rate() -> None:
    path = drive(driver(), 5.0, 0.25, 800)[300:]
    assert np.diff(path[:, 2]).mean() / TICK_S == pytest.approx(0.25, rel=1e-3)
    rear_m = rear_axle_m(path)
    center_m = (rear_m.max(axis=0) + rear_m.min(axis=0)) / 2.0
    assert np.linalg.norm(rear_m - center_m, axis=1) == pytest.approx(5.0 / 0.25, abs=0.1)


def test_left_is_positive_and_extreme_commands_stay_within_tire_limits() -> None:
    path = drive(driver(), 1e9, 1e9, 300)
    rate_radps = np.diff(path[:, 2]) / TICK_S
    assert rate_radps.min() >= 0.0
    speed_mps = np.linalg.norm(np.diff(rear_axle_m(path), axis=0), axis=1) / TICK_S
    assert rate_radps.max() < 1.21
    assert speed_mps.max() < 20.01
    assert (speed_mps * rate_radps).max() < 7.1


def test_the_ego_brakes_to_a_stop_without_commands_for_half_a_second() -> None:
    car = driver()
    drive(car, 8.0, 0.0, 200)
    before = car.front_m[0]
    speeds = []
    for _ in range(60):
        car.advance_tick()
        speeds.append((car.front_m[0] - before) / TICK_S)
        before = car.front_m[0]
    assert speeds[8] == pytest.approx(8.0)
    assert speeds[9] == pytest.approx(8.0 - SEDAN.decel * TICK_S)
    assert speeds[-1] == 0.0


@pytest.mark.parametrize("command", [(float("nan"), 0.0), (5.0, float("inf"))])
def test_non_finite_commands_are_ignored(command: tuple[float, float]) -> None:
    assert np.all(drive(driver(), *command, 40)[:, 0] == 10.0)


def test_the_ego_reverses_straight_at_its_maximum_acceleration_and_at_5_m_per_s_at_most() -> None:
    path = drive(driver(), -20.0, 0.0, 200)
    speed_mps = np.diff(path[:, 0], prepend=10.0) / TICK_S
    assert speed_mps[:20] == pytest.approx(-SEDAN.accel * TICK_S * np.arange(1, 21))
    assert speed_mps.min() == pytest.approx(-5.0) and speed_mps[-1] == pytest.approx(-5.0)
    assert np.all(path[:, 1] == 5.0) and np.all(path[:, 2] == 0.0)


@pytest.mark.parametrize("yaw_rate_radps", [0.3, -0.3])
def test_a_steady_turn_in_reverse_is_a_circle_of_radius_speed_over_yaw_rate(yaw_rate_radps: float) -> None:
    path = drive(driver(), -3.0, yaw_rate_radps, 800)[300:]
    assert np.diff(path[:, 2]) / TICK_S == pytest.approx(yaw_rate_radps, rel=1e-6)
    rear_m, left = rear_axle_m(path), np.stack([-np.sin(path[:, 2]), np.cos(path[:, 2])], axis=1)
    center_m = rear_m - 3.0 / yaw_rate_radps * left  # v / w to the left; that is to the right for v < 0 < w
    assert np.ptp(center_m, axis=0) == pytest.approx(0.0, abs=0.01)


def test_steering_in_reverse_keeps_its_limits() -> None:
    path = drive(driver(), -2.0, 1e9, 300)[100:]
    max_radps = 2.0 * np.tan(0.6) / SEDAN.wheelbase_m  # of the largest steering angle
    assert np.diff(path[:, 2]) / TICK_S == pytest.approx(max_radps)


def test_between_forward_and_reverse_the_ego_brakes_to_a_standstill() -> None:
    car = driver()
    path = np.concatenate([drive(car, speed_mps, 0.0, 80) for speed_mps in (4.0, -3.0, 2.0)])
    speed_mps = np.diff(path[:, 0]) / TICK_S
    assert speed_mps[[78, 158, 238]] == pytest.approx([4.0, -3.0, 2.0])
    assert np.count_nonzero(np.diff(np.sign(speed_mps[30:])) != 0) == 4  # to 0, and from 0 on to the other sign
    change_mps2 = np.diff(speed_mps) / TICK_S
    assert change_mps2[79:95] == pytest.approx([-SEDAN.decel] * 16)
    assert change_mps2[159:171] == pytest.approx([SEDAN.decel] * 12)
    assert change_mps2.max() < SEDAN.decel + 1e-6 and np.all(path[:, 1] == 5.0)


def test_the_reversing_ego_brakes_without_commands() -> None:
    car = driver()
    drive(car, -3.0, 0.0, 100)
    for _ in range(40):
        car.advance_tick()
    before = car.front_m[0]
    car.advance_tick()
    assert car.front_m[0] == before


def test_the_ego_may_leave_the_roads_for_good() -> None:
    spec = scene(vehicles=1, pedestrians=0, ticks=400, agents=[ego_fields(driver="twist")])
    with Simulation(spec, blocks()) as simulation:
        start = simulation.step().ego
        for tick in range(spec.ticks):
            simulation.drive_vehicle(0, 15.0, 0.1 * (tick < 60))
            end = simulation.step().ego
    assert np.hypot(end["x"] - start["x"], end["y"] - start["y"]) > 200.0
