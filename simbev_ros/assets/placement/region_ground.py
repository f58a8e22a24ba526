"""Ground of one region, the base of everything built there: streets, land and water in plan, and their heights."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from simbev_ros.assets.mesh.facets import TILE_M, Facets
from simbev_ros.config.weather import Season
from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.geometry.plan_view import multi_polygon
from simbev_ros.foundation.random import stream
from simbev_ros.foundation.types import BoolArray, Float64Array
from simbev_ros.maps.land.membrane import Raster, node_positions_m
from simbev_ros.maps.land.terrain import NODE_M, Terrain
from simbev_ros.maps.land_features import Water
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.region import REGION_M, Region
from simbev_ros.maps.roads.lane_kind import CURB_HEIGHT_M
from simbev_ros.maps.roads.raised_lanes import RaisedLanes
from simbev_ros.maps.roads.surface import Surfaces, surfaces_of
from simbev_ros.maps.roads.tunnels import ROOF_M, WALL_M

LAND_HEIGHT_M = 0.10
"""Height of lawns and yards above the road, a little below the sidewalks."""

DECK_DEPTH_M = 1.1
"""Depth of a structure from its carriageway down to its underside."""
DECK_OVERHANG_M = 0.45
"""Width by which structures extend beyond the streets that they carry."""

MARGIN_M = 64.0
"""Distance around a region up to which streets are known, so that objects beside them do not end at the border."""

_GRID_M = 0.001
_STREET_TOLERANCE_M, _LAND_TOLERANCE_M = 0.018, 0.05


@dataclass(frozen=True, slots=True)
class Streets(Surfaces):
    """Street surfaces of one level.

    Attributes:
        area: The union of them all.
        raised: Sidewalks and medians.
    """

    area: BaseGeometry
    raised: BaseGeometry


@dataclass(frozen=True)
class RegionGround:
    """Ground that everything in a region is built on. Its heights equal those of the meshes, within facet tolerance.

    Attributes:
        network: Roads of the map.
        region: The region.
        terrain: Terrain of the map.
        streets: Streets by level, within ``MARGIN_M`` of the region.
        water: Water within that distance.
        facets: Facets by level, of the carriageway's surface as rendered; those of level 0 include the land. None for
            a level without streets in the region.
        season: Season of plants and ground.
    """

    network: RoadNetwork
    region: Region
    terrain: Terrain
    streets: tuple[Streets, ...]
    water: tuple[Water, ...]
    facets: tuple[Facets | None, ...]
    _land: Raster
    season: Season = "summer"

    @classmethod
    def from_network(
        cls, network: RoadNetwork, region: Region, terrain: Terrain, season: Season = "summer"
    ) -> "RegionGround":
        """Create the ground of a region from the map's roads and terrain, in a season."""
        around = shapely.box(*shapely.buffer(region.area, MARGIN_M).bounds)
        streets = tuple(_streets(network, level, around) for level in network.layout.levels)
        water = tuple(water for water in network.features.water if water.area.intersects(around))
        low_m, high_m = (np.array(corner) for corner in (region.area.bounds[:2], region.area.bounds[2:]))
        patch = terrain.patch(low_m - TILE_M, high_m + TILE_M)
        if terrain.is_level:
            land = Facets.from_level_region(region)
        else:
            land = Facets.from_raster(patch.heights, np.where(patch.street, _STREET_TOLERANCE_M, _LAND_TOLERANCE_M))
        decks = [
            _deck_facets(terrain, patch.heights, level) if street.area.intersects(region.area) else None
            for level, street in enumerate(streets[1:], start=1)
        ]
        return cls(network, region, terrain, streets, water, (land, *decks), patch.heights, season)

    @cached_property
    def land(self) -> BaseGeometry:
        """Land of the region in plan: everything but streets on the ground and water."""
        taken = [self.streets[0].area, *(water.area for water in self.water)]
        return multi_polygon(overlay.difference(self.region.area, overlay.union_all(taken), grid_size=_GRID_M))

    def within(self, area: BaseGeometry) -> shapely.MultiPolygon:
        """Part of an area that lies in the region."""
        return multi_polygon(overlay.intersection(area, self.region.area))

    @property
    def land_facets(self) -> Facets:
        """Facets of level 0, the land and the streets on the ground."""
        facets = self.facets[0]
        assert facets is not None
        return facets

    @cached_property
    def decks(self) -> tuple[BaseGeometry, ...]:
        """Area of the structures of each level in plan; empty for the ground and for tunnels."""
        carried = range(1, self.network.layout.tunnel_levels.start)
        areas = [streets.area if level in carried else shapely.Polygon() for level, streets in enumerate(self.streets)]
        return tuple(shapely.buffer(area, DECK_OVERHANG_M, join_style="mitre") for area in areas)

    def soffit_m(self, xy_m: Float64Array) -> Float64Array:
        """(N,) height of the underside of the lowest structure above (N, 2) points; infinite where there is none."""
        lowest_m = np.full(len(xy_m), np.inf)
        for level, deck in enumerate(self.decks):
            below = shapely.dwithin(deck, shapely.points(xy_m), DECK_OVERHANG_M)
            if below.any():
                lowest_m[below] = np.minimum(lowest_m[below], self.road_m(xy_m[below], level) - DECK_DEPTH_M)
        return lowest_m

    @cached_property
    def raised(self) -> tuple[RaisedLanes, ...]:
        """Lanes that the map raises, by level, near the region."""
        near = self.network.layout.near(self.region.area, MARGIN_M)
        return tuple(RaisedLanes.of_level(near, level) for level in self.network.layout.levels)

    def at_plane(self, area: BaseGeometry, level: int) -> shapely.MultiPolygon:
        """Part of an area of streets that lies in the region, without lanes that the map raises."""
        lanes = self.raised[level]
        return self.within(overlay.difference(area, lanes.area, grid_size=_GRID_M) if lanes else area)

    @cached_property
    def tubes(self) -> tuple[BaseGeometry, ...]:
        """Area of the tunnels of each level in plan, with their walls; empty for all other levels."""
        tunnels = self.network.layout.tunnel_levels
        areas = [streets.area if level in tunnels else shapely.Polygon() for level, streets in enumerate(self.streets)]
        return tuple(shapely.buffer(area, WALL_M, join_style="mitre") for area in areas)

    def roof_m(self, xy_m: Float64Array) -> Float64Array:
        """(N,) height of the top of the highest tunnel at (N, 2) points; minus infinity where there is none."""
        highest_m = np.full(len(xy_m), -np.inf)
        for level, tube in enumerate(self.tubes):
            within = shapely.dwithin(tube, shapely.points(xy_m), _GRID_M)
            if within.any():
                highest_m[within] = np.maximum(highest_m[within], self.road_m(xy_m[within], level) + ROOF_M)
        return highest_m

    def stream(self, name: str) -> np.random.Generator:
        """Random generator for one purpose in this region."""
        return stream(self.network.seed, f"{name}.{self.region.column}.{self.region.row}")

    def owns(self, xy_m: Float64Array) -> BoolArray:
        """(N,) whether (N, 2) points belong to this region; every point belongs to exactly one."""
        return (np.floor(np.asarray(xy_m) / REGION_M) == self.region).all(axis=-1)

    def land_m(self, xy_m: Float64Array) -> Float64Array:
        """(N,) height of lawns and yards at (N, 2) points of the map frame, in or near the region."""
        return self._land.linear(xy_m) + LAND_HEIGHT_M

    def land_raster(self, low_m: Float64Array, high_m: Float64Array) -> Raster:
        """Raster of ``land_m`` that covers the rectangle between two (2,) corners."""
        spacing_m = self._land.spacing_m
        first, last = ((corner_m - self._land.origin_m) / spacing_m for corner_m in (low_m, high_m))
        (i, j), (east, north) = np.floor(first).astype(int), np.ceil(last).astype(int) + 1
        origin_m = self._land.origin_m + np.array([i, j]) * spacing_m
        return Raster(origin_m, spacing_m, self._land.values[i:east, j:north] + LAND_HEIGHT_M)

    def sidewalk_m(self, xy_m: Float64Array) -> Float64Array:
        """(N,) height of sidewalks at (N, 2) points of the map frame."""
        rise_m = self.raised[0].rise_m(xy_m)
        return self.road_m(xy_m) + np.where(np.isnan(rise_m), CURB_HEIGHT_M, rise_m)

    def road_m(self, xy_m: Float64Array, level: int = 0) -> Float64Array:
        """(N,) height of the carriageway's surface of a level at (N, 2) points of the map frame."""
        return self.terrain.elevation.height_m(xy_m, level)


def _streets(network: RoadNetwork, level: int, around: shapely.Polygon) -> Streets:
    """Streets of a level in a rectangle."""
    parts = surfaces_of(network.layout, level, around)
    area = overlay.union_all([parts.road, parts.shoulder, parts.median, parts.sidewalk], grid_size=_GRID_M)
    raised = overlay.union(parts.sidewalk, parts.median)
    return Streets(parts.road, parts.shoulder, parts.sidewalk, parts.median, parts.crosswalk, area, raised)


def _deck_facets(terrain: Terrain, like: Raster, level: int) -> Facets:
    """Facets of a level's carriageway, on the nodes of another raster."""
    xy_m = node_positions_m(like.origin_m, NODE_M, like.values.shape)
    height_m = terrain.elevation.height_m(xy_m.reshape(-1, 2), level).reshape(like.values.shape)
    return Facets.from_raster(Raster(like.origin_m, NODE_M, height_m), np.full(like.values.shape, _STREET_TOLERANCE_M))
