"""Draw the weather of a scene: by the paper's table, or by what the configuration fixes or draws differently."""

import math
from collections.abc import Callable

import numpy as np

from simbev_ros.config.draw import sample
from simbev_ros.config.weather import SEASONS, WEATHER_PARAMETERS, Season, WeatherConfig, WeatherParameters
from simbev_ros.foundation.geometry.geodesy import MapDatum
from simbev_ros.foundation.geometry.sun import sun_direction_deg
from simbev_ros.foundation.random import stream
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.schema.scene.map_spec import MapSpec
from simbev_ros.schema.scene.weather import Weather

_FOGGY_TOWNS = ("Town12", "Town13", "Town15")
_NO_PLACE = MapDatum(0.0, 0.0, 0.0)
_SLOW = ("snow_cover", "leaf_litter", "flowers")  # the same at the start and at the end, unless given
_HIGH_M = 20.0  # where the fastest falloff that is drawn leaves a quarter of the fog


def fog_fills_heights(spec: MapSpec, network: RoadNetwork) -> bool:
    """Whether fog has the same density at all heights of a map.

    It does in three towns, as in the paper, and on map files with roads far above or below height 0.
    """
    if not spec.path:
        return spec.name in _FOGGY_TOWNS
    return any(bool(np.any(np.abs(lane.centerline_m[:, 2]) > _HIGH_M)) for lane in network.lanes.values())


def draw_season(config: WeatherConfig, seed: int, datum: MapDatum = _NO_PLACE) -> Season:
    """Draw the season, unless it is given or follows from the date; south of the equator it is the opposite one."""
    if config.season is not None:
        return config.season
    if config.sun is None:
        return SEASONS[int(stream(seed, "weather.season").integers(len(SEASONS)))]
    latitude_deg = datum.latitude_deg if config.sun.latitude_deg is None else config.sun.latitude_deg
    return SEASONS[(config.sun.date.month % 12 // 3 - 1 + (2 if latitude_deg < 0.0 else 0)) % len(SEASONS)]


def draw_weathers(
    config: WeatherConfig, seed: int, *, even_fog: bool, datum: MapDatum = _NO_PLACE
) -> tuple[Weather, Weather | None]:
    """Draw the weather at a scene's start and, if it changes, at its end; both independently by the same rules."""
    season = draw_season(config, seed, datum)
    first, final = draw_weather(config, seed, even_fog=even_fog, datum=datum, season=season), None
    if config.final is not None:
        final = draw_weather(config.final, seed, even_fog=even_fog, name="weather.final", datum=datum, season=season)
        on_ground = {name: getattr(first, name) for name in _SLOW if getattr(config.final, name) == "paper"}
        final = final.model_copy(update=on_ground)
    return first, final


def draw_weather(
    config: WeatherParameters,
    seed: int,
    *,
    even_fog: bool,
    name: str = "weather",
    datum: MapDatum = _NO_PLACE,
    season: Season = "summer",
) -> Weather:
    """Draw every parameter from a random stream of its own, so that fixing one does not change the others.

    Args:
        config: Requested value or distribution of each parameter.
        seed: The scene's seed.
        even_fog: ``fog_fills_heights`` of the map.
        name: Prefix of the random stream names.
        datum: Position of the map on Earth, for a sun by date and time.
        season: Season of the scene, for snow, fallen leaves and flowers.
    """
    drawn: dict[str, float] = {}
    given = _sun_of(config, seed, name, datum)

    def draw(parameter: str, paper: Callable[[np.random.Generator], float] | None = None) -> float:
        requested = given.get(parameter, getattr(config, parameter))
        rng = stream(seed, f"{name}.{parameter}")
        drawn[parameter] = paper(rng) if paper is not None and requested == "paper" else sample(requested, rng)
        return drawn[parameter]

    clouds = draw("cloudiness", lambda rng: 100 * rng.beta(0.8, 1.0))
    rain = draw("precipitation", lambda rng: rng.beta(0.8, 0.2) * clouds if clouds > 40 else 0.0)
    draw("precipitation_deposits", lambda rng: rain + rng.beta(1.2, 1.6) * (100 - rain))
    draw("wetness", lambda rng: float(np.clip(rng.normal(rain, 10), 0, 100)))
    draw("wind_intensity", lambda rng: rng.uniform(0, 100))
    draw("sun_azimuth_deg", lambda rng: rng.uniform(0, 360))
    altitude = draw("sun_altitude_deg", lambda rng: 180 * rng.beta(3.6, 2.0) - 90)
    fog = draw("fog_density", lambda rng: 100 * rng.beta(1.6, 2.0) if clouds > 40 or altitude < 10 else 0.0)
    draw("fog_distance_m", lambda rng: rng.lognormal(3.2, 0.8) if fog > 10 else 0.0)
    draw("fog_falloff", lambda rng: (0.01 if even_fog else 5 * rng.beta(1.2, 2.4)) if fog > 10 else 1.0)
    snowy = season == "winter" and rain == 0.0
    draw("snow_cover", lambda rng: rng.uniform(40, 100) if snowy and rng.random() < 0.4 else 0.0)
    most = {"autumn": (20, 100), "winter": (0, 30)}.get(season, (0, 0))
    draw("leaf_litter", lambda rng: rng.uniform(*most))
    draw("flowers", lambda rng: rng.uniform(20, 100) if season == "spring" else 0.0)
    for parameter in WEATHER_PARAMETERS.keys() - drawn:
        draw(parameter)
    return Weather(**drawn)


def _sun_of(config: WeatherParameters, seed: int, name: str, datum: MapDatum) -> dict[str, float]:
    """Direction of the sun by date and time, if that is given, in the map's axes."""
    if config.sun is None:
        return {}
    latitude_deg = datum.latitude_deg if config.sun.latitude_deg is None else config.sun.latitude_deg
    hour = sample(config.sun.hour, stream(seed, f"{name}.sun.hour"))
    azimuth_deg, altitude_deg = sun_direction_deg(config.sun.date, hour, latitude_deg)
    return {
        "sun_azimuth_deg": (math.degrees(datum.north_rad) - azimuth_deg) % 360.0,
        "sun_altitude_deg": altitude_deg,
    }
