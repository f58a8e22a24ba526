"""Data of one built region: its complete static scene, and the roadside subset that the simulation needs."""

from dataclasses import dataclass
from typing import NamedTuple

from simbev_ros.assets.land.plazas import Plaza
from simbev_ros.assets.placement.static_scene import StreetLight, Tile
from simbev_ros.foundation.types import Float64Array, Table


@dataclass(frozen=True, slots=True)
class RegionScene:
    """Static scene of one region; lamp indices in ``uv`` count the region's own street lights.

    Attributes:
        tiles: Meshes by tile.
        street_lights: Street lights of the region.
        obstacles: (K,) ``street.obstacles.OBSTACLE_DTYPE`` obstacles that pedestrians on sidewalks walk around.
        plazas: Plazas that pedestrians visit.
        parking_spots: (K,) ``street.parking_spots.SPOT_DTYPE`` spots for parked vehicles.
        rests: (K,) ``street.rest_kinds.REST_DTYPE`` spots for people who sit or stand for long.
    """

    tiles: tuple[Tile, ...]
    street_lights: tuple[StreetLight, ...]
    obstacles: Table
    plazas: tuple[Plaza, ...]
    parking_spots: Table
    rests: Table


class Streetside(NamedTuple):
    """Roadside data of the static world that the simulation needs, without meshes.

    Attributes:
        light_m: (L, 3) positions of the street lights, map frame, in their order.
        obstacles: (K,) ``street.obstacles.OBSTACLE_DTYPE`` obstacles that pedestrians on sidewalks walk around.
        plazas: Plazas that pedestrians visit.
        parking_spots: (K,) ``street.parking_spots.SPOT_DTYPE`` spots for parked vehicles.
        rests: (K,) ``street.rest_kinds.REST_DTYPE`` spots for people who sit or stand for long.
    """

    light_m: Float64Array
    obstacles: Table
    plazas: tuple[Plaza, ...]
    parking_spots: Table
    rests: Table
