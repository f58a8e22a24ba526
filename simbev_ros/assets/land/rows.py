"""Puts rows of buildings along streets: each on a plot that is free, flat enough and inside of its block."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from simbev_ros.assets.architecture.facades import BAY_M
from simbev_ros.assets.architecture.fittings import find_front, fittings
from simbev_ros.assets.architecture.houses import GARAGE_M
from simbev_ros.assets.architecture.kinds import Kind, build, load_kinds
from simbev_ros.assets.architecture.plot import Plot
from simbev_ros.assets.flora.ivy import ivy
from simbev_ros.assets.land.blocks import Block, Frontage
from simbev_ros.assets.land.yard import Yard, quad, quads, yaw_of
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.placement.tiles import upright_pose
from simbev_ros.config.draw import sample
from simbev_ros.foundation.geometry.plan_view import left_of
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.surroundings import SurroundingsRecipe

_STEP_M = 1.5
_BATCH_SIZE = 12  # positions tested at once; most rows have room within one batch
_BACK_ROOM_M, _MIN_SETBACK_M = 0.6, 0.3
_BEYOND_M = 3.0
_PUSHES_M = (0.0, 4.0, 8.0, 12.0, 15.0)  # extra setbacks from a street across the region's border, into the region
_PARTY_GAP_M = 0.12
_FOOT_M = 0.3
_GRID_X, _GRID_Y = np.tile(np.linspace(-0.5, 0.5, 5), 4)[:, None], np.repeat(np.linspace(0.0, 1.0, 4), 5)[:, None]
_IVY_LANDSCAPES, _IVY_SHARE, _IVY_SPRIGS = ("temperate", "mediterranean"), 0.15, 420
_GARAGE_KINDS = ("villa", "farmhouse")
_FITTED_KINDS = ("town_house", "terrace", "apartments", "office", "shop")

ChooseKind = Callable[[float, np.random.Generator], str]
"""Function that chooses a kind of building, from the recipe's height and a random generator."""


@dataclass(frozen=True, slots=True)
class Site:
    """A building at its position.

    Attributes:
        kind: Key of kinds.yaml.
        plot: Size of the building.
        origin_m: (2,) middle of its front wall, map frame.
        along: (2,) unit direction of its front, with the building on the left.
        footprint: Footprint including ledges, eaves and the space in front.
        setback_m: Distance from the street's edge to the space in front of the building.
    """

    kind: str
    plot: Plot
    origin_m: Float64Array
    along: Float64Array
    footprint: shapely.Polygon
    setback_m: float

    def quad(self, x_m: tuple[float, float], y_m: tuple[float, float]) -> shapely.Polygon:
        """Rectangle in the map frame from ranges of x and y in the building's frame."""
        return quad(self.origin_m, self.along, x_m, y_m)

    def map_point(self, x_m: float, y_m: float) -> Float64Array:
        """(2,) point in the map frame of a point in the building's frame."""
        return np.asarray(self.origin_m + self.along * x_m + left_of(self.along) * y_m)

    def shift_along_front(self, along_m: float) -> "Site":
        """Copy of the site, shifted along its front."""
        step_m = self.along * along_m
        footprint = shapely.transform(self.footprint, lambda xy: xy + step_m)
        return replace(self, origin_m=self.origin_m + step_m, footprint=footprint)

    @property
    def street_m(self) -> float:
        """Coordinate y of the street's edge in the building's frame."""
        return -(self.setback_m + load_kinds()[self.kind].front_m)

    @property
    def yaw_rad(self) -> float:
        """Heading of the building's front."""
        return yaw_of(self.along)


def build_rows(
    yard: Yard, block: Block, choose: ChooseKind, rng: np.random.Generator, *, density: float | None = None
) -> list[Site]:
    """Fill the frontage of a block with buildings; returns the sites that were claimed and built."""
    if yard.ground.network.features.buildings is not None:
        return []
    land = block.land.buffer(-0.15)
    shapely.prepare(land)
    share = block.recipe.building_density if density is None else density
    sites = []
    for line in block.frontage:
        sites += list(_row(yard, line, land, block.recipe, choose, rng, share))
    return sites


def erect(yard: Yard, site: Site, recipe: SurroundingsRecipe, rng: np.random.Generator) -> Site | None:
    """Claim and build a site if the land is flat enough there and the map does not prescribe its buildings.

    Returns:
        The site with its foundation, or None if nothing was built.
    """
    if yard.ground.network.features.buildings is not None:
        return None
    kind = load_kinds()[site.kind]
    low_m, high_m = _land_range_m(yard, site)
    if high_m - low_m > kind.rise_m:
        return None
    plot = replace(site.plot, foundation_m=high_m - low_m + _FOOT_M)
    pieces = [walls := build(site.kind, plot, kind.draw_wall(recipe.building_style, rng), rng)]
    growth = yard.ground.stream("ivy.{:.1f}.{:.1f}".format(*site.origin_m))
    if recipe.plants in _IVY_LANDSCAPES and growth.random() < _IVY_SHARE:
        pieces.append(ivy(growth, walls, _IVY_SPRIGS))
    yard.claims.add(site.footprint)
    yard.walls.append(site.footprint)
    if site.kind in _FITTED_KINDS:
        own = yard.ground.stream(f"fittings.{site.origin_m[0]:.2f}.{site.origin_m[1]:.2f}")
        things, rests = fittings(find_front(walls, plot), own)
        pieces += things
        yard.rests.append((rests, upright_pose(site.origin_m, high_m, site.yaw_rad)[None]))
    yard.tiles.place(Mesh.merge(pieces), upright_pose(site.origin_m, high_m, site.yaw_rad))
    return replace(site, plot=plot)


