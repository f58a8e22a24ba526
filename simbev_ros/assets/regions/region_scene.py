"""What is built and stored of one region, and what of it those need who do not look at it."""

from dataclasses import dataclass
from typing import NamedTuple

from simbev_ros.assets.land.plazas import Plaza
from simbev_ros.assets.placement.static_scene import StreetLight, Tile
from simbev_ros.types import Float64Array, Table


@dataclass(frozen=True, slots=True)
class RegionScene:
    """A region's part of it; the lamps' indices, in ``uv``, count the region's own street lights.

    Attributes:
        tiles: The meshes.
        street_lights: Lamps.
        obstacles: (K,) ``street.obstacles.OBSTACLE_DTYPE``; what people on sidewalks walk around.
        plazas: Those that people visit.
    """

    tiles: tuple[Tile, ...]
    street_lights: tuple[StreetLight, ...]
    obstacles: Table
    plazas: tuple[Plaza, ...]


class Streetside(NamedTuple):
    """What the simulation needs to know of the immobile world.

    Attributes:
        light_m: (L, 3) places of the street lights, in their order.
        obstacles: (K,) ``street.obstacles.OBSTACLE_DTYPE``; what people on sidewalks walk around.
        plazas: Those that people visit.
    """

    light_m: Float64Array
    obstacles: Table
    plazas: tuple[Plaza, ...]
