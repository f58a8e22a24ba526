"""The season of a scene: drawn, given, or that of a date."""

import datetime
from collections import Counter

import numpy as np
import pytest

from simbev_ros.config.weather import SEASONS, Season, Sun, WeatherConfig, WeatherParameters
from simbev_ros.foundation.geometry.geodesy import MapDatum
from simbev_ros.scene.drawing.draw_weather import draw_season, draw_weather, draw_weathers


def test_every_season_is_equally_likely_and_changes_no_other_draw() -> None:
    counts = Counter(draw_season(WeatherConfig(), seed) for seed in range(2000))
    assert counts.keys() == set(SEASONS)
    assert np.abs(np.array(list(counts.values())) / 500.0 - 1.0).max() < 0.15
    drawn = [draw_weather(WeatherConfig(season=season), 5, even_fog=False) for season in SEASONS]
    assert all(each.sun_azimuth_deg == drawn[0].sun_azimuth_deg for each in drawn)


@pytest.mark.parametrize(
    ("month", "north", "south"),
    [
        (1, "winter", "summer"),
        (3, "spring", "autumn"),
        (8, "summer", "winter"),
        (11, "autumn", "spring"),
        (12, "winter", "summer"),
    ],
)
def test_a_date_gives_the_season_of_its_hemisphere(month: int, north: Season, south: Season) -> None:
    for latitude_deg, season in ((52.2, north), (-33.9, south)):
        there = WeatherConfig(sun=Sun(date=datetime.date(2026, month, 15), hour=12, latitude_deg=latitude_deg))
        of_map = WeatherConfig(sun=Sun(date=datetime.date(2026, month, 15), hour=12))
        assert draw_season(there, 1) == season
        assert draw_season(of_map, 1, MapDatum(latitude_deg, 0.0, 0.0)) == season


def test_a_given_season_holds_whatever_the_date() -> None:
    sun = Sun(date=datetime.date(2026, 7, 1), hour=12)
    assert draw_season(WeatherConfig(season="winter", sun=sun), 1) == "winter"


def test_snow_leaves_and_flowers_have_their_seasons() -> None:
    drawn = {
        season: [draw_weather(WeatherConfig(), seed, even_fog=False, season=season) for seed in range(300)]
        for season in SEASONS
    }
    assert not any(weather.snow_cover or weather.leaf_litter or weather.flowers for weather in drawn["summer"])
    assert not any(weather.snow_cover for season in ("spring", "autumn") for weather in drawn[season])
    dry = [weather.snow_cover for weather in drawn["winter"] if weather.precipitation == 0.0]
    assert 0.3 < np.mean(np.array(dry) > 0.0) < 0.5 and max(dry) <= 100.0
    assert not any(weather.snow_cover for weather in drawn["winter"] if weather.precipitation > 0.0)
    assert min(weather.leaf_litter for weather in drawn["autumn"]) >= 20.0
    assert min(weather.flowers for weather in drawn["spring"]) >= 20.0


def test_snow_stays_while_the_weather_changes_unless_both_ends_are_given() -> None:
    config = WeatherConfig(season="winter", precipitation=0.0, final=WeatherParameters(precipitation=90.0))
    for seed in range(20):
        first, final = draw_weathers(config, seed, even_fog=False)
        assert final is not None and final.snow_cover == first.snow_cover
    thaw = config.model_copy(update={"snow_cover": 80.0, "final": WeatherParameters(snow_cover=10.0)})
    first, final = draw_weathers(thaw, 1, even_fog=False)
    assert final is not None and (first.snow_cover, final.snow_cover) == (80.0, 10.0)
