"""Computes terrain heights: the roads' surface on and beside roads, blended into the relief away from them.

Two steps. First, a coarse raster of the whole map: it has the height of the roads where there are roads, a membrane
interpolates between them, and where there are hills the membrane fades into those. Second, ``Terrain.patch`` refines a
rectangle of it: nodes on and beside streets lie exactly in the plane of the carriageway, and a fixed number of
relaxation steps smooths the land around them. A node depends only on what lies within ``_REACH_M`` of it, so
overlapping patches agree to the bit.

Structures are ignored: beneath a bridge the land continues from one bank to the other. Tunnels are ignored too, except
that the land rises above their roofs where it would lie lower.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import shapely
from scipy.spatial import cKDTree

from simbev_ros.foundation.types import AnyArray, BoolArray, Float64Array, UInt8Array
from simbev_ros.maps.land.membrane import Raster, membrane, node_positions_m, relax
from simbev_ros.maps.land.relief import Relief
from simbev_ros.maps.land.shore import Shores
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.roads.elevation import Elevation
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.layout import Strip
from simbev_ros.maps.roads.surface import strip_polygons
from simbev_ros.maps.roads.tunnels import ROOF_M

NODE_M = 2.0
"""Spacing of a patch's nodes."""

_COARSE_M, _MARGIN_M = 8.0, 512.0
_FADE_M = (20.0, 220.0)  # between these distances from roads the land blends into the relief
_VERGE_M = 5.5  # distance from lanes up to which land lies in the street's plane; closes gaps in a street by 3 m
_LANE_EDGE_M = 3.6  # distance from lanes up to which nodes affect their facets: a node diagonal and most of a pixel
_PIXEL_M = 1.0
_RELAXED_M = 24.0  # distance from streets up to which the land is relaxed
_RELAXATION_STEPS = 32
_REACH_M = 112.0  # covers the relaxation steps, the slopes and the relaxed band
_MAX_SLOPE = 0.6  # gradient of embankments and cuttings
_CELL_M = 128.0
_COVERED_M = ROOF_M + 0.8  # height of the land above the carriageway in a tunnel


@dataclass(frozen=True, slots=True)
class Patch:
    """A rectangle of terrain.

    Attributes:
        heights: Heights at nodes ``NODE_M`` apart.
        street: (I, J) whether a node lies on lanes or close enough to affect their facets; its height is exactly in the
            plane of the carriageway.
    """

    heights: Raster
    street: BoolArray


