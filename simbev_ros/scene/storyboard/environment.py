"""The weather that an ``Environment`` element asks for, as parameters of a scene's weather."""

import math
from collections.abc import Mapping

from simbev_ros.foundation.geometry.geodesy import MapDatum
from simbev_ros.foundation.geometry.sun import sun_direction_deg
from simbev_ros.scene.storyboard.model import TABLE, Element

_VISIBILITY = 3.912  # optical depth at the visual range, where 2 % of the contrast is left (Koschmieder, 1924)
_FOG_PER_M, _RAIN_PER_M = 0.06 * math.log(2.0), math.log(2.0) / 350.0  # at 100 %, as in scene.air
_STRONG_WIND_MPS = 20.0
_WETNESS: Mapping[str, tuple[float, float]] = {
    "dry": (0.0, 0.0),
    "moist": (40.0, 0.0),
    "wetWithPuddles": (80.0, 50.0),
    "lowFlooded": (100.0, 80.0),
    "highFlooded": (100.0, 100.0),
}
"""Wetness and area of puddles, %."""


def weather_of(environment: Element, datum: MapDatum) -> dict[str, float]:
    """Parameters of ``schema.scene.weather.Weather`` that an ``Environment`` sets.

    Fog is as dense as its visual range says, rain as its intensity (extinction of 0.312 I^0.67 per km; Atlas, 1953).
    The sun is where the element says, else where it is at the time of day, read as solar time, at the map's latitude.
    """
    values: dict[str, float] = {}
    weather, time, road = environment.weather, environment.time_of_day, environment.road_condition
    if time is not None:
        date = time.date_time
        hour = date.hour + date.minute / 60.0 + date.second / 3600.0
        azimuth_deg, altitude_deg = sun_direction_deg(date.date(), hour, datum.latitude_deg)
        values |= _sun(math.radians(azimuth_deg), math.radians(altitude_deg), datum)
    if weather is not None:
        values |= _of_weather(weather, datum)
    if road is not None and road.wetness is not None:
        values["wetness"], values["precipitation_deposits"] = _WETNESS[road.wetness]
    return values


def _sun(azimuth_rad: float, elevation_rad: float, datum: MapDatum) -> dict[str, float]:
    """Direction of the sun from its azimuth, clockwise from north."""
    return {
        "sun_azimuth_deg": math.degrees(datum.north_rad - azimuth_rad) % 360.0,
        "sun_altitude_deg": math.degrees(math.remainder(elevation_rad, math.tau)),
    }


def _of_weather(weather: Element, datum: MapDatum) -> dict[str, float]:
    values: dict[str, float] = {}
    if weather.fractional_cloud_cover is not None:
        oktas = TABLE["enumerations"]["Cloud"].index(weather.fractional_cloud_cover)
        values["cloudiness"] = min(oktas / 8.0, 1.0) * 100.0
    if weather.sun is not None:
        values |= _sun(weather.sun.azimuth_rad, weather.sun.elevation_rad, datum)
    if weather.fog is not None:
        depth_per_m = _VISIBILITY / max(weather.fog.visual_range_m, 1.0)
        density = min(math.sqrt(depth_per_m / _FOG_PER_M), 1.0) * 100.0
        values |= {"fog_density": density, "fog_distance_m": 0.0, "fog_falloff": 0.01}
    if (rain := weather.precipitation) is not None:
        intensity = rain.precipitation_intensity_mmph or 0.0
        depth_per_m = 0.312e-3 * intensity**0.67
        share = min((depth_per_m / _RAIN_PER_M) ** (2.0 / 3.0), 1.0) * 100.0
        values["precipitation"] = share if rain.precipitation_type == "rain" else 0.0
        if rain.precipitation_type == "snow":
            values["snow_cover"] = 80.0
    if weather.wind is not None:
        values["wind_intensity"] = min(weather.wind.speed_mps / _STRONG_WIND_MPS, 1.0) * 100.0
    return values
