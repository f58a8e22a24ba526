"""The direction of the sun, against published positions."""

import datetime

import pytest

from simbev_ros.foundation.geometry.sun import sun_direction_deg

JUNE, DECEMBER, MARCH = (datetime.date(2026, *day) for day in ((6, 21), (12, 21), (3, 20)))


@pytest.mark.parametrize(
    ("date", "hour", "latitude_deg", "azimuth_deg", "altitude_deg"),
    [
        (JUNE, 12.0, 48.0, 180.0, 90.0 - 48.0 + 23.44),
        (DECEMBER, 12.0, 48.0, 180.0, 90.0 - 48.0 - 23.44),
        (JUNE, 12.0, -35.0, 0.0, 90.0 - 35.0 - 23.44),
        (MARCH, 6.0, 0.0, 90.0, 0.0),
        (MARCH, 18.0, 51.0, 270.0, 0.0),
        (JUNE, 0.0, 48.0, 0.0, 23.44 - 42.0),
        (JUNE, 0.0, 70.0, 0.0, 3.44),  # the sun of midnight
        (JUNE, 9.0, 40.0, 99.8, 48.8),  # ASHRAE's table for 40° N
        (DECEMBER, 15.0, 40.0, 221.9, 14.0),
    ],
)
def test_the_sun_is_where_tables_have_it(
    date: datetime.date, hour: float, latitude_deg: float, azimuth_deg: float, altitude_deg: float
) -> None:
    azimuth, altitude = sun_direction_deg(date, hour, latitude_deg)
    assert altitude == pytest.approx(altitude_deg, abs=0.5)
    assert (azimuth - azimuth_deg + 180.0) % 360.0 - 180.0 == pytest.approx(0.0, abs=0.6)
