"""Transmission of light through rain and fog: one extinction law shared by cameras and lidars.

Fog of CARLA's density 100 has an optical depth of 0.042 per meter (a meteorological visibility of 94 m); it scales with
the square of the density. Fog begins at a given distance and thins out with height. Rain of precipitation 100 has
an optical depth of 0.002 per meter.
"""

import numpy as np

from simbev_ros.foundation.types import Float64Array
from simbev_ros.schema.scene.weather import Weather

FOG_FLOOR_M = -30.0
"""Map height below which fog does not get any denser."""

_FOG_HALVINGS_PER_M = 0.06
_FOG_FALLOFF_PER_M = 0.02
_RAIN_HALVINGS_PER_M = 1.0 / 350.0
_MIN_LOG_RATIO = 1e-2
_MAX_DOUBLINGS = 30.0
"""Limit that keeps ground-hugging fog below height 0 finite; visibility is zero at a small fraction of this density."""


def fog_halvings_per_m(weather: Weather) -> float:
    """Number of times that a meter of fog at height 0 halves the light."""
    return (weather.fog_density / 100.0) ** 2 * _FOG_HALVINGS_PER_M


def fog_falloff_per_m(weather: Weather) -> float:
    """Number of times that the fog density halves per meter of height."""
    return weather.fog_falloff * _FOG_FALLOFF_PER_M


def rain_halvings_per_m(weather: Weather) -> float:
    """Number of times that a meter of rain halves the light."""
    return float((weather.precipitation / 100.0) ** 1.5 * _RAIN_HALVINGS_PER_M)


def extinction_per_m(weather: Weather, height_m: float) -> tuple[float, float]:
    """Optical depth per meter of fog (beyond its start distance) and of rain, at a map height."""
    doublings = min(-fog_falloff_per_m(weather) * max(height_m, FOG_FLOOR_M), _MAX_DOUBLINGS)
    fog = fog_halvings_per_m(weather) * 2.0**doublings
    return fog * np.log(2.0), rain_halvings_per_m(weather) * np.log(2.0)


def optical_depth(
    weather: Weather, from_height_m: Float64Array, to_height_m: Float64Array, range_m: Float64Array
) -> Float64Array:
    """(N,) optical depth (base e) of straight paths, ``range_m`` long, between (N,) map heights.

    Fog begins at its start distance from the beginning of each path.
    """
    falloff = fog_falloff_per_m(weather)
    in_fog_m = np.maximum(range_m - weather.fog_distance_m, 0.0)
    fog_fraction = in_fog_m / np.maximum(range_m, 1e-9)
    start_m = np.maximum(to_height_m + (from_height_m - to_height_m) * fog_fraction, FOG_FLOOR_M)
    end_m = np.maximum(to_height_m, FOG_FLOOR_M)
    start, end = (np.exp2(np.minimum(-height_m * falloff, _MAX_DOUBLINGS)) for height_m in (start_m, end_m))
    log_ratio = (end_m - start_m) * falloff * np.log(2.0)
    varies = np.abs(log_ratio) > _MIN_LOG_RATIO
    mean = np.where(varies, (start - end) / np.where(varies, log_ratio, 1.0), (start + end) / 2.0)
    halvings = fog_halvings_per_m(weather) * in_fog_m * mean + rain_halvings_per_m(weather) * range_m
    return halvings * np.log(2.0)
