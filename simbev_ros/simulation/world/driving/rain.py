"""Reaction of drivers to rain and puddles.

Desired speeds fall in proportion to precipitation, by up to 9 %. A wet road costs a lane up to 11 % of its capacity:
time gaps grow to up to 1 / 0.89 of those on a dry road. On motorways, speeds were found to be 8.4 % lower in very heavy
rain ("Impact of Rain Intensity on Interstate Traffic Speeds Using Connected Vehicle Data", Vehicles 5(1), 2023), and
capacities 4 to 10 % lower in light rain (Smith et al., "An Investigation into the Impact of Rainfall on Freeway Traffic
Flow", Transportation Research Board, 2004).
"""

from typing import NamedTuple

from simbev_ros.schema.scene.weather import Weather

_MAX_SPEED_LOSS = 0.09
_MAX_CAPACITY_LOSS = 0.11


class RainEffect(NamedTuple):
    """Factors on the desired speed and on the headway."""

    speed: float
    headway: float


def rain_effect(weather: Weather) -> RainEffect:
    """Compute the factors: speed falls with precipitation, headway grows with precipitation or deposits."""
    wetness = max(weather.precipitation, weather.precipitation_deposits) / 100.0
    return RainEffect(
        speed=1.0 - _MAX_SPEED_LOSS * weather.precipitation / 100.0,
        headway=1.0 / (1.0 - _MAX_CAPACITY_LOSS * wetness),
    )
