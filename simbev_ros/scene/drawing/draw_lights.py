"""Draw the parameters of a scene's lights and colors from the configuration and the scene's seed."""

import colorsys
from collections.abc import Iterator

import numpy as np

from simbev_ros.config.appearance import Appearance
from simbev_ros.config.draw import sample
from simbev_ros.config.lights import MAX_COLORS, BuildingLights, Lights, StreetLights
from simbev_ros.foundation.random import stream
from simbev_ros.foundation.types import Float64Array
from simbev_ros.schema.scene.appearance import AppearanceSpec
from simbev_ros.schema.scene.lights import BuildingLightSpec, LightSpec, StreetLightSpec

_NIGHT_WHITE_K = 3_600.0  # color temperature that cameras balance to white at night
_SATURATION = (0.2, 0.6)
_SRGB_FROM_XYZ = np.array([[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]])


def draw_lights(config: Lights, seed: int) -> LightSpec:
    """Draw the lights of the scene with this seed."""
    return LightSpec(
        seed=seed, street=_draw_street(config.street, seed), buildings=_draw_buildings(config.buildings, seed)
    )


def draw_appearance(config: Appearance, seed: int) -> AppearanceSpec:
    """Draw how the surfaces of the scene with this seed look."""
    return AppearanceSpec(seed=seed, randomize=sample(config.randomize, stream(seed, "appearance.randomize")))


def _draw_street(config: StreetLights, seed: int) -> StreetLightSpec:
    """Draw the street lights; by the paper, all lamps of a scene have the same flux, so that some nights are dark."""
    base_lm = sample(config.base_lm, stream(seed, "lights.street.base"))
    change_lm = config.change_lm
    if change_lm == "paper":
        change_lm = float(stream(seed, "lights.street.change").uniform(-base_lm, base_lm))
    return StreetLightSpec(
        enabled=config.enabled,
        base_lm=base_lm,
        change_lm=change_lm,
        minimum_lm=config.minimum_lm,
        failure_probability=config.failure_probability,
    )


def _draw_buildings(config: BuildingLights, seed: int) -> BuildingLightSpec:
    share_lit = sample(config.share_lit, stream(seed, "lights.buildings.share"))
    return BuildingLightSpec(
        enabled=config.enabled, share_lit=share_lit, colors=config.colors or tuple(_random_colors(config, seed))
    )


def _random_colors(config: BuildingLights, seed: int) -> Iterator[int]:
    for index in range(MAX_COLORS):
        rng = stream(seed, f"lights.buildings.color.{index}")
        if rng.random() < config.colored_probability:
            srgb = np.array(colorsys.hsv_to_rgb(rng.random(), rng.uniform(*_SATURATION), 1.0))
        else:
            srgb = white_balanced_srgb(sample(config.color_temperature_k, rng))
        red, green, blue = np.rint(srgb * 255.0).astype(int).tolist()
        yield red << 16 | green << 8 | blue


def white_balanced_srgb(temperature_k: float) -> Float64Array:
    """(3,) sRGB color, 0..1 at full brightness, of a black body seen by a camera balanced for night."""
    linear = np.clip(_black_body(temperature_k) / _black_body(_NIGHT_WHITE_K), 0.0, None)
    linear /= linear.max()
    return np.where(linear < 0.0031308, linear * 12.92, 1.055 * linear ** (1.0 / 2.4) - 0.055)


def _black_body(temperature_k: float) -> Float64Array:
    """(3,) linear sRGB of a black body (Krystek 1985) at luminance 1."""
    t = temperature_k
    u = (0.860117757 + 1.54118254e-4 * t + 1.28641212e-7 * t**2) / (1.0 + 8.42420235e-4 * t + 7.08145163e-7 * t**2)
    v = (0.317398726 + 4.22806245e-5 * t + 4.20481691e-8 * t**2) / (1.0 - 2.89741816e-5 * t + 1.61456053e-7 * t**2)
    x, y = np.array([3.0 * u, 2.0 * v]) / (2.0 * u - 8.0 * v + 4.0)
    return np.maximum(_SRGB_FROM_XYZ @ [x / y, 1.0, (1.0 - x - y) / y], 1e-3)
