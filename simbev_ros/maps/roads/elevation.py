"""Road surface heights at any position, level by level, interpolated from the borders of strips."""

from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree

from simbev_ros.foundation.types import AnyArray, BoolArray, Float64Array, Int64Array
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.layout import Layout, Strip
from simbev_ros.maps.roads.polylines import Polylines

_SAMPLED = tuple(kind for kind in LaneKind if kind not in (LaneKind.WALKING_AREA, LaneKind.CROSSING))
_SPACING_M = 3.0  # dense enough to preserve the crown between two lanes
_NUM_NEIGHBORS = 6
_NEAR_M = 30.0
_SOFTENING_M = 0.5  # keeps weights finite on the samples themselves
_PRODUCTS = ((0, 0), (0, 1), (1, 1), (0, 2), (1, 2))  # pairs of axes
_MIN_PARALLEL_POINTS = 20_000  # number of points from which queries use all cores
_POINTS_PER_BATCH = 1 << 18  # bounds the memory of a query
_STRIPS_PER_BATCH = 4096
_FIT_RADIUS_M = 6.0  # about the extent of crossing strips in junctions
_NUM_FIT_NEIGHBORS = 50
_FITS_PER_BATCH = 1 << 14
_LEVEL_SEPARATION_M = 0.5  # vertical distance from which roads hardly count as one surface
_SLOPE_WEIGHT_M = 2.0  # distance at which a sample's slope has the same weight as its height


class Elevation:
    """The carriageways as one smooth surface per level, defined everywhere and meaningful near roads of that level.

    Modified Shepard interpolation (Franke and Nielson 1980): near every sample of a strip the road is the plane through
    its two borders; a point's height is the weighted mean of its nearest samples' planes. The weights vanish at the
    farthest of these samples, so the surface is continuous, exact on planes, and extends beyond the road with the
    road's slope.

    In junctions, strips cross each other, and in few maps they have equal heights. Therefore the planes there are first
    fitted to all surrounding samples, and partly also beside junctions; otherwise the surface would jump from one strip
    to the next every meter or two.
    """

    def __init__(self, layout: Layout) -> None:
        self._levels = tuple(_Samples(layout.strips_of(*_SAMPLED, level=level)) for level in layout.levels)

    @property
    def levels(self) -> range:
        """All levels, 0 to the highest."""
        return range(len(self._levels))

    def height_m(self, xy_m: Float64Array, level: int = 0) -> Float64Array:
        """(N,) height of a level's road surface at (N, 2) points of the map frame; 0 if the map has no roads."""
        parts = [
            self._levels[level].height_m(xy_m[start : start + _POINTS_PER_BATCH])
            for start in range(0, len(xy_m), _POINTS_PER_BATCH)
        ]
        return np.concatenate([np.empty(0), *parts])

    def distance_m(self, xy_m: Float64Array, level: int = 0) -> Float64Array:
        """(N,) distance in plan view to the nearest sample of a level's center lines, at most 3 m apart along them."""
        return self._levels[level].distance_m(xy_m)

    def level_at(self, xyz_m: Float64Array) -> Int64Array:
        """(N,) level with the surface nearest in height to (N, 3) points, of those within 30 m in plan view."""
        gaps_m = np.full((len(self._levels), len(xyz_m)), np.inf)
        for level, gap_m in enumerate(gaps_m):
            near = self.distance_m(xyz_m[:, :2], level) <= _NEAR_M
            gap_m[near] = np.abs(self.height_m(xyz_m[near, :2], level) - xyz_m[near, 2])
        return np.argmin(gaps_m, axis=0)


