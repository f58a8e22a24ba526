"""Drawn scenes against the paper's distributions: Kolmogorov–Smirnov with p > 0.01 over 2,000 fixed seeds."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from simbev_ros.config.draw import Distribution
from simbev_ros.config.hazards import Hazards
from simbev_ros.config.load import load_scenario
from simbev_ros.config.scenario import Scenario, Timing
from simbev_ros.config.traffic import Traffic
from simbev_ros.config.weather import WEATHER_PARAMETERS, WeatherConfig, WeatherParameters
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.build import load_network
from simbev_ros.maps.source import known_maps
from simbev_ros.scene.blueprints import load_blueprints
from simbev_ros.scene.drawing.draw_scene import PlannedScene, draw_scene, start_positions
from simbev_ros.scene.drawing.draw_weather import draw_weathers, fog_fills_heights
from simbev_ros.schema.scene.map_spec import MapSpec
from simbev_ros.schema.scene.spec import SceneSpec

SCENES = 2000
MIN_P = 0.01
UNIFORM = stats.uniform()


def agrees(values: Float64Array, distribution: object) -> bool:
    """Whether values may come from one of scipy's distributions."""
    assert len(values) > 200
    return bool(stats.kstest(values, distribution.cdf).pvalue > MIN_P)  # type: ignore[attr-defined]


def agrees_clipped(values: Float64Array, distribution: object, low: float, high: float) -> bool:
    """Like ``agrees`` for draws clipped to an interval: checks the shares at its ends and the values in between."""
    below, above = distribution.cdf(low), distribution.sf(high)  # type: ignore[attr-defined]
    inside = values[(values > low) & (values < high)]
    quantiles = (distribution.cdf(inside) - below) / (1 - below - above)  # type: ignore[attr-defined]
    return (
        is_share(np.count_nonzero(values == low), len(values), below)
        and is_share(np.count_nonzero(values == high), len(values), above)
        and agrees(quantiles, UNIFORM)
    )


def is_share(count: int, of: int, probability: float) -> bool:
    """Whether ``count`` of ``of`` draws are plausible at this probability."""
    return bool(stats.binomtest(int(count), of, probability).pvalue > MIN_P)


@pytest.fixture(scope="module", params=["weather", pytest.param("final", marks=pytest.mark.slow)])
def weather(request: pytest.FixtureRequest) -> dict[str, Float64Array]:
    """(2000,) draws of each parameter: of the initial weather, or of the final one, which follows the same rules."""
    config = WeatherConfig(final=WeatherParameters())
    pairs = [draw_weathers(config, seed, even_fog=False) for seed in range(SCENES)]
    drawn = [pair[request.param == "final"] for pair in pairs]
    return {name: np.array([getattr(each, name) for each in drawn]) for name in WEATHER_PARAMETERS}


def test_independent_weather_parameters_are_as_in_the_paper(weather: dict[str, Float64Array]) -> None:
    assert agrees(weather["cloudiness"] / 100, stats.beta(0.8, 1.0))
    assert agrees(weather["wind_intensity"], stats.uniform(0, 100))
    assert agrees(weather["sun_azimuth_deg"], stats.uniform(0, 360))
    assert agrees((weather["sun_altitude_deg"] + 90) / 180, stats.beta(3.6, 2.0))


def test_it_rains_only_under_clouds_and_wets_the_ground(weather: dict[str, Float64Array]) -> None:
    clouds, rain = weather["cloudiness"], weather["precipitation"]
    cloudy = clouds > 40
    assert not rain[~cloudy].any() and np.all(rain <= clouds)
    assert agrees(rain[cloudy] / clouds[cloudy], stats.beta(0.8, 0.2))
    not_drowned = rain < 99
    deposits = weather["precipitation_deposits"][not_drowned]
    assert agrees((deposits - rain[not_drowned]) / (100 - rain[not_drowned]), stats.beta(1.2, 1.6))


def test_wetness_is_normal_about_the_rain_and_clipped(weather: dict[str, Float64Array]) -> None:
    wetness, around = weather["wetness"], stats.norm(weather["precipitation"], 10)
    assert wetness.min() == 0 and wetness.max() == 100
    inside = (wetness > 0) & (wetness < 100)
    below, above = around.cdf(0), around.sf(100)
    assert agrees(((around.cdf(wetness) - below) / (1 - below - above))[inside], UNIFORM)
    for clipped, chance in ((wetness == 0, below), (wetness == 100, above)):
        spread = np.sqrt((chance * (1 - chance)).sum())
        assert abs(clipped.sum() - chance.sum()) < 2.6 * spread


