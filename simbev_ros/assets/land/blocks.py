"""Divides the land of a region into blocks of one land use each, with the lines along which they front streets."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from simbev_ros.assets.placement.region_ground import MARGIN_M, RegionGround
from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.geometry.plan_view import multi_polygon
from simbev_ros.foundation.types import BoolArray, Float64Array
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.layout import Strip
from simbev_ros.maps.surroundings import SurroundingsRecipe

_MIN_PART_M2, _MIN_AREA_M2 = 0.01, 40.0
_STRAIGHT_M, _MIN_SIDE_M, _MIN_CHORD_M = 0.35, 6.0, 2.5
_BEND_RAD = np.radians(22.0)
_NEAR_M = 0.7
_FAST_MPS, _FAST_M = 22.3, 22.0
_WALK_SHARE = 0.2
_BEYOND_M = 14.0
_MAX_ISLAND_M2 = 8000.0

Zones = Sequence[tuple[SurroundingsRecipe, BaseGeometry]]
"""Recipes of the land and the areas where they apply; together the areas cover the whole region."""


@dataclass(frozen=True, slots=True)
class Frontage:
    """A line without corners along a street, with the land on its left.

    Attributes:
        line: The line, map frame, meters.
        walk: Whether the street has a sidewalk here.
        beyond: Whether the line lies just across the region's border, so that only this region can build along it.
    """

    line: shapely.LineString
    walk: bool
    beyond: bool = False

    @property
    def length_m(self) -> float:
        """Length of the line."""
        return float(self.line.length)

    def chord(self, start_m: float, length_m: float) -> tuple[Float64Array, Float64Array]:
        """(2,) point at a distance along the line, and the (2,) unit direction to the point ``length_m`` further on."""
        positions, along = self.chords(np.array([start_m]), length_m)
        return positions[0], along[0]

    def chords(self, start_m: Float64Array, length_m: float) -> tuple[Float64Array, Float64Array]:
        """(N, 2) points and (N, 2) unit directions as in ``chord``, at (N,) distances."""
        distances_m = np.concatenate([start_m, start_m + length_m])
        positions, ends = np.split(shapely.get_coordinates(shapely.line_interpolate_point(self.line, distances_m)), 2)
        step = ends - positions
        return positions, step / np.maximum(np.hypot(step[:, 0], step[:, 1]), 1e-9)[:, None]

    def stations(self, spacing_m: float, from_m: float = 0.0) -> tuple[Float64Array, Float64Array]:
        """(N, 2) points along the line at a spacing, and the (N, 2) unit directions there."""
        distances_m = np.arange(from_m, self.length_m - 1.0, spacing_m)
        positions = shapely.get_coordinates(shapely.line_interpolate_point(self.line, distances_m))
        onward = shapely.get_coordinates(shapely.line_interpolate_point(self.line, distances_m + 1.0))
        return positions, onward - positions


@dataclass(frozen=True, slots=True)
class Block:
    """Land of one use, enclosed by streets, water, other uses or the region's border.

    Attributes:
        land: Area of the block, map frame, meters.
        recipe: Recipe of what is built and planted there.
        frontage: Lines along streets that buildings may front.
    """

    land: shapely.Polygon
    recipe: SurroundingsRecipe
    frontage: tuple[Frontage, ...]

    @property
    def is_island(self) -> bool:
        """Whether the block is small and without sidewalks, such as the middle of a roundabout."""
        return self.land.area < _MAX_ISLAND_M2 and not any(line.walk for line in self.frontage)

    @property
    def name(self) -> str:
        """Name of the block, derived from its position, so that it does not depend on other blocks."""
        x_m, y_m = self.land.representative_point().coords[0]
        return f"block.{x_m:.1f}.{y_m:.1f}"


def zones_of(ground: RegionGround) -> Zones:
    """Intersect the map's zones with a region; where zones overlap, the last one applies."""
    rest: BaseGeometry = ground.region.area
    found = []
    for zone in reversed(ground.network.features.zones):
        if rest.is_empty or not zone.area.intersects(rest):
            continue
        found.append((zone.surroundings, multi_polygon(overlay.intersection(rest, zone.area))))
        rest = multi_polygon(overlay.difference(rest, zone.area))
    return [*found, (ground.network.features.surroundings, rest)]


def fast_roads(ground: RegionGround) -> BaseGeometry:
    """Area of motorways around a region, bridges included, with the land beside them that is kept free of buildings."""
    strips = ground.network.layout.near(ground.region.area, MARGIN_M).strips_of(LaneKind.DRIVING)
    abreast: dict[tuple[str, int, bool], set[int]] = {}
    for strip in strips:
        abreast.setdefault(_carriageway(strip), set()).add(strip.index)
    lines = [
        shapely.LineString(strip.center_m[:, :2])
        for strip in strips
        if strip.speed_mps > _FAST_MPS and len(abreast[_carriageway(strip)]) > 1
    ]
    return shapely.buffer(overlay.union_all(lines), _FAST_M, quad_segs=4)


