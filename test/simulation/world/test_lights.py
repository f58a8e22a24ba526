import numpy as np
import pytest
from world_scenes import NOON

from simbev_ros.schema.scene.state import Light
from simbev_ros.simulation.world.lights import BLINKER_HZ, is_bright, vehicle_lights

RIGHT, LEFT, NEITHER = 1, 2, 0


def lights(
    signal=NEITHER, speed_mps=8.0, acceleration_mps2=0.0, bright=True, beacon=False, weather=NOON, in_tunnel=False
):
    one = np.ones(1)
    flashing = np.array([bright]), np.array([beacon])
    moves = speed_mps * one, acceleration_mps2 * one
    rows = vehicle_lights(np.array([signal]), *moves, *flashing, weather, np.array([in_tunnel]))
    return Light(int(rows[0]))


def test_a_car_at_constant_speed_by_day_shows_no_light():
    assert lights() == Light(0)


def test_brake_lights_shine_when_braking_and_when_standing():
    assert lights(acceleration_mps2=-1.5) == lights(speed_mps=0.0) == Light.BRAKE
    assert lights(acceleration_mps2=1.5) == Light(0)


def test_reverse_lights_shine_when_moving_backwards_and_forward_acceleration_then_is_braking():
    assert lights(speed_mps=-1.0) == lights(speed_mps=-1.0, acceleration_mps2=-1.5) == Light.REVERSE
    assert lights(speed_mps=-1.0, acceleration_mps2=1.5) == Light.REVERSE | Light.BRAKE


def test_blue_lights_shine_in_their_bright_half():
    assert lights(beacon=True) == Light.EMERGENCY


def test_a_blinker_shines_on_its_side_in_its_bright_half():
    assert lights(LEFT) == Light.TURN_LEFT
    assert lights(RIGHT) == Light.TURN_RIGHT
    assert lights(RIGHT, bright=False) == Light(0)


def test_blinkers_flash_three_times_in_two_seconds_each_in_its_own_phase():
    bright = np.array([is_bright(np.array([0.0, 0.5]), tick * 0.05, BLINKER_HZ) for tick in range(40)])
    assert np.count_nonzero(np.diff(bright[:, 0].astype(int), prepend=0) > 0) == 3
    assert np.array_equal(bright[:, 0], ~bright[:, 1])


@pytest.mark.parametrize("change", [{"sun_altitude_deg": 2}, {"precipitation": 80}, {"fog_density": 60}])
def test_low_beams_are_on_at_dusk_in_heavy_rain_and_in_fog(change):
    assert lights(weather=NOON.model_copy(update=change)) == Light.LOW_BEAM


def test_low_beams_are_on_in_a_tunnel():
    assert lights(in_tunnel=True) == Light.LOW_BEAM
    assert lights(in_tunnel=True, acceleration_mps2=-1.5) == Light.LOW_BEAM | Light.BRAKE
