"""Conditions of a frame, by which tables are cut: time of day and weather, each frame one of each."""

from simbev_ros.scene.weather import Weather

DAYTIMES: tuple[str, ...] = ("day", "twilight", "night")
WEATHERS: tuple[str, ...] = ("clear", "cloudy", "fog", "rain")
_CIVIL_TWILIGHT_DEG = 6.0
_RAIN_FROM, _FOG_FROM, _CLOUDY_FROM = 10.0, 20.0, 60.0


def daytime_of(weather: Weather) -> str:
    """Of ``DAYTIMES``: twilight while the sun is within 6° of the horizon, as civil twilight is; night below."""
    if abs(weather.sun_altitude_deg) <= _CIVIL_TWILIGHT_DEG:
        return "twilight"
    return "day" if weather.sun_altitude_deg > 0 else "night"


def weather_of(weather: Weather) -> str:
    """Of ``WEATHERS``: rain from a precipitation of 10 on, else fog from a density of 20, else cloudy from 60, in %."""
    if weather.precipitation >= _RAIN_FROM:
        return "rain"
    if weather.fog_density >= _FOG_FROM:
        return "fog"
    return "cloudy" if weather.cloudiness >= _CLOUDY_FROM else "clear"
