"""Natural light of a frame: sun, moon, sky, clouds, fog and exposure, computed from the weather for the shaders.

A ``Weather`` enters ``SkyLight.from_weather``; ``SkyLight.block_head`` fills the uniform block ``Light``.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from simbev_ros.foundation.tables import load_table
from simbev_ros.foundation.types import Float64Array
from simbev_ros.foundation.units import NS_PER_S, S_PER_NS
from simbev_ros.scene.air import fog_falloff_per_m, fog_halvings_per_m, rain_halvings_per_m
from simbev_ros.schema.scene.weather import Weather
from simbev_ros.simulation.render.lighting.atmosphere import (
    MIE_EXTINCTION_PER_KM,
    RAYLEIGH_PER_KM,
    clear_sky,
    sun_transmittance,
)

LAMPS_ON_BELOW_DEG = 3.0
"""Street lamps and lit windows are on while the sun is below this altitude."""

SKY_SIZE_PX = 96
"""Width of the sky radiance table, a map of the hemisphere as defined by ``hemisphere_angles``."""

HORIZON_STRETCH = 0.5
"""Stretch toward the horizon: smaller values give the zenith less room in the map; see shaders/include/sky.glsl."""

_MIN_MOON_DEG = 35.0
_MIN_KEY_DEG = 1.0
_DIP_AT_CLOUDS_DEG = 1.6  # dip of the horizon at cloud height, where the sun sets later than on the ground
_MOONLIT_BELOW_DEG = (-5.0, -11.0)
_CLOUD_DRIFT_PER_S = 4e-4
_CLOUD_STEP_NS = 250_000_000  # clouds move so slowly that they need not be redrawn in every frame
_HOUR_NS = 3600 * NS_PER_S
_CLOUD_PHASE_PER_HOUR = 0.618  # phase of the clouds' period between consecutive scenes
_NOISE_PERIOD_M = 64.0
_GROUND_ALBEDO = np.array([0.16, 0.15, 0.13])
_OVERCAST_TINT = np.array([0.97, 1.0, 1.04])
_AMBIENT_WHITENING = 0.45
_UPRIGHT_SHARE = 0.3
_MAX_GLOW = 3.0
_FOGGY = 60.0  # density of fog that scatters all light many times
_MAX_SKY = 8.0  # maximum radiance around the sun relative to the mean, as no camera shows more
CLEAR_HAZE_PER_M = float(np.mean(RAYLEIGH_PER_KM + MIE_EXTINCTION_PER_KM)) / 1000.0 / np.log(2.0)


@dataclass(frozen=True, slots=True)
class SkyLight:
    """Natural light without shadows and lamps. Colors are linear RGB, (3,), irradiances over π, all in one unit.

    Attributes:
        key_direction: (3,) unit vector toward the light that casts shadows: the sun, at night the moon.
        key: Irradiance of that light.
        sun_direction: (3,) unit vector toward the sun.
        sky: (SKY_SIZE_PX, SKY_SIZE_PX, 3) radiance without the shapes of clouds, a map of the hemisphere.
        air: Radiance of haze and fog, away from the sun.
        air_glow: Radiance added to it toward the sun.
        cloud_light: Irradiance of the sun or moon on clouds, which lasts after it has set on the ground.
        sky_ambient: Irradiance of the sky on horizontal ground.
        ground_ambient: Irradiance from the ground below.
        exposure: Factor before tone mapping.
        lamps_lit: Whether street lamps and windows are lit.
    """

    key_direction: Float64Array
    key: Float64Array
    sun_direction: Float64Array
    sky: Float64Array
    air: Float64Array
    air_glow: Float64Array
    cloud_light: Float64Array
    sky_ambient: Float64Array
    ground_ambient: Float64Array
    exposure: float
    lamps_lit: bool

    @classmethod
    @lru_cache(maxsize=8)
    def from_weather(cls, weather: Weather) -> "SkyLight":
        """Compute the light of a weather. Clouds block the sun and turn the sky gray."""
        altitude_deg, azimuth_deg = weather.sun_altitude_deg, weather.sun_azimuth_deg
        clear, direct, at_clouds, direction = _natural_light(altitude_deg, azimuth_deg)
        overcast = float(np.clip((weather.cloudiness - 40.0) / 55.0, 0.0, 1.0)) ** 1.5
        total = _level_irradiance(clear) + direct * direction[2]
        # Share of the light that passes through clouds: Kasten and Czeplak 1980.
        through = 1.0 - 0.75 * overcast**1.5
        gray = _OVERCAST_TINT * total.mean() * through * _overcast_pattern()
        sky = clear + (gray - clear) * overcast
        direct = direct * (1.0 - 0.97 * overcast)
        ambient = _level_irradiance(sky)
        sky = sky / (1.0 + sky.mean(axis=2, keepdims=True) / (_MAX_SKY * ambient.mean()))
        # Half of the visible surfaces are vertical: a low sun lights them fully.
        light = float((ambient + direct * (_UPRIGHT_SHARE + (1.0 - _UPRIGHT_SHARE) * direction[2])).mean())
        white, exposure = _adaptation(light)
        gain = white / (exposure * light)
        # Clouds and lit walls, which are not part of the clear sky's color, fill shadows with whiter light.
        sky_ambient = ambient + _AMBIENT_WHITENING * (ambient.mean() - ambient)
        air, air_glow = _air(sky, azimuth_deg, weather.fog_density, 0.72 * ambient + 0.35 * direct * direction[2])
        return cls(
            key_direction=direction,
            key=direct * gain,
            sun_direction=_direction(azimuth_deg, altitude_deg),
            sky=sky * gain,
            air=air * gain,
            air_glow=air_glow * gain,
            cloud_light=at_clouds * (1.0 - overcast) * gain,
            sky_ambient=sky_ambient * gain,
            ground_ambient=_GROUND_ALBEDO * (sky_ambient + direct * direction[2]) * gain,
            exposure=exposure,
            lamps_lit=altitude_deg < LAMPS_ON_BELOW_DEG,
        )

    def block_head(
        self, weather: Weather, stamp_ns: int, origin_m: Float64Array, contact_half_m: float
    ) -> Float64Array:
        """(11, 4) the first vectors of the uniform block ``Light`` (shaders/include/light.glsl)."""
        # Changes of the wind must not be multiplied by the whole time since 0: the drift restarts with each scene's
        # hour.
        hour, time_in_hour_ns = divmod(stamp_ns, _HOUR_NS)
        drift_time_s = time_in_hour_ns // _CLOUD_STEP_NS * _CLOUD_STEP_NS * S_PER_NS
        drift_per_s = _CLOUD_DRIFT_PER_S * (0.2 + weather.wind_intensity / 100.0)
        drift = (hour * _CLOUD_PHASE_PER_HOUR + drift_time_s * drift_per_s) % 1.0
        rain = weather.precipitation / 100.0
        haze_per_m = CLEAR_HAZE_PER_M + rain_halvings_per_m(weather)
        fog = np.array([fog_halvings_per_m(weather), weather.fog_distance_m, fog_falloff_per_m(weather)])
        rows: list[tuple[Float64Array, float]] = [
            (self.key_direction, self.exposure),
            (self.key, weather.wind_intensity / 100.0),
            (self.sun_direction, drift),
            (self.air, weather.cloudiness / 100.0),
            (self.air_glow, weather.wetness / 100.0),
            (self.cloud_light, weather.precipitation_deposits / 100.0),
            (self.sky_ambient, time_in_hour_ns * S_PER_NS),
            (self.ground_ambient, rain),
            (fog, haze_per_m),
            (origin_m % _NOISE_PERIOD_M, contact_half_m),
            (
                np.array([weather.snow_cover, weather.leaf_litter, weather.flowers]) / 100.0,
                min(weather.fog_density / _FOGGY, 1.0),
            ),
        ]
        return np.array([[*color, extra] for color, extra in rows])


def hemisphere_angles() -> tuple[Float64Array, Float64Array]:
    """(SKY_SIZE_PX, SKY_SIZE_PX) elevation and azimuth in radians of the texels of a map of the sky.

    A direction is mapped to ``xy · s / (s + z)`` with s = ``HORIZON_STRETCH``: the horizon is the unit circle. Texels
    outside it repeat the horizon.
    """
    center = (np.arange(SKY_SIZE_PX) + 0.5) / SKY_SIZE_PX * 2.0 - 1.0
    x, y = np.meshgrid(center, center)
    stretch = HORIZON_STRETCH
    radius2 = np.minimum(x * x + y * y, 1.0)
    up = stretch * (np.sqrt(radius2 * (1.0 - stretch**2) + stretch**2) - radius2) / (radius2 + stretch**2)
    return np.arcsin(np.clip(up, 0.0, 1.0)), np.arctan2(y, x)


def _natural_light(
    altitude_deg: float, azimuth_deg: float
) -> tuple[Float64Array, Float64Array, Float64Array, Float64Array]:
    """Light without clouds: sky map, irradiance of sun or moon on the ground and at clouds, and direction toward it."""
    moonlit = float(np.interp(altitude_deg, _MOONLIT_BELOW_DEG[::-1], (1.0, 0.0)))
    moon = moonlit * np.array(_constants()["moon"])
    moon_altitude_deg = max(-altitude_deg, _MIN_MOON_DEG)
    sky = (
        _clear_sky_map(altitude_deg, azimuth_deg)
        + moon * _clear_sky_map(moon_altitude_deg, azimuth_deg + 180.0)
        + _night_sky()
    )
    if moonlit > 0.0:
        moonlight = moon * sun_transmittance(moon_altitude_deg)
        return sky, moonlight, moonlight, _direction(azimuth_deg + 180.0, moon_altitude_deg)
    at_clouds = sun_transmittance(altitude_deg + _DIP_AT_CLOUDS_DEG) * np.clip(altitude_deg + 2.0, 0.0, 1.0)
    return sky, sun_transmittance(altitude_deg), at_clouds, _direction(azimuth_deg, max(altitude_deg, _MIN_KEY_DEG))


def _clear_sky_map(altitude_deg: float, azimuth_deg: float) -> Float64Array:
    """Map of the clear sky lit by a sun (or moon) of irradiance / π 1 outside the atmosphere."""
    elevation, azimuth = np.degrees(hemisphere_angles())
    return np.pi * clear_sky(altitude_deg, elevation, azimuth - azimuth_deg)


@lru_cache(maxsize=1)
def _night_sky() -> Float64Array:
    """Map of the night sky's own light."""
    zenith, horizon = (np.array(_constants()[name]) for name in ("night_zenith", "night_horizon"))
    height = np.sin(hemisphere_angles()[0])[..., None]
    return zenith + (horizon - zenith) * np.exp(-6.0 * height)