class _Samples:
    """Planes at sample positions along the strips of one level."""

    def __init__(self, strips: Sequence[Strip]) -> None:
        sampled = [strip for strip in strips if strip.outline_m is None]
        parts = [
            _planes(sampled[start : start + _STRIPS_PER_BATCH]) for start in range(0, len(sampled), _STRIPS_PER_BATCH)
        ]
        self._xyz_m = np.concatenate([np.empty((0, 3)), *(positions_m for positions_m, _, _ in parts)])
        self._slope = np.concatenate([np.empty((0, 2)), *(slopes for _, slopes, _ in parts)])
        self._in_junction = np.concatenate([np.empty(0, bool), *(inside for _, _, inside in parts)])
        self._junctions = cKDTree(self._xyz_m[self._in_junction, :2])
        self._is_flat = not (self._xyz_m[:, 2].any() or self._slope.any())
        self._tree = cKDTree(self._xyz_m[:, :2])
        # Large maps have many junctions, and a scene sees few of them: planes are fitted on first use.
        self._plane = np.column_stack([self._xyz_m[:, 2], self._slope])
        self._is_unfitted = np.ones(len(self._xyz_m), bool)

    def height_m(self, xy_m: Float64Array) -> Float64Array:
        """Heights, see ``Elevation.height_m``."""
        if self._is_flat:
            return np.zeros(len(xy_m))
        count = min(_NUM_NEIGHBORS, len(self._xyz_m))
        distance_m, index = self._tree.query(xy_m, k=range(1, count + 1), workers=_workers(xy_m))
        self._fit_planes(np.unique(index[self._is_unfitted[index]]))
        weight = np.maximum(distance_m[:, -1:], 1e-3) - distance_m
        weight /= distance_m + _SOFTENING_M
        weight *= weight
        weight[:, 0] += 1e-12  # if all neighbors are equally distant
        plane_m = self._plane[index, 0]
        for axis in range(2):
            plane_m += (np.asarray(xy_m)[:, None, axis] - self._xyz_m[index, axis]) * self._plane[index, 1 + axis]
        return np.sum(weight * plane_m, axis=1) / np.sum(weight, axis=1)

    def _fit_planes(self, rows: Int64Array) -> None:
        """Fit the planes of samples in junctions to the surrounding samples, near junctions partly; keep all others."""
        count = min(_NUM_FIT_NEIGHBORS, len(self._xyz_m))
        for start in range(0, len(rows), _FITS_PER_BATCH):
            row = rows[start : start + _FITS_PER_BATCH]
            self._is_unfitted[row] = False
            row = row[
                self._junctions.query(self._xyz_m[row, :2], distance_upper_bound=_FIT_RADIUS_M)[0] < _FIT_RADIUS_M
            ]
            distance_m, index = self._tree.query(self._xyz_m[row, :2], k=range(1, count + 1), workers=_workers(row))
            to_junction_m = np.min(distance_m, axis=1, where=self._in_junction[index], initial=_FIT_RADIUS_M)
            near = to_junction_m < _FIT_RADIUS_M
            fraction = 1.0 - (to_junction_m[near, None] / _FIT_RADIUS_M) ** 2
            fitted = self._least_squares_planes(row[near], distance_m[near], index[near])
            self._plane[row[near]] += fraction * (fitted - self._plane[row[near]])

    def _least_squares_planes(self, row: Int64Array, distance_m: Float64Array, index: Int64Array) -> Float64Array:
        """(M, 3) heights and slopes of the planes that best fit (M, K) samples in the least-squares sense."""
        offset_m, slope = self._xyz_m[index] - self._xyz_m[row, None], self._slope[index]
        mismatch_m = offset_m[:, :, 2] - np.sum(slope * offset_m[:, :, :2], axis=2)
        radius_m = np.clip(distance_m[:, -1:], 1e-3, _FIT_RADIUS_M)
        weight = np.maximum(1.0 - (distance_m / radius_m) ** 2, 0.0) / (1.0 + (mismatch_m / _LEVEL_SEPARATION_M) ** 2)
        weight[:, 0] += 1e-6  # if all samples are equally distant
        weight /= weight.sum(axis=1, keepdims=True)
        mean_m = np.einsum("ij,ijk->ik", weight, offset_m)
        spread_m2 = np.einsum("ij,ijk,ijl->ikl", weight, offset_m, offset_m) - mean_m[:, :, None] * mean_m[:, None]
        rhs = spread_m2[:, :2, 2] + _SLOPE_WEIGHT_M**2 * np.einsum("ij,ijk->ik", weight, slope)
        tilt = np.linalg.solve(spread_m2[:, :2, :2] + _SLOPE_WEIGHT_M**2 * np.eye(2), rhs[:, :, None])[:, :, 0]
        height_m = self._xyz_m[row, 2] + mean_m[:, 2] - np.sum(tilt * mean_m[:, :2], axis=1)
        return np.column_stack([height_m, tilt])

    def distance_m(self, xy_m: Float64Array) -> Float64Array:
        """Distances, see ``Elevation.distance_m``."""
        if len(self._xyz_m) == 0:
            return np.full(len(xy_m), np.inf)
        return self._tree.query(xy_m, workers=_workers(xy_m))[0]


def _workers(points: AnyArray) -> int:
    """Number of threads for a query; -1: one per core."""
    return -1 if len(points) > _MIN_PARALLEL_POINTS else 1


def _planes(strips: Sequence[Strip]) -> tuple[Float64Array, Float64Array, BoolArray]:
    """(N, 3) positions along the center lines of strips, (N, 2) slopes of the road, and whether roads meet there."""
    lines = Polylines.from_lines([strip.center_m for strip in strips])
    left_m, right_m = (
        np.concatenate([np.empty((0, 3)), *sides_m])
        for sides_m in ([strip.left_m for strip in strips], [strip.right_m for strip in strips])
    )
    row, at_m = lines.sample_stations(_SPACING_M)
    parameter = lines.parameter(row, at_m)
    middle_m = lines.values(parameter)
    # Slope g of the plane with the rise of both directions; least squares where these are nearly parallel.
    around_m = [lines.values(lines.parameter(row, at_m + step_m)) for step_m in (-_SPACING_M / 2.0, _SPACING_M / 2.0)]
    along, across = around_m[1] - around_m[0], lines.values(parameter, left_m - right_m)
    xx, xy, yy, xz, yz = (along[:, a] * along[:, b] + across[:, a] * across[:, b] for a, b in _PRODUCTS)
    xx, yy = xx + 1e-9, yy + 1e-9
    slope = np.column_stack([yy * xz - xy * yz, xx * yz - xy * xz]) / (xx * yy - xy * xy)[:, None]
    return middle_m, slope, np.array([bool(strip.junction) and not strip.continues for strip in strips])[row]
