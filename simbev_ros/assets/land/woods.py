"""Woods: grown trees in the first rows along streets, trees of few triangles behind them, crowns only farther away."""

import shapely
from shapely.geometry.base import BaseGeometry

from simbev_ros.assets.land.blocks import Block
from simbev_ros.assets.land.planting import lattice_places, plant_mixed
from simbev_ros.assets.land.yard import Yard

_EDGE_M, _FRONT_M, _DEEP_M, _SEEN_M = 2.5, 9.0, 42.0, 130.0
_FRONT_SPACING_M, _DEEP_SPACING_M, _FAR_SPACING_M = 5.2, 6.4, 11.0


def lay_out_woods(yard: Yard, block: Block) -> None:
    """Lay out a wood; the farther from streets, the sparser and simpler its trees."""
    rng = yard.ground.stream(f"woods.{block.name}")
    yard.cover(block.land, "forest", block.recipe.plants)
    density = block.recipe.plant_density
    if density == 0.0:
        return
    thin = 1.0 / (2.0 * min(density, 1.0)) ** 0.5
    street = yard.ground.streets[0].area
    rest: BaseGeometry = block.land.buffer(-_EDGE_M)
    for reach_m, spacing_m, place in (
        (_FRONT_M, _FRONT_SPACING_M, "wild"),
        (_DEEP_M, _DEEP_SPACING_M, "deep"),
        (_SEEN_M, _FAR_SPACING_M, "deep"),
    ):
        near = shapely.buffer(street, reach_m, quad_segs=4)
        places = lattice_places(shapely.intersection(rest, near), spacing_m * thin, rng)
        plant_mixed(yard, places, block.recipe.plants, place, rng)
        rest = shapely.difference(rest, near)
    plant_mixed(yard, lattice_places(rest, 2.0 * _FAR_SPACING_M * thin, rng), block.recipe.plants, "far", rng)
