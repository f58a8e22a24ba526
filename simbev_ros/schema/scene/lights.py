"""Street lights and lit windows of a scene. The state of a lamp depends only on the scene and the lamp's position."""

import numpy as np
from pydantic import Field

from simbev_ros.config.base import Model
from simbev_ros.config.draw import Drawn, sample
from simbev_ros.config.lights import MAX_COLORS
from simbev_ros.foundation.random import stream
from simbev_ros.foundation.types import Float64Array, Table

DEFAULT_FLUX_LM = 18_000.0
"""Luminous flux of an ordinary street light."""

STREET_LIGHT_DTYPE = np.dtype(
    [
        ("x", "<f8"),  # m, map frame: position of the light source
        ("y", "<f8"),
        ("z", "<f8"),
        ("intensity_lm", "<f4"),  # luminous flux when lit
        ("id", "<u4"),  # equals its row + 1
        ("on", "u1"),  # 1: lit when it is dark
        ("failed", "u1"),  # 1: broken
    ],
)
"""One row per street light. Field names and order are those of /world/lights."""


class StreetLightSpec(Model):
    """Parameters of a scene's street lights."""

    enabled: bool = True
    base_lm: float = Field(DEFAULT_FLUX_LM, ge=0)
    change_lm: Drawn = Field(0.0, description="deviation from the base, drawn for each lamp")
    minimum_lm: float = Field(0.0, ge=0)
    failure_probability: float = Field(0.0, ge=0, le=1)


class BuildingLightSpec(Model):
    """Parameters of a scene's lit windows; a window's position decides whether it is lit and in which of the colors."""

    enabled: bool = True
    share_lit: float = Field(0.3, ge=0, le=1, description="fraction of the room windows")
    colors: tuple[int, ...] = Field(
        (0xFFD59C, 0xFFDFB2, 0xFFEBD0, 0xF9EFDA), min_length=1, max_length=MAX_COLORS, description="0xRRGGBB, sRGB"
    )


class LightSpec(Model):
    """Parameters of the lights that belong to the map; the default draws nothing, so that all lamps are alike."""

    seed: int = Field(0, ge=0)
    street: StreetLightSpec = StreetLightSpec()
    buildings: BuildingLightSpec = BuildingLightSpec()


def street_lights(lights: LightSpec, positions_m: Float64Array) -> Table:
    """Compute (N,) ``STREET_LIGHT_DTYPE``, the state of a scene's lamps in the dark, at (N, 3) map positions."""
    table = np.zeros(len(positions_m), STREET_LIGHT_DTYPE)
    table["x"], table["y"], table["z"] = np.reshape(positions_m, (-1, 3)).T
    table["id"] = np.arange(1, len(table) + 1)
    for row, position_mm in zip(table, np.rint(np.asarray(positions_m) * 1e3).astype(int).tolist(), strict=True):
        row["intensity_lm"], row["failed"] = _draw_lamp(lights, position_mm)
    table["on"] = lights.street.enabled & (table["failed"] == 0)
    return table


def _draw_lamp(lights: LightSpec, position_mm: list[int]) -> tuple[float, bool]:
    """Luminous flux of the lamp at this position, and whether it is broken."""
    street = lights.street
    rng = stream(lights.seed, f"street_lights.{position_mm}")
    failed = bool(rng.random() < street.failure_probability)
    return max(street.minimum_lm, street.base_lm + sample(street.change_lm, rng)), failed
