"""Which cell of a region is used for what: a city around its centre, industry, parks, farmland and woods."""

import numpy as np
from pydantic import Field

from simbev_ros.config.base import Model

Cell = tuple[int, int]


class DistrictsRecipe(Model):
    """How many cells are used for what; the rest is farmland."""

    downtown: int = Field(4, ge=1)
    residential: int = Field(6, ge=0)
    suburb: int = Field(12, ge=0)
    industrial: int = Field(5, ge=0)
    park: int = Field(2, ge=0)
    woods: int = Field(14, ge=0)


def draw_districts(
    recipe: DistrictsRecipe, cells: int, center: tuple[float, float], rng: np.random.Generator
) -> dict[Cell, str]:
    """The use of each cell: downtown in the middle, then houses, suburbs; industry on one side; woods far out.

    Args:
        recipe: How many of each.
        cells: Along a side of the region.
        center: The city's middle, in cells.
        rng: Draws the irregularities.
    """
    places = {(i, j): np.array([i + 0.5, j + 0.5]) - center for i in range(cells) for j in range(cells)}
    distance = {cell: float(np.linalg.norm(place)) + rng.uniform(0.0, 0.7) for cell, place in places.items()}
    core = {cell: float(np.max(np.abs(place))) for cell, place in places.items()}
    free = sorted(places, key=lambda cell: (core[cell], distance[cell]))
    districts = dict.fromkeys(free[: recipe.downtown], "downtown")
    free = sorted((cell for cell in free if cell not in districts), key=lambda cell: distance[cell])
    districts |= dict.fromkeys(free[: recipe.residential], "residential")
    free = free[recipe.residential :]
    angle = rng.uniform(0.0, 2.0 * np.pi)
    toward = 2.6 * np.array([np.cos(angle), np.sin(angle)])
    free = sorted(free, key=lambda cell: float(np.linalg.norm(places[cell] - toward)))
    districts |= dict.fromkeys(free[: recipe.industrial], "industrial")
    free = sorted(free[recipe.industrial :], key=lambda cell: distance[cell])
    city = free[: recipe.suburb + recipe.park]
    parks = {int(index) for index in rng.permutation(len(city))[: recipe.park]}
    districts |= {cell: "park" if index in parks else "suburb" for index, cell in enumerate(city)}
    rest = free[len(city) :]
    angle = rng.uniform(0.0, 2.0 * np.pi)
    toward = cells / 2.0 * np.array([np.cos(angle), np.sin(angle)])
    rest = sorted(rest, key=lambda cell: float(np.linalg.norm(places[cell] - toward)) + rng.uniform(0.0, 3.0))
    districts |= dict.fromkeys(rest[: recipe.woods], "woods")
    return districts | dict.fromkeys(rest[recipe.woods :], "farmland")
