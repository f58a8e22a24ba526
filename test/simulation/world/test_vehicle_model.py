"""The vehicle model against the equations of its sources."""

import math
from dataclasses import replace

import pytest

from simbev_ros.foundation.units import GRAVITY_MPS2
from simbev_ros.scene.blueprints import blueprint_named, load_blueprints
from simbev_ros.simulation.world.driving.vehicle_model import Dynamics, VehicleModel

SEDAN = Dynamics.of(blueprint_named("vehicle.sedan"))
FREE = replace(SEDAN, drag_m2=0.0, rolling=0.0)


def settled(dynamics: Dynamics, speed_mps: float, steer_rad: float, seconds: float = 6.0) -> VehicleModel:
    """A vehicle in a steady curve, whose speed is held."""
    model = VehicleModel(dynamics, speed_mps=speed_mps)
    for _ in range(round(seconds / 0.05)):
        model.advance(0.05, steer_rad, 0.0)
        model.speed_mps = speed_mps
    return model


@pytest.mark.parametrize("name", ["vehicle.sedan", "vehicle.van", "vehicle.bus"])
@pytest.mark.parametrize("speed_mps", [5.0, 10.0, 20.0])
def test_a_steady_curve_has_the_yaw_rate_of_the_understeer_gradient(name: str, speed_mps: float) -> None:
    dynamics = replace(Dynamics.of(blueprint_named(name)), drag_m2=0.0, rolling=0.0)
    steer_rad = 0.8 * dynamics.wheelbase_m / speed_mps**2  # 0.8 m/s² without slip: the tires are nearly linear
    found = settled(dynamics, speed_mps, steer_rad).yaw_rate_radps
    expected = speed_mps * steer_rad / (dynamics.wheelbase_m + dynamics.understeer_s2pm * speed_mps**2)
    assert found == pytest.approx(expected, rel=0.01)


def test_lateral_acceleration_stays_within_friction() -> None:
    dry, wet = (VehicleModel(FREE, speed_mps=25.0) for _ in range(2))
    dry.advance(1.5, 0.3, 0.0)
    wet.advance(1.5, 0.3, 0.0, friction=0.7)
    for model, friction in ((dry, 1.0), (wet, 0.7)):
        lateral_mps2 = model.speed_mps * model.yaw_rate_radps
        assert 0.6 * friction * GRAVITY_MPS2 < lateral_mps2 < 1.35 * friction * FREE.peak * GRAVITY_MPS2
    assert wet.yaw_rate_radps < dry.yaw_rate_radps


@pytest.mark.parametrize("friction", [1.0, 0.7, 0.3])
def test_stopping_distance_is_that_of_friction_and_lag(friction: float) -> None:
    model = VehicleModel(replace(FREE, max_brake_mps2=100.0), speed_mps=20.0)
    model.advance(20.0, 0.0, -90.0, friction)
    # The brakes reach the friction limit after this time; until then their force grows with the lag.
    grip_mps2, lag_s = friction * FREE.peak * GRAVITY_MPS2, FREE.brake_lag_s
    until_s = -lag_s * math.log(1.0 - grip_mps2 / 90.0)
    rest = lag_s * (1.0 - math.exp(-until_s / lag_s))
    lost_mps, lost_m = 90.0 * (until_s - rest), 90.0 * (until_s**2 / 2.0 - lag_s * (until_s - rest))
    before_m = 20.0 * until_s - lost_m
    assert model.speed_mps == 0.0
    assert model.x_m == pytest.approx(before_m + (20.0 - lost_mps) ** 2 / (2.0 * grip_mps2), rel=2e-3)


def test_acceleration_follows_its_demand_with_a_lag_of_first_order() -> None:
    model = VehicleModel(FREE, speed_mps=10.0)
    model.advance(FREE.drive_lag_s, 0.0, 1.0)
    assert model.drive_mps2 == pytest.approx(1.0 - math.exp(-1.0), rel=1e-6)


def test_coasting_has_the_deceleration_of_drag_and_rolling_resistance() -> None:
    model = VehicleModel(SEDAN, speed_mps=30.0)
    model.advance(0.1, 0.0, 0.0)
    expected = 0.5 * 1.204 * SEDAN.drag_m2 * 30.0**2 / SEDAN.mass_kg + SEDAN.rolling * GRAVITY_MPS2
    assert (30.0 - model.speed_mps) / 0.1 == pytest.approx(expected, rel=5e-3)


def test_a_slope_accelerates_by_its_sine() -> None:
    model = VehicleModel(FREE, speed_mps=10.0)
    model.advance(1.0, 0.0, 0.0, slope=-0.1)
    assert model.speed_mps - 10.0 == pytest.approx(GRAVITY_MPS2 * 0.1 / math.hypot(1.0, 0.1), rel=1e-9)


def test_brakes_hold_at_rest_and_on_a_slope_the_vehicle_does_not_creep() -> None:
    model = VehicleModel(SEDAN, speed_mps=5.0)
    model.advance(5.0, 0.1, -4.0)
    position = model.x_m, model.y_m
    model.advance(5.0, 0.1, -4.0, slope=0.05)
    assert (model.speed_mps, model.yaw_rate_radps) == (0.0, 0.0)
    assert (model.x_m, model.y_m) == position


def test_at_low_speed_the_turning_circle_is_that_of_the_kinematic_model() -> None:
    model = settled(FREE, 0.8, 0.4, 3.0)
    model.advance(0.05, 0.4, 0.0)
    assert model.speed_mps == pytest.approx(0.8, rel=0.01)
    assert model.yaw_rate_radps == pytest.approx(model.speed_mps * math.tan(0.4) / FREE.wheelbase_m, rel=1e-12)


def test_steps_of_a_tick_do_not_change_the_motion() -> None:
    """Half as long ticks lead to the same place to a centimeter after a lane change."""
    ends = []
    for ticks in (80, 160):
        model = VehicleModel(SEDAN, speed_mps=15.0)
        for tick in range(ticks):
            model.advance(4.0 / ticks, 0.05 * math.sin(math.tau * (tick // (ticks // 80)) / 80), 0.2)
        ends.append((model.x_m, model.y_m))
    assert ends[0] == pytest.approx(ends[1], abs=0.01)


@pytest.mark.parametrize("blueprint", [each for each in load_blueprints() if each.kind == "vehicle"])
def test_every_vehicle_has_dynamics_and_understeers(blueprint: object) -> None:
    dynamics = Dynamics.of(blueprint)  # type: ignore[arg-type]
    assert 50.0 < dynamics.mass_kg < 25_000.0
    assert dynamics.understeer_s2pm > 0.0
