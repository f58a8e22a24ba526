"""Lights of the night: street lights and lit windows."""

from typing import Annotated

from pydantic import Field

from simbev_ros.config.base import Model
from simbev_ros.config.draw import Distribution, Drawn, PaperOrDrawn, within

MOST_COLORS = 8
"""Of the lit windows of a scene."""


class StreetLights(Model):
    """Street lights; like lit windows they shine while it is dark."""

    enabled: bool = Field(True, description="false: all are switched off")
    base_lm: Annotated[Drawn, within(0, 1_000_000)] = Field(18_000.0, description="luminous flux, for each scene")
    change_lm: Annotated[PaperOrDrawn, within(-1_000_000, 1_000_000)] = Field(
        "paper", description="added to it, for each lamp; paper: uniform in -m to m, where m is the scene's mean"
    )
    minimum_lm: float = Field(10_000.0, ge=0, le=1_000_000, description="no lamp that works has less")
    failure_probability: float = Field(0.1, ge=0, le=1, description="that a lamp is broken")


class BuildingLights(Model):
    """Lit windows, shop windows and signs."""

    enabled: bool = Field(True, description="false: all are switched off")
    share_lit: Annotated[Drawn, within(0, 1)] = Field(
        Distribution(uniform=(0.15, 0.45)), description="of the windows of rooms; of shop windows more are lit"
    )
    color_temperature_k: Annotated[Drawn, within(1_700, 20_000)] = Field(
        Distribution(uniform=(2_300, 4_500)), description="of each of the scene's eight colours"
    )
    colored_probability: float = Field(0.15, ge=0, le=1, description="that such a colour has a random hue instead")
    colors: tuple[Annotated[int, Field(ge=0, le=0xFFFFFF)], ...] = Field(
        (), max_length=MOST_COLORS, description="0xRRGGBB, sRGB, instead of random colours"
    )


class Lights(Model):
    """Lights that are part of the map."""

    street: StreetLights = StreetLights()
    buildings: BuildingLights = BuildingLights()
