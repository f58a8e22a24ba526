"""The town in plan: streets from the road network, the land between them, and what each block is for."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from itertools import pairwise

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from simbev_ros.assets.ground import GroundPlan, tile_aligned
from simbev_ros.errors import SimbevError
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.surface import crosswalk_polygons, road_surface, sidewalk_surface
from simbev_ros.maps.surroundings import SurroundingsRecipe
from simbev_ros.random import stream
from simbev_ros.types import Float64Array

_OUTSKIRTS_M = 110.0
_PARK_SHARE = 0.13
_YARD_DEPTH_M = 27.0
_SPECK_M2 = 1.0
_LARGEST_SLOPE_M = 0.05


class BlockUse(Enum):
    """What a block is for."""

    DOWNTOWN = "downtown"
    RESIDENTIAL = "residential"
    PARK = "park"
    OUTSKIRTS = "outskirts"


@dataclass(frozen=True, slots=True)
class Block:
    """Land that streets enclose, or the land around the town.

    Attributes:
        land: Map frame, metres.
        use: What it is for.
        frontage: Its rings along streets, the land to their left.
    """

    land: shapely.Polygon
    use: BlockUse
    frontage: tuple[shapely.LinearRing, ...]

    @property
    def lawn(self) -> BaseGeometry:
        """The green part of the land; downtown only courtyards are."""
        return self.land.buffer(-_YARD_DEPTH_M) if self.use is BlockUse.DOWNTOWN else self.land


@dataclass(frozen=True, slots=True)
class TownPlan:
    """The town in plan, map frame, metres."""

    road: shapely.MultiPolygon
    sidewalk: shapely.MultiPolygon
    crossings: tuple[shapely.Polygon, ...]
    blocks: tuple[Block, ...]

    @property
    def ground(self) -> GroundPlan:
        """What covers the ground."""
        lawn = shapely.union_all([block.lawn for block in self.blocks])
        yard = shapely.union_all([block.land.difference(block.lawn) for block in self.blocks])
        return GroundPlan(self.road, self.sidewalk, lawn, yard)


@dataclass(frozen=True, slots=True)
class FrontSide:
    """A straight piece of a block's frontage: (2,) start and unit direction; the land is to its left."""

    start_m: Float64Array
    direction: Float64Array
    length_m: float

    @property
    def inward(self) -> Float64Array:
        """(2,) unit vector away from the street."""
        return np.array([-self.direction[1], self.direction[0]])

    @property
    def yaw_rad(self) -> float:
        """Of its direction."""
        return float(np.arctan2(self.direction[1], self.direction[0]))


def plan_town(network: RoadNetwork, recipe: SurroundingsRecipe, seed: int) -> TownPlan:
    """Divide the land.

    Raises:
        SimbevError: The map is not level.
    """
    heights_m = np.concatenate([lane.centerline_m[:, 2] for lane in network.lanes.values()])
    if np.abs(heights_m).max() > _LARGEST_SLOPE_M:
        raise SimbevError(f"map {network.name}: surroundings can only be built on level ground at height 0")
    road = road_surface(network.layout)
    sidewalk = sidewalk_surface(network.layout)
    streets = shapely.union_all([road, sidewalk])
    area = tile_aligned(np.asarray(streets.bounds), _OUTSKIRTS_M)
    lands = [part for part in shapely.get_parts(area.difference(streets)) if part.area > _SPECK_M2]
    lands.sort(key=lambda land: land.centroid.coords[0])
    blocks = _with_parks([_block(land, area, recipe) for land in lands], stream(seed, "surroundings.parks"))
    return TownPlan(road, sidewalk, tuple(crosswalk_polygons(network.layout.crosswalks)), blocks)


def front_sides(block: Block, shortest_m: float) -> Iterator[FrontSide]:
    """The pieces of a block's frontage that are straight for at least a length, in the order of its rings."""
    for ring in block.frontage:
        corners = np.asarray(ring.simplify(0.35).coords)[:, :2]
        for start, end in pairwise(corners):
            length_m = float(np.linalg.norm(end - start))
            if length_m >= shortest_m:
                yield FrontSide(start, (end - start) / length_m, length_m)


def _block(land: shapely.Polygon, area: shapely.Polygon, recipe: SurroundingsRecipe) -> Block:
    land = shapely.orient_polygons(land)
    if land.exterior.distance(area.exterior) < 1.0:
        return Block(land, BlockUse.OUTSKIRTS, tuple(land.interiors))
    use = BlockUse.DOWNTOWN if recipe.use == "downtown" else BlockUse.RESIDENTIAL
    return Block(land, use, (land.exterior,))


def _with_parks(blocks: Sequence[Block], rng: np.random.Generator) -> tuple[Block, ...]:
    """The blocks, some of the residential ones made parks; at least one if there is one."""
    eligible = [k for k, block in enumerate(blocks) if block.use is BlockUse.RESIDENTIAL]
    count = math.ceil(_PARK_SHARE * len(eligible))
    parks = set(rng.permutation(eligible)[:count].tolist())
    return tuple(replace(block, use=BlockUse.PARK) if k in parks else block for k, block in enumerate(blocks))