class Terrain:
    """Terrain of one map, without the objects on it and the structures above it."""

    def __init__(self, network: RoadNetwork) -> None:
        """Prepare the terrain; takes seconds on the largest maps."""
        self.elevation = Elevation(network.layout)
        self._features = network.features
        self._relief = Relief.of(self._features.relief, network.seed)
        strips = network.layout.strips_of(*LaneKind, level=0)
        positions_m = _strip_positions(strips)
        roofs_m = _strip_positions([strip for strip in network.layout.strips if strip.tunnel])
        roofs_m[:, 2] += _COVERED_M
        self.is_level = not (
            positions_m[:, 2].any() or len(roofs_m) or self._features.relief.amplitude_m or self._features.water
        )
        if not self.is_level:
            self._shores = Shores(self._features.water)
            decks = [strip for strip in network.layout.strips if strip.level > 0 and not strip.tunnel]
            self._lanes = tuple(shapely.STRtree(strip_polygons(parts)) for parts in (strips, decks))
            self._above_relief = _above_relief(self._relief, positions_m, roofs_m)

    def height_m(self, xy_m: Float64Array) -> Float64Array:
        """(N,) terrain heights at (N, 2) points of the map frame, equal to those of patches."""
        xy_m = np.asarray(xy_m, np.float64)
        height_m = np.zeros(len(xy_m))
        cells, of_point = np.unique(np.floor(xy_m / _CELL_M), axis=0, return_inverse=True)
        for number, cell in enumerate(cells):
            here = of_point.reshape(-1) == number
            height_m[here] = self.patch(cell * _CELL_M, (cell + 1.0) * _CELL_M).heights.linear(xy_m[here])
        return height_m

    def far_m(self, xy_m: Float64Array) -> Float64Array:
        """(N,) approximate terrain heights at (N, 2) points, fast: for land that is seen only from a distance."""
        if self.is_level:
            return np.zeros(len(xy_m))
        return self._relief.height_m(xy_m) + self._above_relief.smooth(xy_m)

    def patch(self, low_m: Float64Array, high_m: Float64Array) -> Patch:
        """Compute the heights from (2,) ``low_m`` to ``high_m``, both multiples of ``NODE_M``."""
        low_m = np.asarray(low_m, np.float64)
        margin = round(_REACH_M / NODE_M)
        count = np.round((high_m - low_m) / NODE_M).astype(int) + 1
        shape = (int(count[0]) + 2 * margin, int(count[1]) + 2 * margin)
        inner = (slice(margin, -margin), slice(margin, -margin))
        if self.is_level:
            return Patch(Raster(low_m, NODE_M, np.zeros(count)), np.full(count, False))
        height_m, street = self._nodes(low_m - margin * NODE_M, shape)
        return Patch(Raster(low_m, NODE_M, height_m[inner]), street[inner])

    def _nodes(self, low_m: Float64Array, shape: tuple[int, int]) -> tuple[Float64Array, BoolArray]:
        """Heights of ``shape`` nodes, the first at (2,) ``low_m``, and whether they belong to lanes."""
        lanes, verges = self._on_streets(low_m, shape)
        street, xy_m = lanes | verges, node_positions_m(low_m, NODE_M, shape)
        height_m = self._far_nodes_m(low_m, shape)
        height_m[street] = self.elevation.height_m(xy_m[street])
        height_m = relax(height_m, _dilate(street, _RELAXED_M) & ~street, _RELAXATION_STEPS)
        carved_m = self._shores.carve(xy_m.reshape(-1, 2), height_m.reshape(-1)).reshape(shape)
        return _limit_slope(np.where(street, height_m, carved_m), lanes, round(_RELAXED_M / NODE_M)), lanes

    def _far_nodes_m(self, low_m: Float64Array, shape: tuple[int, int]) -> Float64Array:
        """Heights of ``shape`` nodes as in ``far_m``, but without the slight attenuation of the hills by the spline."""
        above = self._above_relief
        first = np.floor((low_m - above.origin_m) / _COARSE_M).astype(int) - 1
        count = [int(np.ceil(side * NODE_M / _COARSE_M)) + 4 for side in shape]
        i, j = (start + np.arange(length) for start, length in zip(first, count, strict=True))
        near = np.ix_(*(np.clip(k, 0, size - 1) for k, size in zip((i, j), above.values.shape, strict=True)))
        hills_m = self._relief.grid_m(above.origin_m[0] + i * _COARSE_M, above.origin_m[1] + j * _COARSE_M)
        return Raster(above.origin_m + first * _COARSE_M, _COARSE_M, above.values[near] + hills_m).refine(
            low_m, NODE_M, shape
        )

    def _on_streets(self, low_m: Float64Array, shape: tuple[int, int]) -> tuple[BoolArray, BoolArray]:
        """Which of ``shape`` nodes, the first at (2,) ``low_m``, affect ground-level lanes, and which lie on verges."""
        box = shapely.box(*low_m, *(low_m + NODE_M * np.array(shape)))
        off_lanes, off_decks = (
            _rasterize(tree.geometries[np.sort(tree.query(box))], low_m, shape) for tree in self._lanes
        )
        scale = round(NODE_M / _PIXEL_M)
        distance = cv2.distanceTransform(off_lanes, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)[::scale, ::scale]
        to_lanes_m = _PIXEL_M * np.asarray(distance, np.float64)
        beside = (to_lanes_m <= _VERGE_M) & (off_decks[::scale, ::scale] > 0)
        return to_lanes_m <= _LANE_EDGE_M, beside


def _rasterize(polygons: AnyArray, low_m: Float64Array, shape: tuple[int, int]) -> UInt8Array:
    """Draw polygons as 0 into pixels of 1 that cover ``shape`` nodes; the first pixel's center is at (2,) ``low_m``."""
    scale = round(NODE_M / _PIXEL_M)
    pixels = np.full((shape[0] * scale, shape[1] * scale), 1, np.uint8)
    for polygon in shapely.get_parts(polygons):
        vertices = (shapely.get_coordinates(polygon.exterior) - low_m) / _PIXEL_M
        cv2.fillPoly(pixels, [np.round(vertices[:, ::-1] * 256.0).astype(np.int32)], 0, shift=8)
    return pixels


