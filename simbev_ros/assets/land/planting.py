"""Plants trees and bushes at free positions, with crowns clear of buildings, traffic lights and streets."""

from collections.abc import Sequence

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from simbev_ros.assets.flora.species import VARIANTS, draw_species, load_species, reach_m, stock
from simbev_ros.assets.land.yard import Yard
from simbev_ros.assets.placement.ensemble import Base
from simbev_ros.assets.placement.nearby_objects import TREE_KINDS
from simbev_ros.foundation.types import AnyArray, BoolArray, Float64Array

_WILD_HABITATS = ("wild", "deep", "far", "low")  # their trees are not mapped one by one
_SEEN_WELL_M, _TREE_M = 24.0, 1.8
_MIN_SCALE, _MAX_SCALE = 0.8, 1.15  # factors of the size in the stock


def plant(yard: Yard, species: str, xy_m: Float64Array, rng: np.random.Generator, base: Base = Base.LAND) -> None:
    """Put plants of a species at (N, 2) positions: randomly turned, scaled and tinted copies from the stock."""
    count = len(xy_m)
    variant = rng.integers(VARIANTS, size=count)
    turn_rad, scale = rng.uniform(0.0, 2.0 * np.pi, count), rng.uniform(_MIN_SCALE, _MAX_SCALE, count)
    tint = 1.0 + rng.uniform(-0.1, 0.1, (count, 1)) + rng.uniform(-0.04, 0.04, (count, 3))
    for number in range(VARIANTS):
        own = variant == number
        if own.any():
            yard.ensemble.put(
                stock(species, number, yard.ground.season),
                xy_m[own],
                turn_rad[own],
                base=base,
                scale=scale[own],
                tint=tint[own],
            )


def scatter(
    yard: Yard, area: BaseGeometry, m2_per_plant: float, landscape: str, habitat: str, rng: np.random.Generator
) -> None:
    """Plant an area at random with a mean density; plants without enough room are then left out."""
    xy_m = random_positions(area, m2_per_plant, rng)
    plant_mixed(yard, xy_m, landscape, habitat, rng)


def plant_mixed(yard: Yard, xy_m: Float64Array, landscape: str, habitat: str, rng: np.random.Generator) -> None:
    """Plant species of a habitat at those of (N, 2) positions that are free."""
    names = np.array(draw_species(landscape, habitat, len(xy_m), rng), object)
    hidden = _are_far_from_streets(yard, xy_m) & (_crown_radii_m(names) >= _TREE_M)
    names[hidden] = draw_species(landscape, "deep", int(hidden.sum()), rng)
    clear = has_room(yard, xy_m, _crown_radii_m(names))
    if habitat not in _WILD_HABITATS:
        clear &= ~(yard.map_objects.replace(TREE_KINDS, xy_m) & (_crown_radii_m(names) >= _TREE_M))
    room_m = np.array([load_species()[name].room_m for name in names])
    xy_m, names, room_m = xy_m[clear], names[clear], room_m[clear]
    free = yard.claims.claim_discs(xy_m, room_m)
    for species in sorted(set(names[free].tolist())):
        plant(yard, species, xy_m[free & (names == species)], rng)


def has_room(yard: Yard, xy_m: Float64Array, crown_m: Float64Array, *, beside_street: bool = False) -> BoolArray:
    """(N,) whether crowns with (N,) radii at (N, 2) positions are clear of buildings, traffic lights and streets.

    Crowns must also stay inside of the region. Trees planted ``beside_street`` need not keep clear of streets.
    """
    points = np.array(shapely.points(xy_m)).reshape(-1)
    low_m, high_m = (np.array(corner) for corner in (yard.inside.bounds[:2], yard.inside.bounds[2:]))
    clear: BoolArray = np.minimum(xy_m - low_m, high_m - xy_m).min(axis=1, initial=np.inf) >= _MAX_SCALE * crown_m
    for tree, extra_m in yard.crown_obstacles()[: 2 if beside_street else 3]:
        near, _ = tree.query(points, predicate="dwithin", distance=_MAX_SCALE * crown_m + extra_m)
        clear[near] = False
    return clear


def _crown_radii_m(names: Sequence[str] | AnyArray) -> Float64Array:
    """(N,) crown radii of plants by their species' names."""
    return np.array([reach_m(name) for name in names], np.float64)


def _are_far_from_streets(yard: Yard, xy_m: Float64Array) -> BoolArray:
    """(N,) whether positions are far enough from streets for low-polygon trees."""
    far = np.full(len(xy_m), True)
    near, _ = yard.edges.query(np.array(shapely.points(xy_m)).reshape(-1), predicate="dwithin", distance=_SEEN_WELL_M)
    far[near] = False
    return far


def random_positions(area: BaseGeometry, m2_per_plant: float, rng: np.random.Generator) -> Float64Array:
    """Draw (N, 2) positions, uniformly at random in an area."""
    if area.is_empty:
        return np.empty((0, 2))
    x0, y0, x1, y1 = area.bounds
    positions = rng.uniform((x0, y0), (x1, y1), (int((x1 - x0) * (y1 - y0) / m2_per_plant), 2))
    shapely.prepare(area)
    return np.asarray(positions[shapely.contains_xy(area, positions)])


def lattice_positions(area: BaseGeometry, spacing_m: float, rng: np.random.Generator) -> Float64Array:
    """Draw (N, 2) positions in an area, on a randomly perturbed square lattice."""
    if area.is_empty:
        return np.empty((0, 2))
    x0, y0, x1, y1 = area.bounds
    nodes = np.stack(np.meshgrid(np.arange(x0, x1, spacing_m), np.arange(y0, y1, spacing_m)), axis=-1).reshape(-1, 2)
    positions = nodes + rng.uniform(0.1, 0.9, nodes.shape) * spacing_m
    shapely.prepare(area)
    return np.asarray(positions[shapely.contains_xy(area, positions)])
