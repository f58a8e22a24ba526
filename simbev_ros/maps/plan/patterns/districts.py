"""Assigns a use to each cell of a region: a city around its center, industry, parks, farmland and woods."""

import numpy as np
from pydantic import Field

from simbev_ros.config.base import Model

Cell = tuple[int, int]


class DistrictsRecipe(Model):
    """Number of cells per use; the remaining cells are farmland."""

    downtown: int = Field(4, ge=1)
    residential: int = Field(6, ge=0)
    suburb: int = Field(12, ge=0)
    industrial: int = Field(5, ge=0)
    park: int = Field(2, ge=0)
    woods: int = Field(14, ge=0)


def draw_districts(
    recipe: DistrictsRecipe, cells: int, center: tuple[float, float], rng: np.random.Generator
) -> dict[Cell, str]:
    """Draw the use of each cell: downtown in the middle, then residential, suburbs, woods; industry to one side.

    Args:
        recipe: Number of cells per use.
        cells: Number of cells along a side of the region.
        center: The city's center, in cells.
        rng: Random generator for the irregularities.
    """
    centers = {(i, j): np.array([i + 0.5, j + 0.5]) - center for i in range(cells) for j in range(cells)}
    distance = {
        cell: float(np.linalg.norm(center_offset)) + rng.uniform(0.0, 0.7) for cell, center_offset in centers.items()
    }
    chebyshev = {cell: float(np.max(np.abs(center_offset))) for cell, center_offset in centers.items()}
    unassigned = sorted(centers, key=lambda cell: (chebyshev[cell], distance[cell]))
    districts = dict.fromkeys(unassigned[: recipe.downtown], "downtown")
    unassigned = sorted((cell for cell in unassigned if cell not in districts), key=lambda cell: distance[cell])
    districts |= dict.fromkeys(unassigned[: recipe.residential], "residential")
    unassigned = unassigned[recipe.residential :]
    angle = rng.uniform(0.0, 2.0 * np.pi)
    target = 2.6 * np.array([np.cos(angle), np.sin(angle)])
    unassigned = sorted(unassigned, key=lambda cell: float(np.linalg.norm(centers[cell] - target)))
    districts |= dict.fromkeys(unassigned[: recipe.industrial], "industrial")
    unassigned = sorted(unassigned[recipe.industrial :], key=lambda cell: distance[cell])
    city = unassigned[: recipe.suburb + recipe.park]
    parks = {int(index) for index in rng.permutation(len(city))[: recipe.park]}
    districts |= {cell: "park" if index in parks else "suburb" for index, cell in enumerate(city)}
    rest = unassigned[len(city) :]
    angle = rng.uniform(0.0, 2.0 * np.pi)
    target = cells / 2.0 * np.array([np.cos(angle), np.sin(angle)])
    rest = sorted(rest, key=lambda cell: float(np.linalg.norm(centers[cell] - target)) + rng.uniform(0.0, 3.0))
    districts |= dict.fromkeys(rest[: recipe.woods], "woods")
    return districts | dict.fromkeys(rest[recipe.woods :], "farmland")