def blocks_of(ground: RegionGround, zones: Zones, fast: BaseGeometry) -> tuple[Block, ...]:
    """Divide a region into blocks, sorted from west to east.

    Args:
        ground: Ground of the region.
        zones: Zones of the region, from ``zones_of``.
        fast: Motorways around the region, from ``fast_roads``.
    """
    around = shapely.buffer(ground.region.area, _BEYOND_M, join_style="mitre")
    wide = overlay.difference(around, overlay.union_all([ground.streets[0].area, *(w.area for w in ground.water)]))
    open_lands = [shapely.orient_polygons(part) for part in shapely.get_parts(wide) if part.area > _MIN_AREA_M2]
    lines = [_frontage(land, ground, fast) for land in open_lands]
    blocks = []
    tree = shapely.STRtree(open_lands)
    for recipe, area in zones:
        parts = shapely.get_parts(overlay.intersection(ground.land, area, grid_size=0.001))
        for part in parts[shapely.area(parts) > _MIN_PART_M2]:
            around_it = tree.query(part.representative_point(), predicate="within")
            own = lines[around_it[0]] if len(around_it) and part.area > _MIN_AREA_M2 else ()
            blocks.append(
                Block(shapely.orient_polygons(part), recipe, _preferred_frontage(_clip_frontage(own, part, ground)))
            )
    return tuple(sorted(blocks, key=lambda block: block.land.representative_point().coords[0]))


def _carriageway(strip: Strip) -> tuple[str, int, bool]:
    """Key of a carriageway: lanes with equal keys run side by side in the same direction."""
    return strip.road, strip.section, strip.index > 0


def _frontage(land: shapely.Polygon, ground: RegionGround, fast: BaseGeometry) -> tuple[Frontage, ...]:
    """Lines of a piece of land along streets, except motorways."""
    street, walk = ground.streets[0].area, ground.streets[0].sidewalk
    for geometry in (street, walk, fast):
        shapely.prepare(geometry)
    lines: list[Frontage] = []
    for ring in (land.exterior, *land.interiors):
        corners = shapely.get_coordinates(ring.simplify(_STRAIGHT_M))
        starts, ends = corners[:-1], corners[1:]
        middles = shapely.points((starts + ends) / 2.0)
        fronts: BoolArray = np.asarray(shapely.dwithin(street, middles, _NEAR_M)) & ~shapely.intersects(fast, middles)
        fronts &= np.hypot(*(ends - starts).T) >= _MIN_CHORD_M
        walks: BoolArray = np.asarray(shapely.dwithin(walk, middles, _NEAR_M))
        lines += [Frontage(line, bool(walks[first])) for first, line in _chains(corners, fronts, walks)]
    return tuple(lines)


def _clip_frontage(lines: Sequence[Frontage], land: shapely.Polygon, ground: RegionGround) -> Iterator[Frontage]:
    """Sections of lines along a block, and those just beyond the region's border that only this block can front."""
    square = ground.region.area
    beside = shapely.buffer(land, _NEAR_M, quad_segs=2)
    touches = land.distance(square.exterior) < _NEAR_M
    opposite = overlay.difference(shapely.buffer(land, _BEYOND_M, quad_segs=2), square) if touches else shapely.Point()
    for line in lines:
        for reach, beyond in ((overlay.intersection(beside, square), False), (opposite, True)):
            stretch = shapely.line_merge(overlay.intersection(line.line, reach))
            for part in shapely.get_parts(stretch):
                if part.geom_type == "LineString" and part.length > _MIN_SIDE_M:
                    onward = line.line.project(shapely.Point(part.coords[0])) < line.line.project(
                        shapely.Point(part.coords[-1])
                    )
                    yield Frontage(part if onward else part.reverse(), line.walk, beyond)


def _preferred_frontage(lines: Iterable[Frontage]) -> tuple[Frontage, ...]:
    """Lines with sidewalks, or all lines if few have sidewalks."""
    every = tuple(lines)
    walks = tuple(line for line in every if line.walk)
    enough = sum(line.length_m for line in walks) > _WALK_SHARE * sum(line.length_m for line in every)
    return walks if enough else every


def _chains(corners: Float64Array, kept: BoolArray, walks: BoolArray) -> Iterator[tuple[int, shapely.LineString]]:
    """Runs of consecutive kept sides of a ring without a bend, each with the index of its first side."""
    heading = np.arctan2(*np.diff(corners, axis=0).T[::-1])
    run: list[int] = []
    for side in range(len(kept)):
        continues = bool(run) and _straight_on(heading[side] - heading[side - 1]) and walks[side] == walks[side - 1]
        if run and not (kept[side] and continues):
            yield run[0], shapely.LineString(corners[run[0] : run[-1] + 2])
            run = []
        if kept[side]:
            run.append(side)
    if run:
        yield run[0], shapely.LineString(corners[run[0] : run[-1] + 2])


def _straight_on(turn_rad: float) -> bool:
    return bool(abs((turn_rad + np.pi) % (2.0 * np.pi) - np.pi) < _BEND_RAD)