def site_at(
    kind_name: str,
    position_m: Float64Array,
    along: Float64Array,
    recipe: SurroundingsRecipe,
    rng: np.random.Generator,
    setback_m: float,
    height_m: float,
) -> Site:
    """Draw a site of a building kind whose plot begins at a (2,) point on the street's edge."""
    kind = load_kinds()[kind_name]
    width_m, depth_m = (BAY_M * int(rng.integers(*span, endpoint=True)) for span in (kind.width, kind.depth))
    garage = int(rng.choice([-1, 1])) if kind_name in _GARAGE_KINDS and rng.random() < 0.75 else 0
    width_m += GARAGE_M * abs(garage)
    origin_m = position_m + along * width_m / 2.0 + left_of(along) * (setback_m + kind.front_m)
    plot = Plot(width_m, depth_m, height_m, garage=garage)
    footprint = _footprints(kind, plot, origin_m[None], along[None])[0]
    return Site(kind_name, plot, origin_m, along, footprint, setback_m)


def _row(
    yard: Yard,
    line: Frontage,
    land: BaseGeometry,
    recipe: SurroundingsRecipe,
    choose: ChooseKind,
    rng: np.random.Generator,
    share: float,
) -> Iterator[Site]:
    """Buildings side by side from one end of a line to the other."""
    s_m = 0.0
    before: tuple[str, float, float] | None = None  # kind, setback and height of a building that is continued
    while s_m < line.length_m - 2 * BAY_M:
        height_m = sample(recipe.building_height_m, rng)
        name = choose(height_m, rng)
        kind = load_kinds()[name]
        if kind.height_m is not None:
            height_m = float(rng.uniform(*kind.height_m))
        setback_m = max(_MIN_SETBACK_M, sample(recipe.building_setback_m, rng) + kind.setback_m)
        if before is not None:
            name, setback_m, height_before_m = before
            kind = load_kinds()[name]
            height_m = height_m if kind.height_m is None else height_before_m
        candidate = site_at(name, *line.chord(s_m, 2 * BAY_M), recipe, rng, setback_m, height_m)
        wanted, gap_m = rng.random() < share, _gap_m(kind, rng)
        found = _first_fit(yard, line, candidate, s_m, land)
        if found is None:
            s_m, before = s_m + BAY_M, None
            continue
        s_m, candidate = found
        site = erect(yard, candidate, recipe, rng) if wanted else None
        if site is not None:
            yield site
        before = (name, setback_m, height_m) if site is not None and gap_m == _PARTY_GAP_M else None
        s_m += candidate.plot.width_m + gap_m


def _first_fit(yard: Yard, line: Frontage, site: Site, from_m: float, land: BaseGeometry) -> tuple[float, Site] | None:
    """First distance along a line where a site, or its narrowest variant, has room; and the site there."""
    kind = load_kinds()[site.kind]
    narrow = replace(site, plot=replace(site.plot, width_m=kind.width[0] * BAY_M + GARAGE_M * abs(site.plot.garage)))
    pushed_m = _PUSHES_M if line.beyond else (0.0,)
    for candidate, push_m in product((site, narrow), pushed_m):
        candidate = replace(candidate, setback_m=site.setback_m + push_m)
        found = _first_free_position(yard, line, candidate, from_m, land)
        too_far = candidate.plot is site.plot and found is not None and found[0] - from_m > kind.width[0] * BAY_M
        if found is not None and not too_far:  # otherwise a narrow building leaves less of the street empty
            return found
    return None


def _first_free_position(
    yard: Yard, line: Frontage, site: Site, from_m: float, land: BaseGeometry
) -> tuple[float, Site] | None:
    """First distance along a line where a site has room, and the site there."""
    kind, width_m = load_kinds()[site.kind], site.plot.width_m
    all_m = np.arange(from_m, line.length_m + _BEYOND_M - width_m, _STEP_M)
    for s_m in np.split(all_m, np.arange(_BATCH_SIZE, len(all_m), _BATCH_SIZE)):
        positions, along = line.chords(s_m, width_m)
        origins_m = positions + along * width_m / 2.0 + left_of(along) * (site.setback_m + kind.front_m)
        footprints = _footprints(kind, site.plot, origins_m, along)
        fits = shapely.contains(land, footprints) & shapely.contains(yard.inside, footprints)
        for k in np.flatnonzero(fits).tolist():
            if yard.claims.is_free(footprints[k]):
                return float(s_m[k]), replace(site, origin_m=origins_m[k], along=along[k], footprint=footprints[k])
    return None


def _footprints(
    kind: Kind, plot: Plot, origin_m: Float64Array, along: Float64Array
) -> np.ndarray[tuple[int], np.dtype[np.object_]]:
    """(N,) footprints of a plot at (N, 2) positions."""
    half_m = plot.width_m / 2.0 + kind.verge_m
    return quads(origin_m, along, (-half_m, half_m), (-kind.front_m, plot.depth_m + _BACK_ROOM_M))


def _land_range_m(yard: Yard, site: Site) -> tuple[float, float]:
    """Minimum and maximum height of the land under a site."""
    x_m, y_m = _GRID_X * site.plot.width_m, _GRID_Y * (site.plot.depth_m + 0.5) - 0.5
    positions = site.origin_m + x_m * site.along + y_m * left_of(site.along)
    height_m = yard.ground.land_m(positions)
    return float(height_m.min()), float(height_m.max())


def _gap_m(kind: Kind, rng: np.random.Generator) -> float:
    """Gap to the next building."""
    return _PARTY_GAP_M if rng.random() < kind.party else float(rng.uniform(*kind.gap_m))
