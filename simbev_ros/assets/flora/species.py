"""Plant species by name and by landscape, and the stock of ready meshes of each species."""

from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import Any

import numpy as np

from simbev_ros.assets.flora import bushes, trees
from simbev_ros.assets.mesh.graded import GradedMesh
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.config.base import Model
from simbev_ros.foundation.random import stream
from simbev_ros.foundation.tables import load_table

VARIANTS = 4
"""Number of different plants in the stock of a species."""

_GROWERS: Mapping[str, Callable[[np.random.Generator], Mesh | GradedMesh]] = {
    "round": trees.round_tree,
    "tall": trees.tall_tree,
    "small": trees.small_tree,
    "birch": trees.birch,
    "spruce": trees.spruce,
    "pine": trees.pine,
    "stone_pine": trees.stone_pine,
    "cypress": trees.cypress,
    "olive": trees.olive,
    "palm": trees.palm,
    "acacia": trees.acacia,
    "light_broad_leaved": trees.light_broad_leaved,
    "light_spruce": trees.light_spruce,
    "light_olive": trees.light_olive,
    "light_acacia": trees.light_acacia,
    "bush": bushes.bush,
    "oleander": bushes.oleander,
    "scrub": bushes.scrub,
    "cactus": bushes.cactus,
    "agave": bushes.agave,
    "thicket": bushes.thicket,
}


class Species(Model):
    """Space that a plant of a species needs; species.yaml explains the fields."""

    room_m: float


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
def stock(species: str, variant: int) -> GradedMesh:
    """Mesh of a plant from the stock of a species, the same on every map."""
    plant = _GROWERS[species](stream(variant, f"flora.{species}"))
    return plant if isinstance(plant, GradedMesh) else GradedMesh(plant, plant)


@lru_cache(maxsize=128)
def reach_m(species: str) -> float:
    """Radius of the widest crown in the stock of a species."""
    crowns = [stock(species, variant).mesh.vertices[:, :2] for variant in range(VARIANTS)]
    return float(max(np.hypot(*crown.T).max() for crown in crowns))


@lru_cache(maxsize=1)
def _tables() -> Mapping[str, Any]:
    return load_table("simbev_ros.assets.flora", "species.yaml")