def test_fog_needs_clouds_or_a_low_sun(weather: dict[str, Float64Array]) -> None:
    fog, may_be = weather["fog_density"], (weather["cloudiness"] > 40) | (weather["sun_altitude_deg"] < 10)
    assert not fog[~may_be].any()
    assert agrees(fog[may_be] / 100, stats.beta(1.6, 2.0))
    thick = fog > 10
    assert np.all(weather["fog_distance_m"][~thick] == 0) and np.all(weather["fog_falloff"][~thick] == 1)
    assert agrees(weather["fog_distance_m"][thick], stats.lognorm(0.8, scale=np.exp(3.2)))
    assert agrees(weather["fog_falloff"][thick] / 5, stats.beta(1.2, 2.4))


def test_fog_of_the_same_density_at_all_heights() -> None:
    drawn = [draw_weathers(WeatherConfig(), seed, even_fog=True)[0] for seed in range(200)]
    assert {each.fog_falloff for each in drawn} == {0.01, 1.0}
    assert all((each.fog_falloff == 0.01) == (each.fog_density > 10) for each in drawn)
    network = load_network(MapSpec(name="Blocks"))
    high = replace(
        network,
        lanes={name: replace(lane, centerline_m=lane.centerline_m + 30.0) for name, lane in network.lanes.items()},
    )
    towns = [name for name in known_maps() if fog_fills_heights(MapSpec(name=name), high)]
    assert towns == ["Town12", "Town13", "Town15"]
    file = MapSpec(name="hills", path="/maps/hills.xodr")
    assert fog_fills_heights(file, high) and not fog_fills_heights(file, network)


def test_parameters_without_a_rule_between_them_are_uncorrelated() -> None:
    pairs = [
        draw_weathers(WeatherConfig(final=WeatherParameters()), seed, even_fog=False)
        for seed in range(1000, 1000 + SCENES)
    ]
    free = ("cloudiness", "wind_intensity", "sun_azimuth_deg", "sun_altitude_deg")
    columns = np.array([[getattr(each, name) for each in pair for name in free] for pair in pairs]).T  # type: ignore[arg-type]
    correlation = stats.spearmanr(columns.T).statistic
    assert np.abs(correlation - np.eye(len(columns))).max() < 4 / SCENES**0.5


_VEHICLE_FIELDS = (
    *("speed_factor", "min_gap_m", "headway_s", "lane_change_eagerness"),
    *("reckless", "distracted", "emergency_lights"),
)
PLANNED = PlannedScene(0, MapSpec(name="Blocks"), "train")


def small_scenes(scenario: Scenario, count: int = SCENES) -> Iterator[SceneSpec]:
    network = load_network(PLANNED.map)
    starts = start_positions(scenario, network)
    for number in range(count):
        yield draw_scene(scenario, PLANNED._replace(number=number), network, starts)


@pytest.mark.slow
@pytest.mark.parametrize("count", [400, SCENES])
def test_the_ego_its_driver_signals_and_duration(count: int) -> None:
    time = Timing(duration_s=Distribution(uniform=(4, 20)))
    empty = {"traffic": Traffic(vehicles=0, pedestrians=0), "hazards": Hazards(count=0), "time": time}
    scenario = load_scenario("paper").model_copy(update=empty)
    starts = start_positions(scenario, load_network(PLANNED.map))
    ids = [
        starts.vehicles.waypoint(index)
        for index in np.flatnonzero(starts.usable(time.warm_up_s + 20.0)["vehicle.sedan"])
    ]
    rank = {(waypoint.lane, waypoint.s_m): index for index, waypoint in enumerate(ids)}
    specs = list(small_scenes(scenario, count))
    egos = [spec.vehicles[0] for spec in specs]
    dither = np.random.default_rng(1).random(count)  # makes integers continuous
    ranks = np.array([rank[ego.start.lane, ego.start.s_m] for ego in egos])
    assert agrees((ranks + dither) / len(ids), UNIFORM)
    ticks = np.array([spec.ticks for spec in specs])
    assert agrees((ticks + dither - 0.5) * time.tick_s, stats.uniform(4, 16))
    assert agrees(np.array([ego.speed_factor for ego in egos]), stats.uniform(0.8, 0.6))
    assert agrees_clipped(np.array([ego.min_gap_m for ego in egos]), stats.norm(3.2, 1.0), 0.5, 10)
    assert agrees(np.concatenate([spec.green_time_s for spec in specs]), stats.uniform(4, 24))
    assert is_share(sum(ego.reckless for ego in egos), count, 0.01)
    assert agrees(np.array([spec.walker_cross_factor for spec in specs]), stats.beta(2.4, 1.6))


