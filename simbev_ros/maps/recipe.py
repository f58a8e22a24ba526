"""Recipes of the towns that we build ourselves: read from towns/<name>.yaml. In: a name. Out: a validated model."""

from functools import lru_cache
from importlib.resources import files
from typing import Self

import yaml
from pydantic import Field, ValidationError, model_validator

from simbev_ros.config.base import Model
from simbev_ros.config.draw import Drawn
from simbev_ros.errors import InputError
from simbev_ros.geometry.geodesy import MapDatum
from simbev_ros.maps.surroundings import SurroundingsRecipe


class DatumRecipe(Model):
    """Where the map's origin, the town's centre, lies on Earth."""

    latitude_deg: float = Field(ge=-89, le=89)
    longitude_deg: float = Field(ge=-180, le=180)
    altitude_m: float = Field(ge=-500, le=9000)

    @property
    def datum(self) -> MapDatum:
        """The same as geometry uses it."""
        return MapDatum(self.latitude_deg, self.longitude_deg, self.altitude_m)


class StreetRecipe(Model):
    """A grid of streets, irregular as the seed says, inside a ring road without dead ends.

    Streets run along the grid's lines; line 0 and the last one are the ring road. Every street has sidewalks.
    """

    columns: int = Field(ge=2, le=20, description="blocks from west to east")
    rows: int = Field(ge=2, le=20, description="blocks from south to north")
    block_m: Drawn = Field(description="distance between neighbouring lines, one draw each")
    wide_north_south: tuple[int, ...] = Field((), description="inner lines with two lanes each way, 0 westmost")
    wide_east_west: tuple[int, ...] = Field((), description="inner lines with two lanes each way, 0 southmost")
    merged_blocks: int = Field(0, ge=0, description="how many narrow inner streets are left out at random")
    junction_shift_m: float = Field(0.0, ge=0, le=30, description="largest random shift of an inner junction")
    ring_corner_radius_m: float = Field(25.0, ge=12, le=60)
    lane_width_m: float = Field(3.5, ge=2.5, le=5)
    sidewalk_width_m: float = Field(2.5, ge=1, le=8)
    crossing_width_m: float = Field(3.5, ge=2, le=8)
    curb_radius_m: float = Field(6.0, ge=1, le=15, description="radius of junction corners")
    speed_limit_kmh: float = Field(50.0, gt=0, le=50, description="above 50 km/h SUMO puts no crossings")
    signals_from_lanes: int = Field(5, ge=1, description="a junction with so many incoming lanes has traffic lights")

    @model_validator(mode="after")
    def _wide_lines_are_inner(self) -> Self:
        for name, last in (("wide_north_south", self.columns), ("wide_east_west", self.rows)):
            wrong = [line for line in getattr(self, name) if not 0 < line < last]
            if wrong:
                raise ValueError(f"{name}: must lie between 1 and {last - 1}, not {wrong[0]}")
        return self


class TownRecipe(Model):
    """All of a town."""

    name: str
    datum: DatumRecipe
    streets: StreetRecipe
    surroundings: SurroundingsRecipe


def known_maps() -> tuple[str, ...]:
    """Names of all maps, sorted."""
    towns = files("simbev_ros.maps").joinpath("towns")
    return tuple(sorted(entry.name.removesuffix(".yaml") for entry in towns.iterdir() if entry.name.endswith(".yaml")))


@lru_cache(maxsize=16)
def recipe_of(name: str) -> TownRecipe:
    """The recipe of a map.

    Raises:
        InputError: No map has this name, or its recipe is wrong.
    """
    if name not in known_maps():
        raise InputError(f"map: no map is called {name!r}; known maps: {', '.join(known_maps())}")
    text = files("simbev_ros.maps").joinpath("towns", f"{name}.yaml").read_text(encoding="utf-8")
    try:
        return TownRecipe(name=name, **yaml.safe_load(text))
    except ValidationError as error:
        raise InputError(f"map {name}: {error}") from error
