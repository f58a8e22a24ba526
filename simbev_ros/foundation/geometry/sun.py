"""Direction of the sun at a place on Earth, by date and local solar time."""

import datetime
import math


def sun_direction_deg(date: datetime.date, solar_hour: float, latitude_deg: float) -> tuple[float, float]:
    """Azimuth and altitude of the sun, °: clockwise from north, 0 to 360, and above the horizon, -90 to 90.

    By the declination of NOAA's *General Solar Position Calculations* (a Fourier series by Spencer, 1971, good to
    0.04°) and the spherical triangle of pole, zenith and sun; without refraction.

    Args:
        date: Date.
        solar_hour: Local solar time, h; at 12 the sun is in the south (or north). Clocks differ from it by the distance
            from their meridian (4 minutes per degree), summer time, and up to 16 minutes in the course of a year.
        latitude_deg: Latitude, north positive.
    """
    year_rad = 2.0 * math.pi / 365.0 * (date.timetuple().tm_yday - 1 + (solar_hour - 12.0) / 24.0)
    declination_rad = (
        0.006918
        - 0.399912 * math.cos(year_rad)
        + 0.070257 * math.sin(year_rad)
        - 0.006758 * math.cos(2.0 * year_rad)
        + 0.000907 * math.sin(2.0 * year_rad)
        - 0.002697 * math.cos(3.0 * year_rad)
        + 0.00148 * math.sin(3.0 * year_rad)
    )
    latitude_rad, hour_rad = math.radians(latitude_deg), math.radians(15.0 * (solar_hour - 12.0))
    east = -math.cos(declination_rad) * math.sin(hour_rad)
    north = math.cos(latitude_rad) * math.sin(declination_rad) - math.sin(latitude_rad) * math.cos(
        declination_rad
    ) * math.cos(hour_rad)
    up = math.sin(latitude_rad) * math.sin(declination_rad) + math.cos(latitude_rad) * math.cos(
        declination_rad
    ) * math.cos(hour_rad)
    return math.degrees(math.atan2(east, north)) % 360.0, math.degrees(math.asin(max(-1.0, min(1.0, up))))
