"""Divides the land of a region into blocks: one use each, with the lines along which they front streets."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from simbev_ros.assets.placement.region_ground import MARGIN_M, RegionGround
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.layout import Strip
from simbev_ros.maps.surroundings import SurroundingsRecipe
from simbev_ros.types import BoolArray, Float64Array

_SPECK_M2, _SMALLEST_M2 = 0.01, 40.0
_STRAIGHT_M, _SHORTEST_SIDE_M = 0.35, 6.0
_BEND_RAD = np.radians(22.0)
_NEAR_M = 0.7
_FAST_MPS, _FAST_M = 22.3, 22.0
_WALK_SHARE = 0.2
_BEYOND_M = 14.0
_LARGEST_ISLAND_M2 = 8000.0

Zones = Sequence[tuple[SurroundingsRecipe, BaseGeometry]]
"""Characters of the land and where they hold, together the whole region."""


@dataclass(frozen=True, slots=True)
class Frontage:
    """A line along a street, without corners, the land to its left.

    Attributes:
        line: Map frame, metres.
        walk: Whether the street has a sidewalk here.
        beyond: Whether it lies across the region's border, but so close that only this side has room for buildings.
    """

    line: shapely.LineString
    walk: bool
    beyond: bool = False

    @property
    def length_m(self) -> float:
        """Of the line."""
        return float(self.line.length)

    def chord(self, start_m: float, length_m: float) -> tuple[Float64Array, Float64Array]:
        """(2,) place at a distance along the line, and the (2,) unit direction to the place ``length_m`` farther on."""
        places, along = self.chords(np.array([start_m]), length_m)
        return places[0], along[0]

    def chords(self, start_m: Float64Array, length_m: float) -> tuple[Float64Array, Float64Array]:
        """As ``chord``, of (N,) distances."""
        at_m = np.concatenate([start_m, start_m + length_m])
        places, ends = np.split(shapely.get_coordinates(shapely.line_interpolate_point(self.line, at_m)), 2)
        step = ends - places
        return places, step / np.maximum(np.hypot(step[:, 0], step[:, 1]), 1e-9)[:, None]

    def stations(self, spacing_m: float, from_m: float = 0.0) -> tuple[Float64Array, Float64Array]:
        """(N, 2) places a spacing apart, and the (N, 2) unit directions there."""
        at_m = np.arange(from_m, self.length_m - 1.0, spacing_m)
        places = shapely.get_coordinates(shapely.line_interpolate_point(self.line, at_m))
        onward = shapely.get_coordinates(shapely.line_interpolate_point(self.line, at_m + 1.0))
        return places, onward - places


@dataclass(frozen=True, slots=True)
class Block:
    """Land of one use that streets, water, other uses or the region's border enclose.

    Attributes:
        land: Map frame, metres.
        recipe: What stands on it.
        frontage: Where it fronts streets that buildings may stand along.
    """

    land: shapely.Polygon
    recipe: SurroundingsRecipe
    frontage: tuple[Frontage, ...]

    @property
    def is_island(self) -> bool:
        """Whether it is a small piece of land amid streets that nobody walks to, such as the middle of a roundabout."""
        return self.land.area < _LARGEST_ISLAND_M2 and not any(line.walk for line in self.frontage)

    @property
    def name(self) -> str:
        """The same block has the same name whatever others there are."""
        x_m, y_m = self.land.representative_point().coords[0]
        return f"block.{x_m:.1f}.{y_m:.1f}"


def left_of(direction: Float64Array) -> Float64Array:
    """(…, 2) vectors turned by a right angle to the left."""
    turned: Float64Array = direction[..., ::-1] * np.array([-1.0, 1.0])
    return turned


def zones_of(ground: RegionGround) -> Zones:
    """The zones' parts of a region; where zones overlap, the last one holds."""
    rest: BaseGeometry = ground.region.area
    found = []
    for zone in reversed(ground.network.features.zones):
        if rest.is_empty or not zone.area.intersects(rest):
            continue
        found.append((zone.surroundings, _polygons(shapely.intersection(rest, zone.area))))
        rest = _polygons(shapely.difference(rest, zone.area))
    return [*found, (ground.network.features.surroundings, rest)]


def _polygons(area: BaseGeometry) -> shapely.MultiPolygon:
    """Its two-dimensional parts: areas that share a border also meet in lines."""
    parts = shapely.get_parts(area)
    return shapely.MultiPolygon(list(parts[shapely.get_type_id(parts) == shapely.GeometryType.POLYGON]))


def fast_roads(ground: RegionGround) -> BaseGeometry:
    """Motorways around a region, bridges included, with the land beside them that nobody builds on."""
    strips = ground.network.layout.near(ground.region.area, MARGIN_M).strips_of(LaneKind.DRIVING)
    abreast: dict[tuple[str, int, bool], set[int]] = {}
    for strip in strips:
        abreast.setdefault(_carriageway(strip), set()).add(strip.index)
    lines = [
        shapely.LineString(strip.center_m[:, :2])
        for strip in strips
        if strip.speed_mps > _FAST_MPS and len(abreast[_carriageway(strip)]) > 1
    ]
    return shapely.buffer(shapely.union_all(lines), _FAST_M, quad_segs=4)


