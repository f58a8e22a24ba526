"""The ground of one region: its streets in plan, and how high everything lies."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from simbev_ros.assets.mesh.facets import TILE_M, Facets
from simbev_ros.maps.land.membrane import Raster, places_m
from simbev_ros.maps.land.terrain import NODE_M, Terrain
from simbev_ros.maps.land_features import Water
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.region import REGION_M, Region
from simbev_ros.maps.roads.surface import Surfaces, surfaces_of
from simbev_ros.random import stream
from simbev_ros.types import BoolArray, Float64Array

CURB_HEIGHT_M = 0.12
"""Sidewalks lie so much above the road."""
LAND_HEIGHT_M = 0.10
"""Lawns and yards lie so much above the road, a little below the sidewalks."""

DECK_DEPTH_M = 1.1
"""From the carriageway on a structure down to its underside."""
DECK_OVERHANG_M = 0.45
"""Structures reach so far beyond the streets that they carry."""

MARGIN_M = 64.0
"""So far around a region its streets are known, so that what is built beside them does not end at the border."""

_GRID_M = 0.001
_STREET_TOLERANCE_M, _LAND_TOLERANCE_M = 0.018, 0.05


@dataclass(frozen=True, slots=True)
class Streets(Surfaces):
    """The surfaces of one level, and the ``area`` of them all."""

    area: BaseGeometry


@dataclass(frozen=True)
class RegionGround:
    """What is built in a region stands on this. Its heights are those of the meshes, to the tolerance of the facets.

    Attributes:
        network: The roads of the map.
        region: The region.
        terrain: The land of the map.
        streets: By level, within ``MARGIN_M`` of the region.
        water: Water within that distance.
        facets: By level: the carriageway's plane as it is seen; level 0 is the land too. None: no street of the level.
    """

    network: RoadNetwork
    region: Region
    terrain: Terrain
    streets: tuple[Streets, ...]
    water: tuple[Water, ...]
    facets: tuple[Facets | None, ...]
    _land: Raster

    @classmethod
    def of(cls, network: RoadNetwork, region: Region, terrain: Terrain) -> "RegionGround":
        """The ground of a region; ``terrain`` is that of the network."""
        around = shapely.box(*shapely.buffer(region.area, MARGIN_M).bounds)
        streets = tuple(_streets(network, level, around) for level in network.layout.levels)
        water = tuple(water for water in network.features.water if water.area.intersects(around))
        low_m, high_m = (np.array(corner) for corner in (region.area.bounds[:2], region.area.bounds[2:]))
        patch = terrain.patch(low_m - TILE_M, high_m + TILE_M)
        if terrain.is_level:
            land = Facets.level(region)
        else:
            land = Facets.of(patch.heights, np.where(patch.street, _STREET_TOLERANCE_M, _LAND_TOLERANCE_M))
        decks = [
            _deck_facets(terrain, patch.heights, level) if street.area.intersects(region.area) else None
            for level, street in enumerate(streets[1:], start=1)
        ]
        return cls(network, region, terrain, streets, water, (land, *decks), patch.heights)

    @cached_property
    def land(self) -> BaseGeometry:
        """What is neither street on the ground nor water, in plan, within the region."""
        taken = [self.streets[0].area, *(water.area for water in self.water)]
        return _polygons(shapely.difference(self.region.area, shapely.union_all(taken), grid_size=_GRID_M))

    def within(self, area: BaseGeometry) -> shapely.MultiPolygon:
        """The part of an area that lies in the region."""
        return _polygons(shapely.intersection(area, self.region.area))

    @property
    def land_facets(self) -> Facets:
        """Those of level 0."""
        facets = self.facets[0]
        assert facets is not None
        return facets

    @cached_property
    def decks(self) -> tuple[BaseGeometry, ...]:
        """What structures of each level cover in plan; empty on level 0."""
        areas = [streets.area for streets in self.streets[1:]]
        return (shapely.Polygon(), *(shapely.buffer(area, DECK_OVERHANG_M, join_style="mitre") for area in areas))

    def soffit_m(self, xy_m: Float64Array) -> Float64Array:
        """(N,) height of the underside of the lowest structure above (N, 2) points, infinite where there is none."""
        lowest_m = np.full(len(xy_m), np.inf)
        for level, deck in enumerate(self.decks):
            below = shapely.dwithin(deck, shapely.points(xy_m), DECK_OVERHANG_M)
            if below.any():
                lowest_m[below] = np.minimum(lowest_m[below], self.road_m(xy_m[below], level) - DECK_DEPTH_M)
        return lowest_m

    def stream(self, name: str) -> np.random.Generator:
        """Random numbers of this region and purpose alone."""
        return stream(self.network.seed, f"{name}.{self.region.column}.{self.region.row}")

    def owns(self, xy_m: Float64Array) -> BoolArray:
        """(N,) which of (N, 2) places belong to this region and to no other."""
        owned: BoolArray = (np.floor(np.asarray(xy_m) / REGION_M) == self.region).all(axis=-1)
        return owned

    def land_m(self, xy_m: Float64Array) -> Float64Array:
        """(N,) height of lawns and yards at (N, 2) points of the map frame, in or near the region."""
        return self._land.linear(xy_m) + LAND_HEIGHT_M

    def land_raster(self, low_m: Float64Array, high_m: Float64Array) -> Raster:
        """``land_m`` around what lies between two (2,) corners."""
        spacing_m = self._land.spacing_m
        first, last = ((corner_m - self._land.origin_m) / spacing_m for corner_m in (low_m, high_m))
        (i, j), (east, north) = np.floor(first).astype(int), np.ceil(last).astype(int) + 1
        origin_m = self._land.origin_m + np.array([i, j]) * spacing_m
        return Raster(origin_m, spacing_m, self._land.values[i:east, j:north] + LAND_HEIGHT_M)

    def sidewalk_m(self, xy_m: Float64Array, level: int = 0) -> Float64Array:
        """(N,) height of sidewalks."""
        return self.road_m(xy_m, level) + CURB_HEIGHT_M

    def road_m(self, xy_m: Float64Array, level: int = 0) -> Float64Array:
        """(N,) height of the carriageway's plane of a level."""
        return self.terrain.elevation.height_m(xy_m, level)


def _streets(network: RoadNetwork, level: int, around: shapely.Polygon) -> Streets:
    """The streets of a level in a rectangle."""
    parts = surfaces_of(network.layout, level, around)
    area = shapely.union_all([parts.road, parts.shoulder, parts.median, parts.sidewalk], grid_size=_GRID_M)
    return Streets(parts.road, parts.shoulder, parts.sidewalk, parts.median, parts.crosswalk, area)


def _deck_facets(terrain: Terrain, like: Raster, level: int) -> Facets:
    """The plane of a level's carriageway at the places of another raster's nodes."""
    xy_m = places_m(like.origin_m, NODE_M, like.values.shape)
    height_m = terrain.elevation.height_m(xy_m.reshape(-1, 2), level).reshape(like.values.shape)
    return Facets.of(Raster(like.origin_m, NODE_M, height_m), np.full(like.values.shape, _STREET_TOLERANCE_M))


def _polygons(area: BaseGeometry) -> shapely.MultiPolygon:
    """Its two-dimensional parts: what only touches a region or another area meets it in points and lines."""
    parts = shapely.get_parts(area)
    return shapely.MultiPolygon(parts[shapely.get_type_id(parts) == shapely.GeometryType.POLYGON].tolist())
