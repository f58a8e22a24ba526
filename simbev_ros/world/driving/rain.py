"""How drivers react to rain and puddles.

Wanted speeds fall in proportion to precipitation, by up to 9 %; a wet road costs a lane up to 11 % of its capacity:
time gaps grow to up to 1 / 0.89 of those on a dry one. On motorways speeds were found to be 8.4 % lower in very heavy
rain ("Impact of Rain Intensity on Interstate Traffic Speeds Using Connected Vehicle Data", Vehicles 5(1), 2023), and
capacities 4 to 10 % lower in light rain (Smith et al., "An Investigation into the Impact of Rainfall on Freeway Traffic
Flow", Transportation Research Board, 2004).
"""

from typing import NamedTuple

from simbev_ros.scene.weather import Weather

_SLOWER = 0.09
_LESS_CAPACITY = 0.11


class RainEffect(NamedTuple):
    """Factors on the wanted speed and on the headway."""

    speed: float
    headway: float


def rain_effect(weather: Weather) -> RainEffect:
    """Speed falls with precipitation, headway grows with the wetter one of precipitation and deposits."""
    wet = max(weather.precipitation, weather.precipitation_deposits) / 100.0
    return RainEffect(
        speed=1.0 - _SLOWER * weather.precipitation / 100.0,
        headway=1.0 / (1.0 - _LESS_CAPACITY * wet),
    )
