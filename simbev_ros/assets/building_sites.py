"""Puts buildings along the streets: a row of plots on every side of a block, each with a style that suits its place."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import shapely

from simbev_ros.assets.buildings import STYLES, Plot
from simbev_ros.assets.claims import Claims
from simbev_ros.assets.facades import BAY_M, PARTY_LEDGE_M
from simbev_ros.assets.ground import LAND_HEIGHT_M
from simbev_ros.assets.mesh import Mesh
from simbev_ros.assets.tiles import standing
from simbev_ros.assets.town_plan import Block, BlockUse, FrontSide, TownPlan, front_sides
from simbev_ros.config.draw import sample
from simbev_ros.maps.surroundings import SurroundingsRecipe
from simbev_ros.random import stream
from simbev_ros.types import Float64Array

_STEP_M = 1.0
_HIGHEST_HOUSE_M, _HIGHEST_APARTMENTS_M = 7.5, 24.0
_PARTY_GAP_M, _HOUSE_VERGE_M = 0.12, 0.5
_DENSITY_POWER = {BlockUse.DOWNTOWN: 0.4, BlockUse.RESIDENTIAL: 1.0, BlockUse.OUTSKIRTS: 3.0}
_BAYS = {"house": (3, 4), "shop": (4, 8), "apartments": (4, 8), "office": (6, 11)}
_DEPTH_BAYS = {"house": (3, 3), "shop": (4, 5), "apartments": (4, 4), "office": (5, 7)}
SHOULDER_ROOM_M = 1.3
"""Between setback line and front wall: room for steps, awnings, cornices and balconies."""


@dataclass(frozen=True, slots=True)
class Site:
    """A building in its place.

    Attributes:
        style: Key of ``STYLES``.
        plot: Its measures.
        map_from_building: (4, 4) pose; frame as in ``facades``.
        footprint: Map frame, ledges and eaves included.
        setback_m: From the frontage to the front wall.
    """

    style: str
    plot: Plot
    map_from_building: Float64Array
    footprint: shapely.Polygon
    setback_m: float


def choose_sites(plan: TownPlan, recipe: SurroundingsRecipe, seed: int, claims: Claims) -> tuple[Site, ...]:
    """Sites that lie within their block and apart from each other, claimed."""
    sites: list[Site] = []
    for number, block in enumerate(plan.blocks):
        if block.use is BlockUse.PARK:
            continue
        rng = stream(seed, f"surroundings.sites.{number}")
        inside = block.land.buffer(-0.15)
        shapely.prepare(inside)
        for side in front_sides(block, shortest_m=12.0):
            sites += _row(side, block, inside, recipe, rng, claims)
    return tuple(sites)


def erect(site: Site, recipe: SurroundingsRecipe, rng: np.random.Generator) -> Mesh:
    """The building of a site, in its own frame."""
    wall = recipe.building_style
    if wall not in ("brick", "plaster", "glass") or (wall == "glass" and site.style != "office"):
        wall = "brick" if rng.random() < 0.45 else "plaster"
    return STYLES[site.style](site.plot, rng, wall)


def _row(
    side: FrontSide,
    block: Block,
    inside: shapely.Polygon,
    recipe: SurroundingsRecipe,
    rng: np.random.Generator,
    claims: Claims,
) -> Iterator[Site]:
    """Buildings side by side from one end of a side to the other."""
    share = recipe.building_density ** _DENSITY_POWER[block.use]
    s_m = 0.0
    while s_m < side.length_m - 2 * BAY_M:
        candidate = _candidate(side, s_m, block, recipe, rng)
        while not (inside.contains(candidate.footprint) and claims.is_free(candidate.footprint)):
            s_m += _STEP_M
            if s_m > side.length_m - 2 * BAY_M:
                return
            candidate = _moved(candidate, side.direction * _STEP_M)
        if rng.random() < share:
            claims.add(candidate.footprint)
            yield candidate
        s_m += candidate.plot.width_m + _gap_m(candidate.style, rng)


def _candidate(side: FrontSide, s_m: float, block: Block, recipe: SurroundingsRecipe, rng: np.random.Generator) -> Site:
    """A building whose left corner is at a distance along the side."""
    place = side.start_m + side.direction * s_m
    height_m = sample(recipe.building_height_m, rng)
    style = _style(block.use, height_m, rng)
    width_m, depth_m = (
        BAY_M * int(rng.integers(low, high, endpoint=True)) for low, high in (_BAYS[style], _DEPTH_BAYS[style])
    )
    setback_m = sample(recipe.building_setback_m, rng) + (2.5 if style == "house" else 0.0)
    origin = place + side.direction * width_m / 2.0 + side.inward * (setback_m + SHOULDER_ROOM_M)
    pose = standing(origin, LAND_HEIGHT_M, side.yaw_rad)
    half_m = width_m / 2.0 + (_HOUSE_VERGE_M if style == "house" else PARTY_LEDGE_M)
    near_m, far_m = -SHOULDER_ROOM_M, depth_m + 0.6
    corners = np.array([[-half_m, near_m], [half_m, near_m], [half_m, far_m], [-half_m, far_m]])
    footprint = shapely.Polygon(corners @ pose[:2, :2].T + pose[:2, 3])
    return Site(style, Plot(width_m, depth_m, height_m), pose, footprint, setback_m)


def _moved(site: Site, step_m: Float64Array) -> Site:
    pose = site.map_from_building.copy()
    pose[:2, 3] += step_m
    footprint = shapely.transform(site.footprint, lambda xy: xy + step_m)
    return Site(site.style, site.plot, pose, footprint, site.setback_m)


def _style(use: BlockUse, height_m: float, rng: np.random.Generator) -> str:
    if height_m > _HIGHEST_APARTMENTS_M:
        return "office"
    if use is BlockUse.DOWNTOWN:
        return "shop" if height_m < _HIGHEST_HOUSE_M else "apartments"
    if height_m < _HIGHEST_HOUSE_M + 3.0 * rng.random():
        return "house" if rng.random() < 0.8 else "shop"
    return "apartments"


def _gap_m(style: str, rng: np.random.Generator) -> float:
    """Room to the next building."""
    if style == "house":
        return float(rng.uniform(3.0, 8.0))
    return float(rng.uniform(3.0, 7.0)) if rng.random() < 0.3 else _PARTY_GAP_M
