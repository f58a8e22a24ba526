"""Furnishes a region: puts all objects into tiles, streets first, then buildings, gardens and plants."""

from collections.abc import Callable, Mapping
from typing import NamedTuple

from simbev_ros.assets.land.blocks import Block, blocks_of, fast_roads, zones_of
from simbev_ros.assets.land.boundaries import put_boundaries, put_guards, put_median_railings
from simbev_ros.assets.land.campus import lay_out_campus
from simbev_ros.assets.land.covers import Cover
from simbev_ros.assets.land.farmland import lay_out_farmland
from simbev_ros.assets.land.industry import lay_out_industry
from simbev_ros.assets.land.parks import lay_out_island, lay_out_park
from simbev_ros.assets.land.plazas import Pavement
from simbev_ros.assets.land.prescribed import build_prescribed
from simbev_ros.assets.land.suburb import lay_out_suburb
from simbev_ros.assets.land.town import lay_out_town
from simbev_ros.assets.land.woods import lay_out_woods
from simbev_ros.assets.land.yard import Yard
from simbev_ros.assets.placement.claims import Claims
from simbev_ros.assets.placement.region_ground import RegionGround
from simbev_ros.assets.placement.static_scene import StreetLight
from simbev_ros.assets.placement.tiles import TileBuilder
from simbev_ros.assets.street.curbs import curb_lines
from simbev_ros.assets.street.light_places import Lanes
from simbev_ros.assets.street.lights import put_lights
from simbev_ros.assets.street.map_objects import put_map_objects
from simbev_ros.assets.street.parking_spots import parking_spots
from simbev_ros.assets.street.rest_spots import rest_spots
from simbev_ros.assets.street.signage import put_boards, put_islands, put_lamp_plates, put_sign_posts
from simbev_ros.assets.street.small_things import put_along_curbs, put_behind_walks
from simbev_ros.assets.street.streetscape import (
    put_bus_shelters,
    put_cables,
    put_median_trees,
    put_name_signs,
    put_signals,
    put_signs,
    put_small_things,
    put_street_trees,
)
from simbev_ros.foundation.types import Table

_LAYOUTS: Mapping[str, Callable[[Yard, Block], None]] = {
    "downtown": lay_out_town,
    "residential": lay_out_town,
    "suburb": lay_out_suburb,
    "industrial": lay_out_industry,
    "campus": lay_out_campus,
    "farmland": lay_out_farmland,
    "woods": lay_out_woods,
    "park": lay_out_park,
}


_OPEN_USES = ("farmland", "woods", "park")


class Furnishing(NamedTuple):
    """Results of ``furnish_region`` for later stages: covers, street lights, plazas, spots for vehicles and people."""

    covers: tuple[Cover, ...]
    street_lights: tuple[StreetLight, ...]
    pavements: tuple[Pavement, ...]
    parking_spots: Table
    rests: Table


def furnish_region(tiles: TileBuilder, claims: Claims, ground: RegionGround) -> Furnishing:
    """Put all objects of a region into the tiles.

    Args:
        tiles: Receives the meshes.
        claims: Footprints that are already occupied, such as those of guard rails.
        ground: Ground of the region.
    """
    zones, fast = zones_of(ground), fast_roads(ground)
    yard = Yard(ground, tiles, claims, fast)
    claims.add(*(deck for deck in ground.decks if not deck.is_empty))
    blocks, curbs = blocks_of(ground, zones, fast), curb_lines(yard, zones)
    put_signals(yard)
    put_signs(yard)
    lamps = tuple(put_map_objects(yard))
    lights = (*lamps, *put_lights(yard, curbs, fast, len(lamps)))
    put_bus_shelters(yard, blocks)
    prescribed = ground.network.features.buildings
    if prescribed is not None:
        build_prescribed(yard, prescribed, zones)
    for block in blocks:
        built_on = block.recipe.use not in _OPEN_USES
        lay_out = lay_out_island if built_on and block.is_island else _LAYOUTS[block.recipe.use]
        lay_out(yard, block)
    put_name_signs(yard, curbs)
    put_street_trees(yard, curbs)
    put_median_trees(yard, zones)
    put_small_things(yard, curbs)
    put_cables(yard, curbs)
    lanes = Lanes.of_level(ground, 0)
    put_sign_posts(yard, curbs, lanes)
    put_guards(yard, curbs)
    put_boundaries(yard, blocks)
    put_boards(yard, blocks, lanes)
    put_lamp_plates(yard, lanes)
    put_islands(yard)
    put_median_railings(yard)
    put_along_curbs(yard, curbs)
    put_behind_walks(yard, blocks)
    yard.ensemble.place_all(tiles, ground)
    return Furnishing(tuple(yard.covers), lights, tuple(yard.pavements), parking_spots(yard, zones), rest_spots(yard))
