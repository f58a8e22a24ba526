"""The rule table land_rules.yaml: interprets land use, water and building tags of OpenStreetMap."""

from collections.abc import Mapping
from functools import lru_cache

from pydantic import Field

from simbev_ros.config.base import Model
from simbev_ros.foundation.tables import load_table
from simbev_ros.maps.surroundings import SurroundingsRecipe


class WaterRule(Model):
    """Defaults for a kind of water."""

    width_m: float = Field(0.0, ge=0, description="default width of lines")
    depth_m: float = Field(gt=0, description="depth of the surface below the land")


class BuildingRule(Model):
    """Defaults for a kind of building."""

    use: str
    height_m: float = Field(gt=0, description="default if no tag gives one")


class HomesRule(Model):
    """Density from which land without a mapped use is residential: of buildings, or of streets."""

    building_share: float = Field(gt=0, description="of the land that buildings cover")
    streets_km_per_km2: float = Field(gt=0)
    surroundings: SurroundingsRecipe


class CenterRule(Model):
    """Density from which land without a mapped use is the center of a town."""

    floor_area_ratio: float = Field(gt=0, description="area of all storeys over area of the land")
    surroundings: SurroundingsRecipe


class LandRules(Model):
    """The content of land_rules.yaml, which documents each entry."""

    zones: Mapping[str, SurroundingsRecipe]
    outside: SurroundingsRecipe
    built_up_radius_m: float = Field(gt=0, description="half side of the square that densities are measured in")
    homes: HomesRule
    center: CenterRule
    urban_roads: tuple[str, ...]
    anywhere: SurroundingsRecipe
    water: Mapping[str, WaterRule]
    storey_m: float
    buildings: Mapping[str, BuildingRule]
    left_out: tuple[str, ...]
    wall_materials: Mapping[str, str]
    roof_materials: Mapping[str, int]


@lru_cache(maxsize=1)
def land_rules() -> LandRules:
    """Load the rule table."""
    return LandRules.model_validate(load_table("simbev_ros.maps.osm", "land_rules.yaml"))
