"""The clear sky and the sun against measured values of the real ones."""

import numpy as np
import pytest
from render_scene import NOON

from simbev_ros.foundation.types import Float64Array
from simbev_ros.simulation.render.lighting.atmosphere import (
    MIE_EXTINCTION_PER_KM,
    MIE_SCALE_KM,
    OZONE_PER_KM,
    RAYLEIGH_PER_KM,
    RAYLEIGH_SCALE_KM,
    clear_sky,
    sun_transmittance,
)
from simbev_ros.simulation.render.lighting.light import SkyLight


def air_mass(altitude_deg: float) -> float:
    """Air mass relative to the zenith: Kasten and Young 1989."""
    return float(1.0 / (np.sin(np.radians(altitude_deg)) + 0.50572 * (altitude_deg + 6.07995) ** -1.6364))


@pytest.mark.parametrize("altitude_deg", [90.0, 60.0, 30.0, 10.0])
def test_the_sun_dims_and_reddens_with_air_mass(altitude_deg: float) -> None:
    overhead = RAYLEIGH_PER_KM * RAYLEIGH_SCALE_KM + MIE_EXTINCTION_PER_KM * MIE_SCALE_KM + OZONE_PER_KM * 15.0
    expected = np.exp(-overhead * air_mass(altitude_deg))
    np.testing.assert_allclose(sun_transmittance(altitude_deg), expected, rtol=0.04)


def irradiance(altitude_deg: float) -> Float64Array:
    """(3,) irradiance of the sky on level ground, summed over a fine grid of directions."""
    elevation, azimuth = np.meshgrid((np.arange(90) + 0.5), (np.arange(180) + 0.5) * 2.0, indexing="ij")
    weight = np.sin(np.radians(elevation)) * np.cos(np.radians(elevation)) * np.radians(1.0) * np.radians(2.0)
    return np.einsum("eac,ea->c", clear_sky(altitude_deg, elevation, azimuth), weight)


def test_the_skys_share_of_the_light_matches_a_clear_day() -> None:
    sky, sun = irradiance(45.0), sun_transmittance(45.0) * np.sin(np.radians(45.0))
    shares = sky / (sky + sun)
    assert 0.08 < shares.mean() < 0.25, "10 to 20 % of light is diffuse on clear days"
    assert shares[0] < shares[1] < shares[2]


def test_the_sky_table_agrees_with_the_summed_irradiance() -> None:
    sky = SkyLight.from_weather(NOON.model_copy(update={"cloudiness": 0.0, "sun_altitude_deg": 45.0}))
    ratio = sky.sky_ambient.mean() / sky.key.mean()
    assert ratio == pytest.approx(irradiance(45.0).mean() / sun_transmittance(45.0).mean(), rel=0.05)


def test_the_zenith_is_blue_the_horizon_pale_and_dusk_glows_on_the_suns_side() -> None:
    zenith, horizon = clear_sky(50.0, np.array([90.0, 4.0]), np.array([120.0, 120.0]))
    assert zenith[2] > 2.0 * zenith[0]
    assert horizon[2] / horizon[0] < zenith[2] / zenith[0]
    assert horizon.mean() > zenith.mean()
    arch, against = clear_sky(-5.0, np.array([6.0, 6.0]), np.array([0.0, 180.0]))
    assert arch.mean() > 4.0 * against.mean()
    assert arch[0] / arch[2] > against[0] / against[2]


@pytest.mark.parametrize(
    "cloudiness", [0.0, pytest.param(60.0, marks=pytest.mark.slow), pytest.param(100.0, marks=pytest.mark.slow)]
)
def test_the_image_changes_smoothly_with_the_suns_altitude(cloudiness: float) -> None:
    shown = []
    for altitude_deg in np.arange(-90.0, 90.1, 0.5):
        sky = SkyLight.from_weather(
            NOON.model_copy(update={"sun_altitude_deg": altitude_deg, "cloudiness": cloudiness})
        )
        level = sky.sky_ambient + sky.key * sky.key_direction[2]
        assert np.isfinite(sky.sky).all() and sky.sky.min() >= 0.0
        shown.append(np.log(sky.exposure * level.mean()))
    assert np.abs(np.diff(shown)).max() < 0.12
    assert shown[-1] - min(shown) > np.log(8.0)
