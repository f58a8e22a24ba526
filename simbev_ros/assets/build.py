"""The static scene of a map."""

from simbev_ros.assets.building_sites import choose_sites, erect
from simbev_ros.assets.claims import Claims
from simbev_ros.assets.gardens import lay_out_gardens
from simbev_ros.assets.ground import lay_ground
from simbev_ros.assets.markings import paint_markings
from simbev_ros.assets.static_scene import StaticScene
from simbev_ros.assets.streetscape import furnish_streets
from simbev_ros.assets.tiles import TileBuilder
from simbev_ros.assets.town_plan import plan_town
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.recipe import SurroundingsRecipe
from simbev_ros.scene.random import stream


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
    paint_markings(tiles, network, plan.road)
    lights = furnish_streets(tiles, claims, network, plan, recipe, seed)
    sites = choose_sites(plan, recipe, seed, claims)
    rng = stream(seed, "surroundings.buildings")
    for site in sites:
        tiles.place(erect(site, recipe, rng), site.map_from_building)
    lay_out_gardens(tiles, claims, plan, sites, recipe.plant_density, seed)
    return StaticScene(tiles.finish(), lights)
