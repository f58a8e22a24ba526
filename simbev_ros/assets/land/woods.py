"""Lays out woods: detailed trees in the first rows along streets, low-polygon trees behind, thickets further away."""

from simbev_ros.assets.land.blocks import Block
from simbev_ros.assets.land.planting import lattice_positions, plant_mixed
from simbev_ros.assets.land.yard import Yard
from simbev_ros.foundation.geometry import overlay

_EDGE_M, _FRONT_M, _DEEP_M, _SEEN_M = 2.5, 8.5, 42.0, 110.0
_FRONT_SPACING_M, _DEEP_SPACING_M, _FAR_SPACING_M = 5.8, 6.4, 12.0


def lay_out_woods(yard: Yard, block: Block) -> None:
    """Lay out a wood; trees become sparser and simpler with the distance from streets."""
    rng = yard.ground.stream(f"woods.{block.name}")
    landscape, density = block.recipe.plants, block.recipe.plant_density
    verge = overlay.intersection(block.land, yard.fast)
    yard.cover(verge, "meadow", landscape)
    yard.cover(overlay.difference(block.land, verge), "forest", landscape)
    if density == 0.0:
        return
    thin = 1.0 / (2.0 * min(density, 1.0)) ** 0.5
    rest = overlay.difference(block.land, overlay.union(yard.near_streets(_EDGE_M), yard.fast))
    for reach_m, spacing_m, habitat in (
        (_FRONT_M, _FRONT_SPACING_M, "wild"),
        (_DEEP_M, _DEEP_SPACING_M, "deep"),
        (_SEEN_M, _FAR_SPACING_M, "deep"),
    ):
        near = yard.near_streets(reach_m)
        positions = lattice_positions(overlay.intersection(rest, near), spacing_m * thin, rng)
        plant_mixed(yard, positions, landscape, habitat, rng)
        rest = overlay.difference(rest, near)
    plant_mixed(yard, lattice_positions(rest, 2.0 * _FAR_SPACING_M * thin, rng), landscape, "far", rng)
