"""Configuration models of a town recipe for the land beside the streets: buildings, plants, furniture, hills."""

from typing import Literal

from pydantic import Field

from simbev_ros.config.base import Model
from simbev_ros.config.draw import Drawn


class SurroundingsRecipe(Model):
    """Buildings, plants and street furniture of an area; used when the static scene is built."""

    use: Literal["downtown", "residential", "suburb", "industrial", "campus", "farmland", "woods", "park"]
    building_style: Literal["mixed", "brick", "plaster", "glass", "timber", "concrete", "metal"] = "mixed"
    building_density: float = Field(0.8, ge=0, le=1, description="fraction of building plots that are built on")
    building_setback_m: Drawn = Field(2.0, description="from the sidewalk's outer edge to the facade")
    building_height_m: Drawn = Field(8.0)
    plants: Literal["temperate", "conifer", "mediterranean", "dry"] = "temperate"
    plant_density: float = Field(0.5, ge=0, le=1, description="density of gardens, parks and woods; 0 none, 1 lush")
    tree_spacing_m: float = Field(12.0, ge=0, description="along sidewalks; 0: no street trees")
    street_light_spacing_m: float = Field(30.0, ge=0, description="along streets; 0: none")
    furniture_density: float = Field(0.5, ge=0, le=1, description="benches, bins, shelters, hydrants, parked objects")
    fence_density: float = Field(0.5, ge=0, le=1, description="fraction of plots with walls, fences or hedges")


class ReliefRecipe(Model):
    """Smooth random hills, drawn from the map's seed."""

    amplitude_m: float = Field(
        0.0, ge=0, le=200, description="approximate maximum height above, and depth below, the mean"
    )
    wavelength_m: float = Field(600.0, ge=100, le=20_000, description="approximate distance from hill to hill")
