"""How drivers react to rain and puddles.

After Rakha et al., "Inclement Weather Impacts on Freeway Traffic Stream Behavior" (Transportation Research Record 2071,
2008): free speed falls steadily with the intensity of rain, by 6 to 9 % in heavy rain; a wet road costs about 11 % of a
lane's capacity, that is, time gaps grow to 1 / 0.89 of those on a dry one.
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
