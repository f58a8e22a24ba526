"""Plant species by name and by landscape, and the stock of ready meshes of each species."""

from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import Any

import numpy as np

from simbev_ros.assets.flora import bushes, trees
from simbev_ros.assets.mesh.graded import GradedMesh
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.config.base import Model
from simbev_ros.config.weather import Season
from simbev_ros.foundation.random import stream
from simbev_ros.foundation.tables import load_table

_REACH, _TWIG_REACH_M = 1.1, 0.36
"""Upper bound of the reach of a tree's branches and leaves: a factor of the radius of its crown, and meters beyond."""

VARIANTS = 4
"""Number of different plants in the stock of a species."""

_GROWERS: Mapping[str, Callable[[np.random.Generator], Mesh | GradedMesh]] = {
    "spruce": trees.spruce,
    "pine": trees.pine,
    "stone_pine": trees.stone_pine,
    "cypress": trees.cypress,
    "palm": trees.palm,
    "acacia": trees.acacia,
    "light_spruce": trees.light_spruce,
    "light_olive": trees.light_olive,
    "light_acacia": trees.light_acacia,
    "cactus": bushes.cactus,
    "agave": bushes.agave,
}
_SEASONAL: Mapping[str, Callable[[np.random.Generator, Season], Mesh | GradedMesh]] = {
    "light_broad_leaved": trees.light_broad_leaved,
    "thicket": bushes.thicket,
}


class Species(Model):
    """Space that a plant of a species needs, and its form; species.yaml explains the fields."""

    room_m: float
    tree: trees.BroadLeaved | None = None
    shrub: bushes.Shrub | None = None


@lru_cache(maxsize=1)
def load_species() -> Mapping[str, Species]:
    """Load species.yaml: all species by name."""
    return {name: Species(**entry) for name, entry in _tables()["species"].items()}


def draw_species(landscape: str, habitat: str, count: int, rng: np.random.Generator) -> list[str]:
    """Draw the species of ``count`` plants for a habitat of a landscape (keys of species.yaml's ``landscapes``)."""
    weights: Mapping[str, float] = _tables()["landscapes"][landscape][habitat]
    share = np.array(list(weights.values()), np.float64)
    names = list(weights)
    return [names[k] for k in rng.choice(len(names), count, p=share / share.sum())]


@lru_cache(maxsize=512)
def stock(species: str, variant: int, season: Season = "summer") -> GradedMesh:
    """Mesh of a plant from the stock of a species, the same on every map."""
    rng, known = stream(variant, f"flora.{species}"), load_species()[species]
    if known.tree is not None:
        return trees.broad_leaved(rng, known.tree, season)
    if known.shrub is not None:
        return bushes.shrub(rng, known.shrub, season)
    plant = _SEASONAL[species](rng, season) if species in _SEASONAL else _GROWERS[species](rng)
    return plant if isinstance(plant, GradedMesh) else GradedMesh(plant, plant)


@lru_cache(maxsize=128)
def reach_m(species: str) -> float:
    """Radius that the crowns of a species' stock have at most, in all seasons: plants stand at the same positions."""
    tree = load_species()[species].tree
    if tree is not None:
        return _REACH * tree.radius_m + _TWIG_REACH_M
    crowns = [stock(species, variant).mesh.vertices[:, :2] for variant in range(VARIANTS)]
    return float(max(np.hypot(*crown.T).max() for crown in crowns))


@lru_cache(maxsize=1)
def _tables() -> Mapping[str, Any]:
    return load_table("simbev_ros.assets.flora", "species.yaml")
