"""Lights of vehicles, from their motion, SUMO's signals and the weather."""

import numpy as np

from simbev_ros.foundation.types import BoolArray, Float64Array, Int64Array, UInt16Array
from simbev_ros.schema.scene.state import Light
from simbev_ros.schema.scene.weather import Weather

BLINKER_HZ = 1.5
BEACON_HZ = 2.0
RIGHT_BLINKER, LEFT_BLINKER = 1, 2
"""Bits in SUMO's vehicle signals."""
HAZARD_LIGHTS = RIGHT_BLINKER | LEFT_BLINKER
"""Bits of both blinkers in SUMO's vehicle signals."""
_BRAKING_MPS2 = -0.6
_STANDING_MPS = 0.1
_REVERSING_MPS = -0.1


def vehicle_lights(
    signals: Int64Array,
    speed_mps: Float64Array,
    acceleration_mps2: Float64Array,
    blinker_bright: BoolArray,
    beacon_bright: BoolArray,
    weather: Weather,
    in_tunnel: BoolArray,
) -> UInt16Array:
    """(V,) uint16 ``Light`` bits.

    Args:
        signals: (V,) SUMO's vehicle signals.
        speed_mps: (V,) velocity along the heading.
        acceleration_mps2: (V,) acceleration along the heading.
        blinker_bright: (V,) whether an active blinker is in its bright half.
        beacon_bright: (V,) whether the blue lights are lit now.
        weather: Weather and light at this tick.
        in_tunnel: (V,) whether the vehicle is in a tunnel.
    """
    reversing = speed_mps < _REVERSING_MPS
    speed_change_mps2 = np.where(reversing, -acceleration_mps2, acceleration_mps2)
    braking = (speed_change_mps2 < _BRAKING_MPS2) | (np.abs(speed_mps) < _STANDING_MPS)
    braking &= signals & HAZARD_LIGHTS != HAZARD_LIGHTS  # hazard lights: the vehicle is parked, not braking
    lights = np.zeros(len(signals), np.uint16)
    for light, on in (
        (Light.LOW_BEAM, in_tunnel | weather.needs_low_beam),
        (Light.BRAKE, braking),
        (Light.TURN_LEFT, blinker_bright & (signals & LEFT_BLINKER > 0)),
        (Light.TURN_RIGHT, blinker_bright & (signals & RIGHT_BLINKER > 0)),
        (Light.REVERSE, reversing),
        (Light.EMERGENCY, beacon_bright),
    ):
        lights[on] |= np.uint16(light)
    return lights


def is_bright(phases: Float64Array, time_s: float, rate_hz: float) -> BoolArray:
    """(V,) whether blinking lights are in their bright half, for (V,) positions in the cycle at time 0."""
    return (time_s * rate_hz + phases) % 1.0 < 0.5
