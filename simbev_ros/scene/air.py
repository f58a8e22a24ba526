"""How far light gets through rain and fog: one law for cameras and lidars.

Fog of CARLA's density 100 has an optical depth of 0.042 per metre (a meteorological visibility of 94 m), and less with
the square of the density. It begins at a distance and thins with height. Rain of precipitation 100 has 0.002 per metre.
"""

import numpy as np

from simbev_ros.scene.weather import Weather
from simbev_ros.types import Float64Array

FOG_FLOOR_M = -30.0
"""Of height in the map; below, fog gets no thicker."""

_FOG_HALVINGS_PER_M = 0.06
_FOG_FALLOFF_PER_M = 0.02
_RAIN_HALVINGS_PER_M = 1.0 / 350.0
_LEAST_FALL = 1e-2
_MOST_DOUBLINGS = 30.0
"""Fog below height 0 that hugs the ground would exceed all numbers; nothing is seen in far less."""


def fog_halvings_per_m(weather: Weather) -> float:
    """How often light is halved per metre of fog at height 0."""
    return (weather.fog_density / 100.0) ** 2 * _FOG_HALVINGS_PER_M


def fog_falloff_per_m(weather: Weather) -> float:
    """How often fog is halved per metre of height."""
    return weather.fog_falloff * _FOG_FALLOFF_PER_M


def rain_halvings_per_m(weather: Weather) -> float:
    """How often light is halved per metre of rain."""
    return float((weather.precipitation / 100.0) ** 1.5 * _RAIN_HALVINGS_PER_M)


def extinction_per_m(weather: Weather, height_m: float) -> tuple[float, float]:
    """Optical depth per metre of fog, where it has begun, and of rain at a height in the map."""
    doublings = min(-fog_falloff_per_m(weather) * max(height_m, FOG_FLOOR_M), _MOST_DOUBLINGS)
    fog = fog_halvings_per_m(weather) * 2.0**doublings
    return fog * np.log(2.0), rain_halvings_per_m(weather) * np.log(2.0)


def optical_depth(
    weather: Weather, from_height_m: Float64Array, to_height_m: Float64Array, range_m: Float64Array
) -> Float64Array:
    """(N,) optical depth, of base e, of straight ways between (N,) heights in the map, (N,) metres long.

    Fog begins at its distance from where the way starts.
    """
    falloff = fog_falloff_per_m(weather)
    in_fog_m = np.maximum(range_m - weather.fog_distance_m, 0.0)
    share = in_fog_m / np.maximum(range_m, 1e-9)
    start_m = np.maximum(to_height_m + (from_height_m - to_height_m) * share, FOG_FLOOR_M)
    end_m = np.maximum(to_height_m, FOG_FLOOR_M)
    start, end = (np.exp2(np.minimum(-height_m * falloff, _MOST_DOUBLINGS)) for height_m in (start_m, end_m))
    fall = (end_m - start_m) * falloff * np.log(2.0)
    steep = np.abs(fall) > _LEAST_FALL
    mean = np.where(steep, (start - end) / np.where(steep, fall, 1.0), (start + end) / 2.0)
    halvings = fog_halvings_per_m(weather) * in_fog_m * mean + rain_halvings_per_m(weather) * range_m
    depth: Float64Array = halvings * np.log(2.0)
    return depth
