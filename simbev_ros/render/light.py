"""The light of a moment: sun, moon, sky, clouds, fog and exposure from the weather, as the shaders read them."""

from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files

import numpy as np
import yaml

from simbev_ros.scene.weather import Weather
from simbev_ros.types import Float64Array

LAMPS_ON_BELOW_DEG = 3.0
"""Street lamps and lit windows are on while the sun is below this altitude."""

_LOWEST_MOON_DEG = 35.0
_LOWEST_KEY_DEG = 1.0
_CLOUD_DRIFT_PER_S = 4e-4
_HOUR_NS = 3600 * 10**9
_CLOUDS_APART = 0.618  # of the clouds' period, from scene to scene
_NOISE_PERIOD_M = 64.0
_AMBIENT_GAIN = 1.25
_AMBIENT_WHITENING = 0.65
_GROUND_ALBEDO = np.array([0.16, 0.15, 0.13])
_GRAY_SKY = np.array([0.97, 1.0, 1.04])


@dataclass(frozen=True, slots=True)
class SkyLight:
    """Light without shadows and lamps. Colours are linear RGB, (3,), in the unit of sky.yaml.

    Attributes:
        key_direction: (3,) unit vector towards the light that casts shadows: the sun, at night the moon.
        key: Its irradiance.
        sun_direction: (3,) unit vector towards the sun.
        zenith: Radiance overhead.
        horizon: Radiance at the horizon.
        glow: Radiance added around the sun.
        sky_ambient: Irradiance of the sky on level ground.
        ground_ambient: Irradiance from the ground below.
        exposure: Factor before tone mapping.
        lamps_lit: Whether street lamps and windows are lit.
    """

    key_direction: Float64Array
    key: Float64Array
    sun_direction: Float64Array
    zenith: Float64Array
    horizon: Float64Array
    glow: Float64Array
    sky_ambient: Float64Array
    ground_ambient: Float64Array
    exposure: float
    lamps_lit: bool

    @classmethod
    def of(cls, weather: Weather) -> "SkyLight":
        """The light of a weather. Clouds take the sun away and turn the sky grey."""
        key = _sky_at(weather.sun_altitude_deg)
        sun_direction = _direction(weather.sun_azimuth_deg, weather.sun_altitude_deg)
        moonlit = bool(key["moon"].any())
        moon_altitude_deg = max(-weather.sun_altitude_deg, _LOWEST_MOON_DEG)
        moon_direction = _direction(weather.sun_azimuth_deg + 180.0, moon_altitude_deg)
        overcast = float(np.clip((weather.cloudiness - 40.0) / 55.0, 0.0, 1.0)) ** 1.5
        gray = _GRAY_SKY * (key["zenith"].mean() * 0.75 + key["horizon"].mean() * 0.45 + key["sun"].mean() * 0.03)
        zenith, horizon = (
            color + (gray * level - color) * overcast for color, level in ((key["zenith"], 1.0), (key["horizon"], 0.9))
        )
        direct = (key["moon"] if moonlit else key["sun"]) * (1.0 - 0.97 * overcast)
        risen_sun = _direction(weather.sun_azimuth_deg, max(weather.sun_altitude_deg, _LOWEST_KEY_DEG))
        direction = moon_direction if moonlit else risen_sun
        sky_mean = 0.6 * zenith + 0.4 * horizon
        # Clouds and lit walls, which are no part of the clear sky's colour, fill shadows with whiter light.
        sky_ambient = _AMBIENT_GAIN * (sky_mean + _AMBIENT_WHITENING * (sky_mean.mean() - sky_mean))
        return cls(
            key_direction=direction,
            key=direct,
            sun_direction=sun_direction,
            zenith=zenith,
            horizon=horizon,
            glow=key["glow"] * (1.0 - overcast),
            sky_ambient=sky_ambient,
            ground_ambient=_GROUND_ALBEDO * (sky_ambient + direct * max(float(direction[2]), 0.0)),
            exposure=float(key["exposure"][0]) * (1.0 + 0.35 * overcast),
            lamps_lit=weather.sun_altitude_deg < LAMPS_ON_BELOW_DEG,
        )

    def block_head(
        self, weather: Weather, stamp_ns: int, origin_m: Float64Array, contact_half_m: float
    ) -> Float64Array:
        """(10, 4) the first vectors of the uniform block ``Light`` (shaders/include/light.glsl)."""
        # Wind that changes must not multiply with all the time since 0: a scene has an hour of its own.
        hour, within_ns = divmod(stamp_ns, _HOUR_NS)
        drift_per_s = _CLOUD_DRIFT_PER_S * (0.2 + weather.wind_intensity / 100.0)
        drift = (hour * _CLOUDS_APART + within_ns * 1e-9 * drift_per_s) % 1.0
        fog_per_m = (weather.fog_density / 100.0) ** 2 * 0.06
        rows: list[tuple[Float64Array, float]] = [
            (self.key_direction, self.exposure),
            (self.key, 0.0),
            (self.sun_direction, drift),
            (self.zenith, weather.cloudiness / 100.0),
            (self.horizon, weather.wetness / 100.0),
            (self.glow, weather.precipitation_deposits / 100.0),
            (self.sky_ambient, 0.0),
            (self.ground_ambient, 0.0),
            (np.array([fog_per_m, weather.fog_distance_m, weather.fog_falloff * 0.02]), 0.0),
            (origin_m % _NOISE_PERIOD_M, contact_half_m),
        ]
        return np.array([[*color, extra] for color, extra in rows])


def _direction(azimuth_deg: float, altitude_deg: float) -> Float64Array:
    """(3,) unit vector in the map frame; azimuth counter-clockwise from x."""
    azimuth, altitude = np.radians([azimuth_deg, altitude_deg])
    return np.array([np.cos(azimuth) * np.cos(altitude), np.sin(azimuth) * np.cos(altitude), np.sin(altitude)])


def _sky_at(altitude_deg: float) -> dict[str, Float64Array]:
    """Every column of sky.yaml at an altitude of the sun."""
    altitudes_deg, columns = _sky_table()
    return {
        name: np.array([np.interp(altitude_deg, altitudes_deg, channel) for channel in values.T])
        for name, values in columns.items()
    }


@lru_cache(maxsize=1)
def _sky_table() -> tuple[Float64Array, dict[str, Float64Array]]:
    """Altitudes (K,), and every other column (K, 1 or 3)."""
    keys = yaml.safe_load(files("simbev_ros.render").joinpath("sky.yaml").read_text(encoding="utf-8"))["keys"]
    columns = {
        name: np.array([key[name] for key in keys], np.float64).reshape(len(keys), -1)
        for name in keys[0]
        if name != "altitude_deg"
    }
    return np.array([key["altitude_deg"] for key in keys], np.float64), columns
