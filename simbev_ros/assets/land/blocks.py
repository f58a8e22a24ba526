"""Divides the land of a region into blocks: one use each, with the lines along which they front streets."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from simbev_ros.assets.region_ground import MARGIN_M, RegionGround
from simbev_ros.maps.lane_kind import LaneKind
from simbev_ros.maps.layout import Strip
from simbev_ros.maps.surroundings import SurroundingsRecipe
from simbev_ros.types import BoolArray, Float64Array

_SMALLEST_M2 = 40.0
_STRAIGHT_M, _SHORTEST_SIDE_M = 0.35, 6.0
_BEND_RAD = np.radians(22.0)
_NEAR_M = 0.7
_FAST_MPS, _FAST_M = 22.3, 22.0
_WALK_SHARE = 0.2


@dataclass(frozen=True, slots=True)
class Frontage:
    """A line along a street, without corners, the land to its left.

    Attributes:
        line: Map frame, metres.
        walk: Whether the street has a sidewalk here.
    """

    line: shapely.LineString
    walk: bool

    @property
    def length_m(self) -> float:
        """Of the line."""
        return float(self.line.length)

    def chord(self, start_m: float, length_m: float) -> tuple[Float64Array, Float64Array]:
        """(2,) place at a distance along the line, and the (2,) unit direction to the place ``length_m`` farther on."""
        ends = shapely.get_coordinates(shapely.line_interpolate_point(self.line, [start_m, start_m + length_m]))
        step = ends[1] - ends[0]
        return ends[0], step / max(float(np.hypot(*step)), 1e-9)

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
    def name(self) -> str:
        """The same block has the same name whatever others there are."""
        x_m, y_m = self.land.representative_point().coords[0]
        return f"block.{x_m:.1f}.{y_m:.1f}"


def left_of(direction: Float64Array) -> Float64Array:
    """(…, 2) vectors turned by a right angle to the left."""
    return np.stack([-direction[..., 1], direction[..., 0]], axis=-1)


def zones_of(ground: RegionGround) -> list[tuple[SurroundingsRecipe, BaseGeometry]]:
    """The zones' parts of a region; where zones overlap, the last one holds."""
    rest: BaseGeometry = ground.region.area
    found = []
    for zone in reversed(ground.network.features.zones):
        if rest.is_empty or not zone.area.intersects(rest):
            continue
        found.append((zone.surroundings, shapely.intersection(rest, zone.area)))
        rest = shapely.difference(rest, zone.area)
    return [*found, (ground.network.features.surroundings, rest)]


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


def blocks_of(ground: RegionGround) -> tuple[Block, ...]:
    """All blocks of a region, from west to east."""
    fast = fast_roads(ground)
    street, walk = ground.streets[0].area, ground.streets[0].sidewalk
    for geometry in (street, walk, fast):
        shapely.prepare(geometry)
    blocks = []
    for recipe, area in zones_of(ground):
        parts = shapely.get_parts(shapely.intersection(ground.land, area, grid_size=0.001))
        for part in parts[shapely.get_type_id(parts) == shapely.GeometryType.POLYGON]:
            land = shapely.orient_polygons(part)
            frontage = _frontage(land, ground, (street, walk, fast)) if land.area > _SMALLEST_M2 else ()
            blocks.append(Block(land, recipe, frontage))
    return tuple(sorted(blocks, key=lambda block: block.land.representative_point().coords[0]))


def _carriageway(strip: Strip) -> tuple[str, int, bool]:
    """Lanes with the same one run side by side in one direction."""
    return strip.road, strip.section, strip.index > 0


def _frontage(
    land: shapely.Polygon, ground: RegionGround, nearby: tuple[BaseGeometry, BaseGeometry, BaseGeometry]
) -> tuple[Frontage, ...]:
    """Lines along streets: those with sidewalks, or all where there are hardly any."""
    street, walk, fast = nearby
    lines: list[Frontage] = []
    border = ground.region.area.exterior
    for ring in (land.exterior, *land.interiors):
        corners = shapely.get_coordinates(ring.simplify(_STRAIGHT_M))
        starts, ends = corners[:-1], corners[1:]
        middles = shapely.points((starts + ends) / 2.0)
        fronts: BoolArray = np.asarray(shapely.dwithin(street, middles, _NEAR_M)) & ~shapely.intersects(fast, middles)
        fronts &= shapely.distance(border, middles) > _NEAR_M
        fronts &= np.hypot(*(ends - starts).T) >= _SHORTEST_SIDE_M
        walks: BoolArray = np.asarray(shapely.dwithin(walk, middles, _NEAR_M))
        lines += [Frontage(line, bool(walks[first])) for first, line in _chains(corners, fronts, walks)]
    walk_m = sum(line.length_m for line in lines if line.walk)
    if walk_m > _WALK_SHARE * sum(line.length_m for line in lines):
        lines = [line for line in lines if line.walk]
    return tuple(lines)


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
