"""Weather changes linearly from an initial to a final draw; the sun takes the shorter way around."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError

from simbev_ros.config.load import load_scenario
from simbev_ros.config.traffic import Traffic
from simbev_ros.config.weather import WEATHER_PARAMETERS, WeatherConfig, WeatherParameters
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.geometry.geodesy import MapDatum
from simbev_ros.maps.build import load_network
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.scene.drawing.draw_scene import PlannedScene, draw_scene
from simbev_ros.scene.drawing.draw_weather import draw_season, draw_weather, draw_weathers
from simbev_ros.scene.drawing.starts import StartPositions
from simbev_ros.schema.scene.map_spec import MapSpec
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.weather import Weather

CONFIG = """scenes: [{map: Blocks, train: 1}]
rig: {sensors: []}
time: {warm_up_s: 1, duration_s: {uniform: [2.02, 2.98]}}
weather: {final: {cloudiness: 100, sun_altitude_deg: -30}}
traffic: {vehicles: 0, pedestrians: 0}
"""


def weather(**changes: float) -> Weather:
    return draw_weather(WeatherParameters(cloudiness=20, fog_density=0), 1, even_fog=False).model_copy(update=changes)


@cache
def network() -> RoadNetwork:
    return load_network(MapSpec(name="Blocks"))


@cache
def starts() -> StartPositions:
    return StartPositions(network(), Traffic().waypoint_spacing_m)


def draw(folder: Path, text: str = CONFIG, number: int = 0) -> SceneSpec:
    (folder / "config.yaml").write_text(text)
    planned = PlannedScene(number, MapSpec(name="Blocks"), "train")
    return draw_scene(load_scenario(folder / "config.yaml"), planned, network(), starts())


def test_weather_is_constant_in_the_warm_up_and_final_at_the_last_tick(tmp_path: Path) -> None:
    spec = draw(tmp_path)
    assert spec.final_weather is not None and spec.final_weather.cloudiness == 100
    assert spec.weather_at(-20) == spec.weather_at(0) == spec.weather
    for name in WEATHER_PARAMETERS:
        if name != "sun_azimuth_deg":
            now = [getattr(spec.weather_at(tick), name) for tick in range(spec.ticks)]
            ends = getattr(spec.weather, name), getattr(spec.final_weather, name)
            assert now == pytest.approx(np.linspace(*ends, spec.ticks))
    assert spec.weather_at(spec.ticks - 1) == spec.weather_at(spec.ticks + 5) == spec.final_weather


@pytest.mark.parametrize(
    ("start_deg", "end_deg", "middle_deg"), [(350, 20, 5), (20, 350, 5), (10, 180, 95), (200, 340, 270)]
)
def test_the_sun_takes_the_shorter_way(start_deg: float, end_deg: float, middle_deg: float) -> None:
    start, end = weather(sun_azimuth_deg=start_deg), weather(sun_azimuth_deg=end_deg)
    assert start.interpolate(end, 0.5).sun_azimuth_deg == pytest.approx(middle_deg)
    assert start.interpolate(end, 0.0).sun_azimuth_deg == start_deg
    assert start.interpolate(end, 1.0).sun_azimuth_deg == end_deg


def test_a_parameter_at_the_end_of_its_range_stays_in_it() -> None:
    wet = weather(precipitation=100.0, wetness=0.1)
    between = [wet.interpolate(wet, fraction) for fraction in np.linspace(0, 1, 1000).tolist()]
    assert {(each.precipitation, each.wetness) for each in between} == {(100.0, 0.1)}


def test_a_final_weather_changes_nothing_else(tmp_path: Path) -> None:
    moving, still = draw(tmp_path), draw(tmp_path, CONFIG.replace("weather: {final: ", "# "))
    assert still.final_weather is None and still.weather_at(30) == still.weather
    assert moving.model_copy(update={"final_weather": None}) == still


def test_initial_and_final_weather_are_drawn_independently() -> None:
    initial, final = draw_weathers(WeatherConfig(final=WeatherParameters()), 4, even_fog=False)
    assert final is not None and initial.cloudiness != final.cloudiness
    season = draw_season(WeatherConfig(), 4)
    assert initial == draw_weather(WeatherParameters(), 4, even_fog=False, season=season)


def test_a_drawn_duration_is_rounded_to_whole_ticks(tmp_path: Path) -> None:
    ticks = [draw(tmp_path, number=number).ticks for number in range(12)]
    assert min(ticks) >= 40 and max(ticks) <= 60
    assert len(set(ticks)) > 5


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            CONFIG.replace("uniform: [2.02, 2.98]", "normal: [3, 1]"),
            "time.duration_s: draws from -inf to inf, .* bound",
        ),
        (CONFIG.replace("-30}}", "-30, final: {}}}"), "weather.final.final: unknown key"),
        (CONFIG.replace("-30}}", "-300}}"), "weather.final.sun_altitude_deg: is -300, but -90 to 90 is allowed"),
    ],
)
def test_bad_values_are_refused(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        draw(tmp_path, text)


def test_no_rain_means_dry_ground_unless_the_ground_is_given() -> None:
    for seed in range(20):
        dry = draw_weather(WeatherParameters(precipitation=0), seed, even_fog=False)
        assert (dry.wetness, dry.precipitation_deposits) == (0.0, 0.0)
    by_paper = WeatherParameters(precipitation=0, wetness="paper", precipitation_deposits=30)
    drawn = [draw_weather(by_paper, seed, even_fog=False) for seed in range(20)]
    assert max(each.wetness for each in drawn) > 0.0 and {each.precipitation_deposits for each in drawn} == {30.0}


def test_the_sun_follows_from_date_place_and_hour_on_maps_of_any_direction() -> None:
    noon = WeatherParameters.model_validate({"sun": {"date": "2026-06-21", "hour": 12}})
    for turned_rad in (0.0, 1.0):
        datum = MapDatum(48.0, 11.0, 500.0, MapDatum(48.0, 11.0, 500.0).proj_string, heading_rad=turned_rad)
        drawn = draw_weather(noon, 3, even_fog=False, datum=datum)
        assert drawn.sun_altitude_deg == pytest.approx(65.44, abs=0.1)
        south_deg = 270.0 - np.degrees(turned_rad)  # counterclockwise from map x
        assert drawn.sun_azimuth_deg == pytest.approx(south_deg, abs=0.1)
    again = WeatherParameters.model_validate(noon.model_dump(mode="json"))
    assert draw_weather(again, 3, even_fog=False) == draw_weather(noon, 3, even_fog=False)
    with pytest.raises(ValidationError, match="sun and sun_altitude_deg are set; give one of them"):
        WeatherParameters.model_validate({"sun": {"date": "2026-06-21", "hour": 12}, "sun_altitude_deg": 3})
