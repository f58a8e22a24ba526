"""Builds the static scene of a map: streets first, then what stands along them, buildings, gardens, plants."""

import shapely

from simbev_ros.assets.bridges import build_bridges
from simbev_ros.assets.building_sites import choose_sites, erect
from simbev_ros.assets.claims import Claims
from simbev_ros.assets.gardens import lay_out_front_gardens
from simbev_ros.assets.ground import LAWN, lay_ground, lay_land, lay_streets, lay_water, pave
from simbev_ros.assets.guard_rails import put_guard_rails
from simbev_ros.assets.land.covers import Cover
from simbev_ros.assets.markings import paint_markings
from simbev_ros.assets.parks import lay_out_park
from simbev_ros.assets.planting import plant_land
from simbev_ros.assets.region_ground import RegionGround
from simbev_ros.assets.static_scene import RegionScene, StaticScene
from simbev_ros.assets.streetscape import furnish_streets
from simbev_ros.assets.tiles import TileBuilder
from simbev_ros.assets.town_plan import BlockUse, plan_town
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.region import Region
from simbev_ros.maps.surroundings import SurroundingsRecipe
from simbev_ros.maps.terrain import Terrain
from simbev_ros.random import stream


def build_region(network: RoadNetwork, region: Region, terrain: Terrain) -> RegionScene:
    """Build what does not move in one region, from the map, its seed and the region alone.

    The surroundings come in as two functions of ``assets.land``:

    * ``plan_region(ground: RegionGround) -> RegionPlan``, with ``covers: tuple[Cover, ...]``;
    * ``furnish_region(tiles, claims, ground, plan) -> tuple[StreetLight, ...]``: all that stands.
    """
    ground = RegionGround.of(network, region, terrain)
    tiles, claims = TileBuilder(), Claims()
    lay_streets(tiles, ground)
    lay_land(tiles, ground, [Cover(ground.land, LAWN)])
    lay_water(tiles, ground)
    paint_markings(tiles, ground)
    build_bridges(tiles, claims, ground)
    put_guard_rails(tiles, claims, ground)
    return RegionScene(tiles.finish(), ())


def build_static_scene(network: RoadNetwork, recipe: SurroundingsRecipe, seed: int) -> StaticScene:
    """Build all that does not move.

    Args:
        network: The roads; level, at height 0.
        recipe: What stands beside them.
        seed: Of all that the recipe leaves open.

    Raises:
        SimbevError: The roads are not level.
    """
    plan = plan_town(network, recipe, seed)
    tiles, claims = TileBuilder(), Claims()
    lay_ground(tiles, plan.ground)
    lights = furnish_streets(tiles, claims, network, plan, recipe, seed)
    sites = choose_sites(plan, recipe, seed, claims)
    rng = stream(seed, "surroundings.buildings")
    for site in sites:
        tiles.place(erect(site, recipe, rng), site.map_from_building)
    green = plan.ground.lawn
    parks = [block for block in plan.blocks if block.use is BlockUse.PARK]
    paved = [lay_out_front_gardens(tiles, claims, sites, green, seed)]
    paved += [
        lay_out_park(tiles, claims, block, stream(seed, f"surroundings.park.{k}")) for k, block in enumerate(parks)
    ]
    pave(tiles, shapely.intersection(shapely.union_all(paved), green))
    plant_land(tiles, claims, plan, recipe.plant_density, seed)
    return StaticScene(tiles.finish(), lights)