def blocks_of(ground: RegionGround, zones: Zones, fast: BaseGeometry) -> tuple[Block, ...]:
    """All blocks of a region, from west to east.

    Args:
        ground: The region.
        zones: ``zones_of`` it.
        fast: ``fast_roads`` around it.
    """
    around = shapely.buffer(ground.region.area, _BEYOND_M, join_style="mitre")
    wide = shapely.difference(around, shapely.union_all([ground.streets[0].area, *(w.area for w in ground.water)]))
    open_lands = [shapely.orient_polygons(part) for part in shapely.get_parts(wide) if part.area > _SMALLEST_M2]
    lines = [_frontage(land, ground, fast) for land in open_lands]
    blocks = []
    tree = shapely.STRtree(open_lands)
    for recipe, area in zones:
        parts = shapely.get_parts(shapely.intersection(ground.land, area, grid_size=0.001))
        for part in parts[shapely.area(parts) > _SPECK_M2]:
            around_it = tree.query(part.representative_point(), predicate="within")
            own = lines[around_it[0]] if len(around_it) and part.area > _SMALLEST_M2 else ()
            blocks.append(Block(shapely.orient_polygons(part), recipe, _usual(_clipped(own, part, ground))))
    return tuple(sorted(blocks, key=lambda block: block.land.representative_point().coords[0]))


def _carriageway(strip: Strip) -> tuple[str, int, bool]:
    """Lanes with the same one run side by side in one direction."""
    return strip.road, strip.section, strip.index > 0


def _frontage(land: shapely.Polygon, ground: RegionGround, fast: BaseGeometry) -> tuple[Frontage, ...]:
    """Lines of a piece of land along streets that are no motorways."""
    street, walk = ground.streets[0].area, ground.streets[0].sidewalk
    for geometry in (street, walk, fast):
        shapely.prepare(geometry)
    lines: list[Frontage] = []
    for ring in (land.exterior, *land.interiors):
        corners = shapely.get_coordinates(ring.simplify(_STRAIGHT_M))
        starts, ends = corners[:-1], corners[1:]
        middles = shapely.points((starts + ends) / 2.0)
        fronts: BoolArray = np.asarray(shapely.dwithin(street, middles, _NEAR_M)) & ~shapely.intersects(fast, middles)
        fronts &= np.hypot(*(ends - starts).T) >= _SHORTEST_SIDE_M
        walks: BoolArray = np.asarray(shapely.dwithin(walk, middles, _NEAR_M))
        lines += [Frontage(line, bool(walks[first])) for first, line in _chains(corners, fronts, walks)]
    return tuple(lines)


def _clipped(lines: Sequence[Frontage], land: shapely.Polygon, ground: RegionGround) -> Iterator[Frontage]:
    """The stretches of lines along a block, and those just beyond the region's border that only it can front."""
    square = ground.region.area
    beside = shapely.buffer(land, _NEAR_M, quad_segs=2)
    touches = land.distance(square.exterior) < _NEAR_M
    opposite = shapely.difference(shapely.buffer(land, _BEYOND_M, quad_segs=2), square) if touches else shapely.Point()
    for line in lines:
        for reach, beyond in ((shapely.intersection(beside, square), False), (opposite, True)):
            stretch = shapely.line_merge(shapely.intersection(line.line, reach))
            for part in shapely.get_parts(stretch):
                if part.geom_type == "LineString" and part.length > _SHORTEST_SIDE_M:
                    onward = line.line.project(shapely.Point(part.coords[0])) < line.line.project(
                        shapely.Point(part.coords[-1])
                    )
                    yield Frontage(part if onward else part.reverse(), line.walk, beyond)


def _usual(lines: Iterable[Frontage]) -> tuple[Frontage, ...]:
    """Those with sidewalks, or all where there are hardly any."""
    every = tuple(lines)
    walks = tuple(line for line in every if line.walk)
    enough = sum(line.length_m for line in walks) > _WALK_SHARE * sum(line.length_m for line in every)
    return walks if enough else every


def _chains(corners: Float64Array, kept: BoolArray, walks: BoolArray) -> Iterator[tuple[int, shapely.LineString]]:
    """Runs of a ring's kept sides that follow each other without a bend, each with the number of its first side."""
    heading = np.arctan2(*np.diff(corners, axis=0).T[::-1])
    run: list[int] = []
    for side in range(len(kept)):
        goes_on = bool(run) and _straight_on(heading[side] - heading[side - 1]) and walks[side] == walks[side - 1]
        if run and not (kept[side] and goes_on):
            yield run[0], shapely.LineString(corners[run[0] : run[-1] + 2])
            run = []
        if kept[side]:
            run.append(side)
    if run:
        yield run[0], shapely.LineString(corners[run[0] : run[-1] + 2])


def _straight_on(turn_rad: float) -> bool:
    return bool(abs((turn_rad + np.pi) % (2.0 * np.pi) - np.pi) < _BEND_RAD)
