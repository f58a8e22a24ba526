import numpy as np
import pytest
from made_up_roads import made_up_lane

from simbev_ros.simulation.world.sumo.curve_speeds import curve_speeds


def bend(radius_m, turn_rad, straight_m=50.0):
    angle, side = np.linspace(0.0, abs(turn_rad), 40), np.sign(turn_rad)
    arc_m = np.stack([straight_m + radius_m * np.sin(angle), side * radius_m * (1 - np.cos(angle)), 0 * angle], axis=-1)
    line_m = np.vstack([[0.0, 0.0, 0.0], arc_m])
    return made_up_lane("A_0", line_m=line_m)


def test_a_bend_is_driven_with_a_lateral_acceleration_of_two_meters_per_second_squared():
    assert curve_speeds([bend(28.0, np.pi / 2)])["A_0"] == pytest.approx(np.sqrt(2.0 * 28.0), rel=0.03)
    assert curve_speeds([bend(8.0, -np.pi / 2, straight_m=0.1)])["A_0"] == pytest.approx(4.0, rel=0.03)


def test_a_very_tight_bend_is_driven_at_the_maximum_yaw_rate():
    assert curve_speeds([bend(2.0, np.pi)])["A_0"] == pytest.approx(0.6 * 2.0, rel=0.05)


def test_straight_lanes_and_wide_bends_keep_their_limit():
    assert curve_speeds([made_up_lane("B_0")]) == {}
    assert curve_speeds([bend(120.0, np.pi / 4)]) == {}
