"""Section ``lights``: street lights and lit windows at night."""

from typing import Annotated

from pydantic import Field

from simbev_ros.config.base import Model
from simbev_ros.config.draw import Distribution, Drawn, PaperOrDrawn, within

MAX_COLORS = 8
"""Maximum number of colors of a scene's lit windows."""


class StreetLights(Model):
    """Street lights, which are on while it is dark."""

    enabled: bool = Field(True, description="whether street lights can be on at all")
    base_lm: Annotated[Drawn, within(0, 1_000_000)] = Field(
        18_000.0, description="luminous flux of a scene's lamps before it is changed"
    )
    change_lm: Annotated[PaperOrDrawn, within(-1_000_000, 1_000_000)] = Field(
        "paper",
        description="deviation from base_lm, drawn for each lamp; paper: one for all lamps of a scene, uniform in -m "
        "to m, where m is the scene's base_lm",
    )
    minimum_lm: float = Field(10_000.0, ge=0, le=1_000_000, description="minimum luminous flux of a working lamp")
    failure_probability: float = Field(0.1, ge=0, le=1, description="probability that a lamp is broken")


class BuildingLights(Model):
    """Lit windows, shop windows and signs."""

    enabled: bool = Field(True, description="whether windows and signs can be lit at all")
    share_lit: Annotated[Drawn, within(0, 1)] = Field(
        Distribution(uniform=(0.15, 0.45)),
        description="share of room windows that are lit; shop windows are lit more often",
    )
    color_temperature_k: Annotated[Drawn, within(1_700, 20_000)] = Field(
        Distribution(uniform=(2_300, 4_500)), description="color temperature of each of the scene's eight colors"
    )
    colored_probability: float = Field(
        0.15, ge=0, le=1, description="probability that a color has a random hue instead"
    )
    colors: tuple[Annotated[int, Field(ge=0, le=0xFFFFFF)], ...] = Field(
        (), max_length=MAX_COLORS, description="colors as 0xRRGGBB, sRGB, instead of random ones"
    )


class Lights(Model):
    """Lights that are part of the map."""

    street: StreetLights = StreetLights()
    buildings: BuildingLights = BuildingLights()
