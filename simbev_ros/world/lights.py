"""Lights of vehicles, from motion, SUMO's signals and the weather."""

import numpy as np

from simbev_ros.scene.state import Light
from simbev_ros.scene.weather import Weather
from simbev_ros.types import BoolArray, Float64Array, Int64Array, UInt16Array

BLINKER_HZ = 1.5
BEACON_HZ = 2.0
_SUMO_RIGHT, _SUMO_LEFT = 1, 2
HAZARD_LIGHTS = _SUMO_RIGHT | _SUMO_LEFT
"""Both blinkers, in SUMO's vehicle signals."""
_BRAKING_MPS2 = -0.6
_STANDING_MPS = 0.1
_REVERSING_MPS = -0.1
_LOW_SUN_DEG = 5.0
_HEAVY_RAIN = 50.0
_THICK_FOG = 40.0


def vehicle_lights(
    signals: Int64Array,
    speed_mps: Float64Array,
    gain_mps2: Float64Array,
    bright: BoolArray,
    beacons: BoolArray,
    weather: Weather,
) -> UInt16Array:
    """(V,) uint16 ``Light`` bits.

    Args:
        signals: (V,) SUMO's vehicle signals.
        speed_mps: (V,) velocity along the heading.
        gain_mps2: (V,) acceleration along the heading.
        bright: (V,) whether a blinker that is on is in its bright half.
        beacons: (V,) whether the blue lights shine now.
        weather: Weather and light now.
    """
    reversing = speed_mps < _REVERSING_MPS
    gain_ahead_mps2 = np.where(reversing, -gain_mps2, gain_mps2)
    braking = (gain_ahead_mps2 < _BRAKING_MPS2) | (np.abs(speed_mps) < _STANDING_MPS)
    braking &= signals & HAZARD_LIGHTS != HAZARD_LIGHTS  # who shows both blinkers is there to stay
    lights = np.full(len(signals), Light.LOW_BEAM if needs_low_beam(weather) else 0, np.uint16)
    for light, on in (
        (Light.BRAKE, braking),
        (Light.TURN_LEFT, bright & (signals & _SUMO_LEFT > 0)),
        (Light.TURN_RIGHT, bright & (signals & _SUMO_RIGHT > 0)),
        (Light.REVERSE, reversing),
        (Light.EMERGENCY, beacons),
    ):
        lights[on] |= np.uint16(light)
    return lights


def blinks(cycles: Float64Array, time_s: float, rate_hz: float) -> BoolArray:
    """(V,) whether lights that blink are in their bright half; (V,) ``cycles``: their places in the cycle at time 0."""
    return (time_s * rate_hz + cycles) % 1.0 < 0.5


def needs_low_beam(weather: Weather) -> bool:
    """Whether drivers switch their lights on: dusk and night, heavy rain, thick fog."""
    return (
        weather.sun_altitude_deg < _LOW_SUN_DEG
        or weather.precipitation > _HEAVY_RAIN
        or weather.fog_density > _THICK_FOG
    )
