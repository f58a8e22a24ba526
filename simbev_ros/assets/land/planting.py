"""Plants on the land: at random places that are free, crowns clear of buildings, signals and streets."""

from collections.abc import Sequence

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from simbev_ros.assets.flora.species import VARIANTS, draw_species, load_species, reach_m, stock
from simbev_ros.assets.land.yard import Yard
from simbev_ros.assets.placement.ensemble import Base
from simbev_ros.types import AnyArray, BoolArray, Float64Array

_SEEN_WELL_M, _TREE_M = 24.0, 1.8
_SMALLEST, _LARGEST = 0.8, 1.15  # of the stock's size


def plant(yard: Yard, species: str, xy_m: Float64Array, rng: np.random.Generator, base: Base = Base.LAND) -> None:
    """Put plants of a species at (N, 2) places: turned, scaled and tinted copies of the stock."""
    count = len(xy_m)
    variant = rng.integers(VARIANTS, size=count)
    turn_rad, scale = rng.uniform(0.0, 2.0 * np.pi, count), rng.uniform(_SMALLEST, _LARGEST, count)
    tint = 1.0 + rng.uniform(-0.1, 0.1, (count, 1)) + rng.uniform(-0.04, 0.04, (count, 3))
    for number in range(VARIANTS):
        own = variant == number
        if own.any():
            yard.ensemble.put(
                stock(species, number), xy_m[own], turn_rad[own], base=base, scale=scale[own], tint=tint[own]
            )


def scatter(
    yard: Yard, area: BaseGeometry, m2_per_plant: float, landscape: str, place: str, rng: np.random.Generator
) -> None:
    """Plant an area at random, so densely on average before those that have no room are left out."""
    xy_m = random_places(area, m2_per_plant, rng)
    plant_mixed(yard, xy_m, landscape, place, rng)


def plant_mixed(yard: Yard, xy_m: Float64Array, landscape: str, place: str, rng: np.random.Generator) -> None:
    """Plant at those of (N, 2) places that are free, of the species of a kind of place."""
    names = np.array(draw_species(landscape, place, len(xy_m), rng), object)
    hidden = _is_far_from_streets(yard, xy_m) & (_reaches_m(names) >= _TREE_M)
    names[hidden] = draw_species(landscape, "deep", int(hidden.sum()), rng)
    clear = has_room(yard, xy_m, _reaches_m(names))
    room_m = np.array([load_species()[name].room_m for name in names])
    xy_m, names, room_m = xy_m[clear], names[clear], room_m[clear]
    free = yard.claims.claim_discs(xy_m, room_m)
    for species in sorted(set(names[free].tolist())):
        plant(yard, species, xy_m[free & (names == species)], rng)


def has_room(yard: Yard, xy_m: Float64Array, crown_m: Float64Array, *, beside_street: bool = False) -> BoolArray:
    """(N,) whether crowns of (N,) radii keep clear of buildings, signals and the region's border.

    And of streets, unless they stand ``beside_street`` on purpose.
    """
    points = np.array(shapely.points(xy_m)).reshape(-1)
    low_m, high_m = (np.array(corner) for corner in (yard.inside.bounds[:2], yard.inside.bounds[2:]))
    clear: BoolArray = np.minimum(xy_m - low_m, high_m - xy_m).min(axis=1, initial=np.inf) >= _LARGEST * crown_m
    for tree, extra_m in yard.keep_off_trees()[: 2 if beside_street else 3]:
        near, _ = tree.query(points, predicate="dwithin", distance=_LARGEST * crown_m + extra_m)
        clear[near] = False
    return clear


def _reaches_m(names: Sequence[str] | AnyArray) -> Float64Array:
    """(N,) reach of plants by their species' names."""
    return np.array([reach_m(name) for name in names], np.float64)


def _is_far_from_streets(yard: Yard, xy_m: Float64Array) -> BoolArray:
    """(N,) where trees of few triangles do."""
    far = np.full(len(xy_m), True)
    near, _ = yard.edges.query(np.array(shapely.points(xy_m)).reshape(-1), predicate="dwithin", distance=_SEEN_WELL_M)
    far[near] = False
    return far


def random_places(area: BaseGeometry, m2_per_plant: float, rng: np.random.Generator) -> Float64Array:
    """(N, 2) places evenly at random in an area."""
    if area.is_empty:
        return np.empty((0, 2))
    x0, y0, x1, y1 = area.bounds
    places = rng.uniform((x0, y0), (x1, y1), (int((x1 - x0) * (y1 - y0) / m2_per_plant), 2))
    shapely.prepare(area)
    return np.asarray(places[shapely.contains_xy(area, places)])


def lattice_places(area: BaseGeometry, spacing_m: float, rng: np.random.Generator) -> Float64Array:
    """(N, 2) places of an area on a disturbed square lattice."""
    if area.is_empty:
        return np.empty((0, 2))
    x0, y0, x1, y1 = area.bounds
    nodes = np.stack(np.meshgrid(np.arange(x0, x1, spacing_m), np.arange(y0, y1, spacing_m)), axis=-1).reshape(-1, 2)
    places = nodes + rng.uniform(0.1, 0.9, nodes.shape) * spacing_m
    shapely.prepare(area)
    return np.asarray(places[shapely.contains_xy(area, places)])