@lru_cache(maxsize=1)
def _overcast_pattern() -> Float64Array:
    """Map of an overcast sky that gives level ground irradiance / π 1; its zenith is twice as bright as the horizon."""
    return (1.0 + np.sin(hemisphere_angles()[0])[..., None]) * 0.6


@lru_cache(maxsize=1)
def _level_weights() -> Float64Array:
    """(SKY_SIZE_PX, SKY_SIZE_PX) weights of texels by solid angle and cosine with the vertical; their sum is 1."""
    center = (np.arange(SKY_SIZE_PX) + 0.5) / SKY_SIZE_PX * 2.0 - 1.0
    radius = np.hypot(*np.meshgrid(center, center))
    up = np.sin(hemisphere_angles()[0])
    # Solid angle per area of the map: |d(up)| |d(azimuth)| over r dr d(azimuth).
    slope = np.gradient(up[SKY_SIZE_PX // 2, SKY_SIZE_PX // 2 :], center[SKY_SIZE_PX // 2 :])
    density = np.interp(radius, center[SKY_SIZE_PX // 2 :], -slope) / radius
    weights = np.where(radius <= 1.0, density * up, 0.0)
    return weights / weights.sum()


def _level_irradiance(sky: Float64Array) -> Float64Array:
    """(3,) irradiance / π of a map of the sky on level ground."""
    return np.einsum("yxc,yx->c", sky, _level_weights())


def _air(
    sky: Float64Array, azimuth_deg: float, fog_density: float, in_fog: Float64Array
) -> tuple[Float64Array, Float64Array]:
    """Two (3,) colors of the air near the horizon: ``away + glow · w^8``, where w is 1 toward the sun, 0 opposite.

    Fog scatters light so often that it takes the color of all light together, (3,) ``in_fog``.
    """
    angle_to_sun = np.linspace(0.0, np.pi, 17)
    weight = (0.5 + 0.5 * np.cos(angle_to_sun)) ** 8
    angle = angle_to_sun + np.radians(azimuth_deg)
    pixel = (np.stack([np.cos(angle), np.sin(angle)]) * 0.93 + 1.0) / 2.0 * SKY_SIZE_PX
    ring = sky[pixel[1].astype(int), pixel[0].astype(int)]
    away = ring[weight < 0.2].mean(axis=0)
    glow = np.einsum("kc,k->c", ring - away, weight) / (weight**2).sum()
    glow = np.clip(glow, 0.0, _MAX_GLOW * away.mean())
    foggy = min(fog_density / _FOGGY, 1.0)
    mixed = 0.75 * in_fog + 0.25 * in_fog.mean()
    return away + (mixed - away) * (0.7 * foggy), glow + (0.7 * glow.mean() - glow) * (0.5 * foggy)


def _adaptation(light: float) -> tuple[float, float]:
    """Brightness of white paper in the image for a mean irradiance, and the exposure of lamps."""
    keys = _constants()["adaptation"]
    lights = np.log([key["light"] for key in keys])
    white, exposure = (
        float(np.exp(np.interp(np.log(light), lights, np.log([key[name] for key in keys]))))
        for name in ("white", "exposure")
    )
    return white, exposure


def light_of_exposure(exposure: float) -> float:
    """Mean irradiance (outside the atmosphere: 1) for which automatic exposure has this factor."""
    keys = _constants()["adaptation"][::-1]
    exposures, lights = (np.log([key[name] for key in keys]) for name in ("exposure", "light"))
    return float(np.exp(np.interp(np.log(exposure), exposures, lights)))


def _direction(azimuth_deg: float, altitude_deg: float) -> Float64Array:
    """(3,) unit vector in the map frame; azimuth counter-clockwise from x."""
    azimuth, altitude = np.radians([azimuth_deg, altitude_deg])
    return np.array([np.cos(azimuth) * np.cos(altitude), np.sin(azimuth) * np.cos(altitude), np.sin(altitude)])


@lru_cache(maxsize=1)
def _constants() -> dict[str, Any]:
    return load_table("simbev_ros.simulation.render.lighting", "sky.yaml")