def _strip_positions(strips: Sequence[Strip]) -> Float64Array:
    """(N, 3) positions along the center lines of strips, spaced closer than cells of the coarse raster."""
    lines = [shapely.LineString(strip.center_m) for strip in strips if strip.outline_m is None]
    return shapely.get_coordinates(shapely.segmentize(np.array(lines, object), _COARSE_M / 2.0), include_z=True)


def _above_relief(relief: Relief, positions_m: Float64Array, roofs_m: Float64Array) -> Raster:
    """Height of the land above the relief: that of the roads at (N, 3) positions, and smooth between them.

    It is raised to (M, 3) positions above tunnels where it would be lower.
    """
    land = _between_roads(relief, positions_m)
    if len(roofs_m) == 0:
        return land
    lacking_m = roofs_m[:, 2] - relief.height_m(roofs_m[:, :2]) - land.smooth(roofs_m[:, :2])
    roofs_m = roofs_m[(lacking_m > 0.0) & (cKDTree(positions_m[:, :2]).query(roofs_m[:, :2])[0] > _COARSE_M)]
    return _between_roads(relief, np.concatenate([positions_m, roofs_m]))


def _between_roads(relief: Relief, positions_m: Float64Array) -> Raster:
    """Height of the land above the relief: that at (N, 3) positions, and smooth between them."""
    if len(positions_m) == 0:
        return Raster(np.zeros(2), _COARSE_M, np.zeros((1, 1)))
    low_m = np.floor((positions_m[:, :2].min(axis=0) - _MARGIN_M) / _COARSE_M) * _COARSE_M
    shape = tuple(((positions_m[:, :2].max(axis=0) + _MARGIN_M - low_m) // _COARSE_M).astype(int) + 1)
    cell = np.ravel_multi_index(tuple(np.round((positions_m[:, :2] - low_m) / _COARSE_M).astype(int).T), shape)
    above_m = positions_m[:, 2] - relief.height_m(positions_m[:, :2])
    count = np.bincount(cell, minlength=shape[0] * shape[1])
    mean_m = np.bincount(cell, above_m, len(count)) / np.maximum(count, 1)
    known = (count > 0).reshape(shape)
    values_m = membrane(mean_m.reshape(shape), known)
    if len(relief.amplitude_m):
        distance_m = _COARSE_M * cv2.distanceTransform((~known).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
        share = np.clip((distance_m - _FADE_M[0]) / (_FADE_M[1] - _FADE_M[0]), 0.0, 1.0)
        values_m = values_m * (1.0 - share**2 * (3.0 - 2.0 * share))
    return Raster(low_m, _COARSE_M, values_m)


def _dilate(mask: BoolArray, by_m: float) -> BoolArray:
    """Extend a node mask by all nodes within a distance."""
    away = cv2.distanceTransform((~mask).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    return np.asarray(away <= by_m / NODE_M, bool)


def _limit_slope(height_m: Float64Array, lanes: BoolArray, steps: int) -> Float64Array:
    """Limit heights to the range between the cones that rise and fall from lanes at the maximum slope of an embankment.

    Where lanes of different heights are too close for that, the cutting of the lower one reaches up to the upper one.
    """
    high_m = _lower_bounds(np.where(lanes, height_m, np.inf), steps)
    low_m = -_lower_bounds(np.where(lanes, -height_m, np.inf), steps)
    return np.where(lanes, height_m, np.clip(height_m, np.minimum(low_m, high_m), high_m))


def _lower_bounds(bound_m: Float64Array, steps: int) -> Float64Array:
    """Lower each bound to at most its neighbors' bounds plus the maximum rise from them, repeated ``steps`` times."""
    rises = [
        (cv2.getStructuringElement(shape, (3, 3)), _MAX_SLOPE * NODE_M * length)
        for shape, length in ((cv2.MORPH_CROSS, 1.0), (cv2.MORPH_RECT, np.sqrt(2.0)))
    ]
    for _ in range(steps):
        around_m = [cv2.erode(bound_m, kernel) + rise_m for kernel, rise_m in rises]
        bound_m = np.minimum(bound_m, np.minimum(*around_m))
    return bound_m
