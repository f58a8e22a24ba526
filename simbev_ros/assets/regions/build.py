"""Builds the static world of one region: first the ground, then bridges, then everything that stands on them."""

import shapely

from simbev_ros.assets.land.furnish import furnish_region
from simbev_ros.assets.land.plazas import plazas_of
from simbev_ros.assets.placement.claims import Claims
from simbev_ros.assets.placement.region_ground import RegionGround
from simbev_ros.assets.placement.tiles import TileBuilder
from simbev_ros.assets.regions.region_scene import RegionScene
from simbev_ros.assets.roads.bridges import build_bridges
from simbev_ros.assets.roads.ground import lay_land, lay_streets, lay_water
from simbev_ros.assets.roads.guard_rails import put_guard_rails
from simbev_ros.assets.roads.markings import paint_markings
from simbev_ros.assets.roads.tunnels import build_tunnels
from simbev_ros.assets.street.obstacles import obstacles_on
from simbev_ros.assets.street.rest_spots import legroom
from simbev_ros.config.weather import Season
from simbev_ros.foundation.geometry import overlay
from simbev_ros.maps.land.terrain import Terrain
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.region import Region

_ROADSIDE_M = 1.9  # nearer to the road people walk around poles and trees


def build_region(network: RoadNetwork, region: Region, terrain: Terrain, season: Season = "summer") -> RegionScene:
    """Build one region; the result depends on the map, its seed, the season and the region alone.

    Args:
        network: Roads of the map.
        region: Region to build.
        terrain: Terrain of the map.
        season: Season of its plants and ground.
    """
    ground = RegionGround.from_network(network, region, terrain, season)
    tiles, claims = TileBuilder(), Claims()
    lay_streets(tiles, ground)
    paint_markings(tiles, ground)
    build_bridges(tiles, claims, ground)
    build_tunnels(tiles, claims, ground)
    put_guard_rails(tiles, claims, ground)
    streets, verges = ground.streets[0], network.verges
    if not verges.is_empty:
        claims.add(overlay.difference(ground.within(verges), shapely.buffer(streets.area, _ROADSIDE_M)))
    furnishing = furnish_region(tiles, claims, ground)
    lay_land(tiles, ground, furnishing.covers)
    lay_water(tiles, ground)
    walks = streets.sidewalk if verges.is_empty else overlay.union(streets.sidewalk, ground.within(verges))
    return RegionScene(
        tiles.finish(),
        furnishing.street_lights,
        obstacles_on(walks, streets.road, tiles.placed_objects),
        plazas_of(furnishing.pavements, ground, [*tiles.placed_objects, legroom(furnishing.rests)]),
        furnishing.parking_spots,
        furnishing.rests,
    )
