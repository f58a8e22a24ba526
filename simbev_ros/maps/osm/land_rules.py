"""The table of what land use, water and building tags mean."""

from collections.abc import Mapping
from functools import lru_cache
from importlib.resources import files

import yaml
from pydantic import Field

from simbev_ros.config.base import Model
from simbev_ros.maps.surroundings import SurroundingsRecipe


class WaterRule(Model):
    """A kind of water."""

    width_m: float = Field(0.0, ge=0, description="of lines that name none")
    depth_m: float = Field(gt=0, description="of the surface below the land")


class BuildingRule(Model):
    """A kind of building."""

    use: str
    height_m: float = Field(gt=0, description="where no tag says so")


class LandRules(Model):
    """All of it; see the file."""

    zones: Mapping[str, SurroundingsRecipe]
    outside: SurroundingsRecipe
    anywhere: SurroundingsRecipe
    water: Mapping[str, WaterRule]
    storey_m: float
    buildings: Mapping[str, BuildingRule]
    left_out: tuple[str, ...]


@lru_cache(maxsize=1)
def land_rules() -> LandRules:
    """The table."""
    text = files("simbev_ros.maps.osm").joinpath("land_rules.yaml").read_text(encoding="utf-8")
    return LandRules.model_validate(yaml.safe_load(text))
