"""Lays out traffic islands: lawn with trees and bushes, no buildings."""

import shapely

from simbev_ros.assets.land.blocks import Block
from simbev_ros.assets.land.planting import scatter
from simbev_ros.assets.land.yard import Yard

_FROM_STREET_M, _M2_PER_PLANT = 2.5, 45.0


def lay_out_island(yard: Yard, block: Block) -> None:
    """Lay out land in the middle of a street."""
    yard.cover(block.land, "lawn", block.recipe.plants)
    if block.recipe.plant_density > 0.0:
        green = shapely.buffer(block.land, -_FROM_STREET_M)
        rng = yard.ground.stream(f"island.{block.name}")
        scatter(yard, green, _M2_PER_PLANT / block.recipe.plant_density, block.recipe.plants, "park", rng)
