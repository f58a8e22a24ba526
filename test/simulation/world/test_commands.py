"""Commands and their controllers: bad numbers are refused, and a planned motion is driven to centimeters."""

import math

import numpy as np
import pytest

from simbev_ros.scene.blueprints import blueprint_named
from simbev_ros.simulation.world.driving.commands import AckermannCommand, TrajectoryCommand
from simbev_ros.simulation.world.driving.driven_vehicles import CommandedDriver

TICK_S, TICK_NS = 0.05, 50_000_000


def level(points_m: np.ndarray) -> np.ndarray:
    return np.zeros(len(points_m))


def driver(name: str = "vehicle.sedan", max_speed_mps: float = 40.0) -> CommandedDriver:
    return CommandedDriver(blueprint_named(name), np.zeros(3), np.array([1.0, 0.0]), max_speed_mps, TICK_S, level)


def drive(vehicle: CommandedDriver, ticks: int, first: int = 0, friction: float = 1.0) -> None:
    for tick in range(first, first + ticks):
        vehicle.advance_tick(tick * TICK_NS, friction)


@pytest.mark.parametrize("values", [(math.nan, 1.0), (0.1, math.inf), (0.1, 1.0, -1.0), (0.1, 1.0, 0.0, -0.5)])
def test_impossible_ackermann_commands_are_refused(values: tuple[float, ...]) -> None:
    with pytest.raises(ValueError, match=r"finite|0 or more"):
        AckermannCommand(*values)


@pytest.mark.parametrize(
    ("stamps", "points", "problem"),
    [
        ([0], [(0.0, 0.0)], "at least 2"),
        ([0, 0], [(0.0, 0.0), (1.0, 0.0)], "ascend"),
        ([0, 1], [(0.0, math.nan), (1.0, 0.0)], "finite"),
    ],
)
def test_impossible_trajectories_are_refused(
    stamps: list[int], points: list[tuple[float, float]], problem: str
) -> None:
    with pytest.raises(ValueError, match=problem):
        TrajectoryCommand.of(stamps, points)


def test_without_commands_it_stands_even_on_a_slope() -> None:
    vehicle = CommandedDriver(
        blueprint_named("vehicle.sedan"), np.zeros(3), np.array([1.0, 0.0]), 40.0, TICK_S, lambda m: 0.08 * m[:, 0]
    )
    drive(vehicle, 100)
    assert vehicle.front_m == pytest.approx(np.zeros(3), abs=1e-9)


@pytest.mark.parametrize("slope", [-0.06, 0.0, 0.06])
def test_speed_is_reached_in_reverse_and_on_slopes_too(slope: float) -> None:
    for speed_mps in (12.0, -3.0):
        vehicle = CommandedDriver(
            blueprint_named("vehicle.sedan"), np.zeros(3), np.array([1.0, 0.0]), 40.0, TICK_S, lambda m: slope * m[:, 0]
        )
        for tick in range(300):
            vehicle.follow(AckermannCommand(0.0, speed_mps))
            drive(vehicle, 1, tick)
        assert vehicle.model.speed_mps == pytest.approx(speed_mps, abs=0.1)


def test_after_half_a_second_without_commands_it_brakes_comfortably() -> None:
    vehicle = driver()
    for tick in range(200):
        vehicle.follow(AckermannCommand(0.0, 10.0))
        drive(vehicle, 1, tick)
    drive(vehicle, 9, 200)
    assert vehicle.model.speed_mps == pytest.approx(10.0, abs=0.1)
    drive(vehicle, 20, 209)
    assert vehicle.model.speed_mps == pytest.approx(10.0 - 0.95 * blueprint_named("vehicle.sedan").decel, abs=0.8)


def test_speed_and_steering_stay_within_the_limits_of_the_vehicle() -> None:
    vehicle = driver(max_speed_mps=8.0)
    for tick in range(200):
        vehicle.follow(AckermannCommand(5.0, 100.0))
        drive(vehicle, 1, tick)
        assert vehicle.model.speed_mps < 1.05 * 8.0
    assert vehicle.model.steer_rad == pytest.approx(vehicle.model.dynamics.max_steer_rad)


@pytest.mark.parametrize("name", ["vehicle.sedan", "vehicle.bus"])
@pytest.mark.parametrize("radius_m", [15.0, 40.0, math.inf])
def test_a_planned_curve_is_driven_to_decimeters_and_ends_where_it_ends(name: str, radius_m: float) -> None:
    vehicle = driver(name)
    start_m = vehicle.axle_m[:2].copy()
    times_s = np.arange(0.0, 20.0, 0.1)
    speed_mps = 6.0
    accelerating = np.minimum(times_s, 6.0)
    along_m = 0.5 * accelerating**2 + speed_mps * np.maximum(times_s - 6.0, 0.0)
    if math.isinf(radius_m):
        points_m = start_m + np.column_stack([along_m, 0.0 * along_m])
    else:
        angle = along_m / radius_m
        points_m = start_m + radius_m * np.column_stack([np.sin(angle), 1.0 - np.cos(angle)])
    plan = TrajectoryCommand.of((times_s * 1e9).astype(np.int64).tolist(), points_m.tolist())
    vehicle.follow(plan)
    errors_m, lags_m = [], []
    for tick in range(398):
        drive(vehicle, 1, tick)
        offset_m = np.linalg.norm(points_m - vehicle.axle_m[:2], axis=1)
        errors_m.append(
            offset_m.min()
            if math.isinf(radius_m)
            else abs(np.linalg.norm(vehicle.axle_m[:2] - start_m - [0.0, radius_m]) - radius_m)
        )
        wanted_m = np.interp((tick + 1) * TICK_S, times_s, along_m)
        near = abs(along_m - wanted_m) < 20.0
        lags_m.append(abs(wanted_m - along_m[near][np.argmin(offset_m[near])]))
    if not math.isinf(radius_m):
        assert max(errors_m) < 0.35
    assert max(lags_m) < 1.0
    drive(vehicle, 200, 398)
    assert vehicle.model.speed_mps == 0.0