def test_drivers_ignore_what_the_configuration_says_and_pedestrians_have_wheelchairs() -> None:
    probabilities = {"lights": 0.5, "signs": 0.0, "vehicles": 1.0, "pedestrians": 0.3}
    ignoring = {f"ignore_{what}_probability": share for what, share in probabilities.items()}
    traffic = Traffic(vehicles=40, pedestrians=60, reckless_probability=0, distracted_probability=0)
    usual = load_scenario("paper").model_copy(update={"traffic": traffic})
    changed = traffic.model_copy(update=ignoring | {"wheelchair_probability": 0.4})
    specs = list(small_scenes(usual.model_copy(update={"traffic": changed}), 12))
    vehicles = [vehicle for spec in specs for vehicle in spec.vehicles]
    for what, share in probabilities.items():
        assert is_share(sum(what in each.ignored for each in vehicles), len(vehicles), share)
    walkers = [each for spec in specs for each in spec.pedestrians]
    assert is_share(sum(each.blueprint == "pedestrian.wheelchair" for each in walkers), len(walkers), 0.4)
    careful = next(small_scenes(usual, 1))
    assert [each.model_copy(update={"ignores": ()}) for each in specs[0].vehicles] == list(careful.vehicles)
    assert "ignores" not in careful.model_dump_json()


@pytest.mark.slow
def test_vehicles_and_pedestrians() -> None:
    # Hazards occupy start positions, and companions walk at one speed.
    changes = {"hazards": Hazards(count=0), "traffic": Traffic(group_probability=0)}
    scenario = load_scenario("paper").model_copy(update=changes)
    starts = start_positions(scenario, load_network(PLANNED.map))
    shares, pedestrian_counts, vehicles, walking_speeds_mps = [], [], [], []
    position_m = {
        (waypoint.lane, waypoint.s_m): starts.vehicles.position_m[index]
        for index in range(len(starts.vehicles))
        for waypoint in [starts.vehicles.waypoint(index)]
    }
    usable = np.any(list(starts.usable(scenario.time.warm_up_s + 16.0).values()), axis=0)
    rng = np.random.default_rng(2)
    for spec in small_scenes(scenario):
        ego = spec.vehicles[0].start
        free = np.count_nonzero(usable & starts.vehicles.within_radius(position_m[ego.lane, ego.s_m], 400)) - 1
        shares.append((len(spec.vehicles) - 1 + rng.random()) / (free - 2))
        pedestrian_counts.append(len(spec.pedestrians) + rng.random())
        vehicles += spec.vehicles[1:]
        walking_speeds_mps += [
            each.max_speed_mps for each in spec.pedestrians if each.blueprint != "pedestrian.wheelchair"
        ]
    assert agrees(np.array(shares), UNIFORM)
    assert agrees(np.array(pedestrian_counts), stats.uniform(0, 641))
    drawn = {name: np.array([getattr(each, name) for each in vehicles], float) for name in _VEHICLE_FIELDS}
    assert agrees(drawn["speed_factor"], stats.uniform(0.8, 0.6))
    assert agrees_clipped(drawn["min_gap_m"], stats.norm(3.2, 1.0), 0.5, 10)
    assert agrees_clipped(drawn["headway_s"], stats.norm(1.2, 0.25), 0.7, 2.5)
    assert agrees_clipped(drawn["lane_change_eagerness"], stats.lognorm(0.6), 0.1, 5)
    assert is_share(drawn["reckless"].sum(), len(vehicles), 0.01)
    assert is_share(drawn["distracted"].sum(), len(vehicles), 0.02)
    emergency = {blueprint.name for blueprint in load_blueprints() if blueprint.emergency}
    is_lit = [each.emergency_lights for each in vehicles if each.blueprint in emergency]
    assert is_share(sum(is_lit), len(is_lit), 0.5)
    assert sum(is_lit) == drawn["emergency_lights"].sum()
    assert agrees_clipped(np.array(walking_speeds_mps), stats.lognorm(0.64, scale=np.exp(0.16)), 0.8, 8)
