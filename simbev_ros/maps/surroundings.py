"""Models of what a town recipe says about the land beside the streets."""

from typing import Literal

from pydantic import Field

from simbev_ros.config.base import Model
from simbev_ros.config.draw import Drawn


class SurroundingsRecipe(Model):
    """What stands on a piece of land; read by the static scene."""

    use: Literal["downtown", "residential", "suburb", "industrial", "campus", "farmland", "woods", "park"]
    building_style: Literal["mixed", "brick", "plaster", "glass", "timber", "concrete", "metal"] = "mixed"
    building_density: float = Field(0.8, ge=0, le=1, description="share of building plots that are built on")
    building_setback_m: Drawn = Field(2.0, description="from the sidewalk's outer edge to the facade")
    building_height_m: Drawn = Field(8.0)
    plants: Literal["temperate", "conifer", "mediterranean", "dry"] = "temperate"
    plant_density: float = Field(0.5, ge=0, le=1, description="of gardens, parks and woods; 0 none, 1 lush")
    tree_spacing_m: float = Field(12.0, ge=0, description="along sidewalks; 0: no street trees")
    street_light_spacing_m: float = Field(30.0, ge=0, description="along streets; 0: none")
    furniture_density: float = Field(0.5, ge=0, le=1, description="benches, bins, shelters, hydrants, parked things")
    fence_density: float = Field(0.5, ge=0, le=1, description="share of plots with walls, fences or hedges")


class ReliefRecipe(Model):
    """Hills: smooth, random, from the map's seed."""

    amplitude_m: float = Field(0.0, ge=0, le=200, description="highest above and lowest below the mean, about")
    wavelength_m: float = Field(600.0, ge=100, le=20_000, description="from hill to hill, about")
