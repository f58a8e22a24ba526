"""Deciduous plants out of summer: bare branches, and the leaves or blossoms that they carry in a season."""

from collections.abc import Mapping
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from simbev_ros.assets.flora.crowns import foliage, sprig_directions, sprig_length_m
from simbev_ros.assets.flora.skeleton import Crown, Habit, Shoots, Skeleton
from simbev_ros.assets.mesh.graded import GradedMesh
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.palette import Color, pick_color
from simbev_ros.config.base import Model
from simbev_ros.config.weather import Season
from simbev_ros.foundation.tables import load_table

_COARSER = 6
"""Number of sprigs that one sprig of the coarse mesh stands for."""


class Deciduous(Habit):
    """Branches and leaves of a deciduous species; species.yaml explains the fields."""

    leaves: str = "broad_leaves"
    spring: str = "fresh_leaves"
    autumn: str = "autumn_leaves"
    winter: str = "dead_leaves"
    flower: str = "blossoms"
    blossom: float = 0.0
    kept: float = 0.0


class Dress(Model):
    """Leaves that a deciduous plant has in a season, as shares of those in summer; species.yaml explains the fields."""

    palette: str
    full: float
    leaves: tuple[float, float]
    length: float
    twigs: int


class Limbs(NamedTuple):
    """Limbs of a plant, the space for all of its branches, and the color of its bark."""

    shoots: Shoots
    crown: Crown
    bark: Color


def dress(rng: np.random.Generator, habit: Deciduous, limbs: Limbs, sprigs: int, season: Season) -> GradedMesh:
    """Grow branches from limbs, with the leaves of a season.

    Args:
        rng: Random generator to draw from.
        habit: The species.
        limbs: Its limbs.
        sprigs: Number of sprigs in full leaf.
        season: Any season but summer.
    """
    wear, twig = _dresses()[season], pick_color(rng, habit.twigs, 0.1)
    skeleton = Skeleton.grow(rng, habit, limbs.crown, limbs.shoots, wear.twigs)
    parts = [GradedMesh(skeleton.mesh(rng, limbs.bark, twig, habit.twig_width), skeleton.coarse(rng, limbs.bark, twig))]
    share = rng.uniform(*wear.leaves) + habit.kept * rng.uniform(0.4, 1.6)
    if season == "spring" and rng.random() < habit.blossom:
        parts.append(
            _leaves(rng, skeleton, limbs.crown, round(1.3 * sprigs), pick_color(rng, habit.flower, 0.05), 0.75)
        )
    elif share > 0.0:
        color = leaf_color(rng, habit, season)
        parts.append(_leaves(rng, skeleton, limbs.crown, round(sprigs * share), color, wear.length))
    return GradedMesh.merge(parts)


def is_full(rng: np.random.Generator, season: Season) -> bool:
    """Draw whether the crown of a deciduous plant is closed in a season."""
    return season == "summer" or rng.random() < _dresses()[season].full


def leaf_color(rng: np.random.Generator, habit: Deciduous, season: Season) -> Color:
    """Draw the color of a deciduous plant's leaves in a season."""
    palette: str = habit.leaves if season == "summer" else getattr(habit, _dresses()[season].palette)
    return pick_color(rng, palette, 0.1)


def _leaves(
    rng: np.random.Generator, skeleton: Skeleton, crown: Crown, count: int, color: Color, length: float
) -> GradedMesh:
    """Sprigs at the branches and twigs, ``length`` times as long as those of a crown in full leaf."""
    shoots = skeleton.twigs if len(skeleton.twigs.radius_m) else skeleton.branches
    chosen = shoots.some(rng.integers(len(shoots.radius_m), size=count))
    positions_m = chosen.at(rng.uniform(0.3, 1.0, (count, 1)))[0][:, 0]
    outward = (positions_m - crown.middle_m) / crown.radii_m
    outward /= np.maximum(np.linalg.norm(outward, axis=1, keepdims=True), 1e-6)
    along = sprig_directions(rng, outward, 0.35, -0.15)
    length_m = length * sprig_length_m(crown.radii_m, max(count, 300), 0.4)

    def sprigs(step: int, factor: float) -> Mesh:
        return foliage(
            rng, positions_m[::step], outward[::step], along[::step], crown.middle_m, factor * length_m, color
        )

    return GradedMesh(sprigs(1, 1.0), sprigs(_COARSER, 0.9 * _COARSER**0.5))


@lru_cache(maxsize=1)
def _dresses() -> Mapping[str, Dress]:
    table = load_table("simbev_ros.assets.flora", "species.yaml")["seasons"]
    return {name: Dress.model_validate(entry) for name, entry in table.items()}
