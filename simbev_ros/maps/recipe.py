"""Recipes of the built-in towns: takes a town's name and returns a validated model of towns/<name>.yaml."""

from functools import lru_cache
from typing import Any

from pydantic import Field, ValidationError, model_validator

from simbev_ros.config.base import Model
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.geometry.geodesy import MapDatum
from simbev_ros.foundation.tables import load_table
from simbev_ros.maps.plan.land import WaterRecipe, ZoneRecipe
from simbev_ros.maps.plan.patterns.pattern import Pattern
from simbev_ros.maps.source import known_maps
from simbev_ros.maps.surroundings import ReliefRecipe, SurroundingsRecipe


class DatumRecipe(Model):
    """Position on Earth of the map's origin, the center of the town."""

    latitude_deg: float = Field(ge=-89, le=89)
    longitude_deg: float = Field(ge=-180, le=180)
    altitude_m: float = Field(ge=-500, le=9000)

    @property
    def datum(self) -> MapDatum:
        """The same values as a ``MapDatum``."""
        return MapDatum(self.latitude_deg, self.longitude_deg, self.altitude_m)


class TownRecipe(Model):
    """Recipe of a whole town. A zone's surroundings list only the values that differ from the town's."""

    name: str
    datum: DatumRecipe
    relief: ReliefRecipe = ReliefRecipe()
    patterns: tuple[Pattern, ...] = Field(min_length=1, description="roads, drawn in this order")
    water: tuple[WaterRecipe, ...] = ()
    surroundings: SurroundingsRecipe
    zones: tuple[ZoneRecipe, ...] = Field((), description="where they overlap, the last one takes precedence")
    crossing_width_m: float = Field(3.5, ge=2, le=8)
    signals_from_lanes: int = Field(
        5, ge=1, description="junctions with at least this number of incoming lanes have traffic lights"
    )

    @model_validator(mode="before")
    @classmethod
    def _zones_inherit(cls, data: Any) -> Any:
        if not isinstance(data, dict) or not isinstance(data.get("surroundings"), dict):
            return data
        zones = [
            {**zone, "surroundings": {**data["surroundings"], **zone["surroundings"]}}
            if isinstance(zone, dict) and isinstance(zone.get("surroundings"), dict)
            else zone
            for zone in data.get("zones", ())
        ]
        return {**data, "zones": zones}


@lru_cache(maxsize=16)
def recipe_of(name: str) -> TownRecipe:
    """The validated recipe of a built-in map.

    Raises:
        InputError: No map has this name, or its recipe is invalid.
    """
    if name not in known_maps():
        raise InputError(f"map: no map is called {name!r}; known maps: {', '.join(known_maps())}")
    try:
        return TownRecipe(name=name, **load_table("simbev_ros.maps", f"towns/{name}.yaml"))
    except ValidationError as error:
        raise InputError(f"map {name}: {error}") from error
