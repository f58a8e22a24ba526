"""Names the time of day and the weather of a frame, the conditions by which evaluation tables are sliced.

Both are derived from the frame's weather parameters. Each frame has exactly one of each.
"""

from simbev_ros.schema.scene.weather import Weather

DAYTIMES: tuple[str, ...] = ("day", "twilight", "night")
WEATHERS: tuple[str, ...] = ("clear", "cloudy", "fog", "rain")
_CIVIL_TWILIGHT_DEG = 6.0
_MIN_RAIN_PERCENT, _MIN_FOG_PERCENT, _MIN_CLOUDS_PERCENT = 10.0, 20.0, 60.0


def daytime_of(weather: Weather) -> str:
    """Name of the time of day for a weather, one of ``DAYTIMES``.

    It is twilight while the sun is within 6° of the horizon, which is civil twilight, and night below that.
    """
    if abs(weather.sun_altitude_deg) <= _CIVIL_TWILIGHT_DEG:
        return "twilight"
    return "day" if weather.sun_altitude_deg > 0 else "night"


def weather_of(weather: Weather) -> str:
    """Name of a weather, one of ``WEATHERS``.

    Rain: a precipitation of at least 10 %; else fog: a density of at least 20 %; else cloudy: at least 60 % clouds.
    """
    if weather.precipitation >= _MIN_RAIN_PERCENT:
        return "rain"
    if weather.fog_density >= _MIN_FOG_PERCENT:
        return "fog"
    return "cloudy" if weather.cloudiness >= _MIN_CLOUDS_PERCENT else "clear"
