"""Heights of the roads at any place, level by level, from the borders of strips."""

from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree

from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.layout import Layout, Strip
from simbev_ros.maps.roads.polylines import Polylines
from simbev_ros.types import AnyArray, BoolArray, Float64Array, Int64Array

_SAMPLED = tuple(kind for kind in LaneKind if kind not in (LaneKind.WALKING_AREA, LaneKind.CROSSING))
_SPACING_M = 3.0  # near enough for the crown between two lanes to stay one
_NEIGHBOURS = 6
_SOFTENING_M = 0.5  # keeps weights finite on the samples themselves
_PRODUCTS = ((0, 0), (0, 1), (1, 1), (0, 2), (1, 2))  # axes
_MANY = 20_000  # points that are worth a second thread
_AT_ONCE = 1 << 18  # points, which bounds the memory that a query needs
_STRIPS_AT_ONCE = 4096
_FIT_REACH_M = 6.0  # about as far as strips cross each other in junctions
_FIT_NEIGHBOURS = 50
_FITS_AT_ONCE = 1 << 14
_APART_M = 0.5  # roads that are so far one above the other are hardly one surface
_TILT_M = 2.0  # a sample's slope counts as much as its height would at this distance


class Elevation:
    """The carriageways as one smooth surface per level, defined everywhere and meaningful near roads of that level.

    Modified Shepard interpolation (Franke and Nielson 1980): near every sample of a strip the road is the plane through
    its two borders; a point's height is the mean of its nearest samples' planes, with weights that vanish at the
    farthest of them, so the surface is continuous, exact on planes, and goes on beside the road as the road lies.

    In junctions strips lie across each other, and few maps put them all at one height. So the planes there are fitted
    to all samples around first, and beside them in part; else the road would jump from one strip to the next every
    meter or two.
    """

    def __init__(self, layout: Layout) -> None:
        self._levels = tuple(_Samples(layout.strips_of(*_SAMPLED, level=level)) for level in layout.levels)

    @property
    def levels(self) -> range:
        """All levels, 0 to the highest."""
        return range(len(self._levels))

    def height_m(self, xy_m: Float64Array, level: int = 0) -> Float64Array:
        """(N,) height of a level's carriageway plane at (N, 2) points of the map frame; 0 where a map has no roads."""
        parts = [self._levels[level].height_m(xy_m[at : at + _AT_ONCE]) for at in range(0, len(xy_m), _AT_ONCE)]
        return np.concatenate([np.empty(0), *parts])

    def distance_m(self, xy_m: Float64Array, level: int = 0) -> Float64Array:
        """(N,) distance in plan to the nearest sample of a level's center lines, at most 3 m apart along them."""
        return self._levels[level].distance_m(xy_m)

    def level_at(self, xyz_m: Float64Array, near_m: float = 30.0) -> Int64Array:
        """(N,) level whose carriageway is nearest in height to (N, 3) points, of those within ``near_m`` in plan."""
        gaps_m = np.full((len(self._levels), len(xyz_m)), np.inf)
        for level, gap_m in enumerate(gaps_m):
            near = self.distance_m(xyz_m[:, :2], level) <= near_m
            gap_m[near] = np.abs(self.height_m(xyz_m[near, :2], level) - xyz_m[near, 2])
        nearest: Int64Array = np.argmin(gaps_m, axis=0)
        return nearest


class _Samples:
    """Planes at places along the strips of one level."""

    def __init__(self, strips: Sequence[Strip]) -> None:
        sampled = [strip for strip in strips if strip.outline_m is None]
        parts = [_planes(sampled[at : at + _STRIPS_AT_ONCE]) for at in range(0, len(sampled), _STRIPS_AT_ONCE)]
        self._xyz_m = np.concatenate([np.empty((0, 3)), *(places_m for places_m, _, _ in parts)])
        self._slope = np.concatenate([np.empty((0, 2)), *(slopes for _, slopes, _ in parts)])
        self._in_junction = np.concatenate([np.empty(0, bool), *(inside for _, _, inside in parts)])
        self._junctions = cKDTree(self._xyz_m[self._in_junction, :2])
        self._level = not (self._xyz_m[:, 2].any() or self._slope.any())
        self._tree = cKDTree(self._xyz_m[:, :2])
        # Large maps have many junctions, of which one scene sees few: planes are fitted when they are first asked for.
        self._plane = np.column_stack([self._xyz_m[:, 2], self._slope])
        self._as_given = np.ones(len(self._xyz_m), bool)

    def height_m(self, xy_m: Float64Array) -> Float64Array:
        """As ``Elevation.height_m``."""
        if self._level:
            return np.zeros(len(xy_m))
        count = min(_NEIGHBOURS, len(self._xyz_m))
        distance_m, index = self._tree.query(xy_m, k=range(1, count + 1), workers=_workers(xy_m))
        self._fit(np.unique(index[self._as_given[index]]))
        weight = np.maximum(distance_m[:, -1:], 1e-3) - distance_m
        weight /= distance_m + _SOFTENING_M
        weight *= weight
        weight[:, 0] += 1e-12  # where all neighbors are equally far
        plane_m = self._plane[index, 0]
        for axis in range(2):
            plane_m += (np.asarray(xy_m)[:, None, axis] - self._xyz_m[index, axis]) * self._plane[index, 1 + axis]
        height_m: Float64Array = np.sum(weight * plane_m, axis=1) / np.sum(weight, axis=1)
        return height_m

    def _fit(self, rows: Int64Array) -> None:
        """Fit the planes at samples in junctions to the samples around, those near junctions less; others stay."""
        count = min(_FIT_NEIGHBOURS, len(self._xyz_m))
        for at in range(0, len(rows), _FITS_AT_ONCE):
            row = rows[at : at + _FITS_AT_ONCE]
            self._as_given[row] = False
            row = row[self._junctions.query(self._xyz_m[row, :2], distance_upper_bound=_FIT_REACH_M)[0] < _FIT_REACH_M]
            distance_m, index = self._tree.query(self._xyz_m[row, :2], k=range(1, count + 1), workers=_workers(row))
            to_junction_m = np.min(distance_m, axis=1, where=self._in_junction[index], initial=_FIT_REACH_M)
            near = to_junction_m < _FIT_REACH_M
            share = 1.0 - (to_junction_m[near, None] / _FIT_REACH_M) ** 2
            fitted = self._fitted(row[near], distance_m[near], index[near])
            self._plane[row[near]] += share * (fitted - self._plane[row[near]])

    def _fitted(self, row: Int64Array, distance_m: Float64Array, index: Int64Array) -> Float64Array:
        """(M, 3) heights and slopes of the planes that fit (M, K) samples best, in the least squares."""
        offset_m, slope = self._xyz_m[index] - self._xyz_m[row, None], self._slope[index]
        apart_m = offset_m[:, :, 2] - np.sum(slope * offset_m[:, :, :2], axis=2)
        reach_m = np.clip(distance_m[:, -1:], 1e-3, _FIT_REACH_M)
        weight = np.maximum(1.0 - (distance_m / reach_m) ** 2, 0.0) / (1.0 + (apart_m / _APART_M) ** 2)
        weight[:, 0] += 1e-6  # where all of them are equally far
        weight /= weight.sum(axis=1, keepdims=True)
        mean_m = np.einsum("ij,ijk->ik", weight, offset_m)
        spread_m2 = np.einsum("ij,ijk,ijl->ikl", weight, offset_m, offset_m) - mean_m[:, :, None] * mean_m[:, None]
        both = spread_m2[:, :2, 2] + _TILT_M**2 * np.einsum("ij,ijk->ik", weight, slope)
        tilt = np.linalg.solve(spread_m2[:, :2, :2] + _TILT_M**2 * np.eye(2), both[:, :, None])[:, :, 0]
        height_m = self._xyz_m[row, 2] + mean_m[:, 2] - np.sum(tilt * mean_m[:, :2], axis=1)
        return np.column_stack([height_m, tilt])

    def distance_m(self, xy_m: Float64Array) -> Float64Array:
        """As ``Elevation.distance_m``."""
        if len(self._xyz_m) == 0:
            return np.full(len(xy_m), np.inf)
        distance_m: Float64Array = self._tree.query(xy_m, workers=_workers(xy_m))[0]
        return distance_m


def _workers(points: AnyArray) -> int:
    """How many threads a query is worth; -1: one per core."""
    return -1 if len(points) > _MANY else 1


def _planes(strips: Sequence[Strip]) -> tuple[Float64Array, Float64Array, BoolArray]:
    """(N, 3) places along the center lines of strips, the (N, 2) slope of the road there, whether roads meet."""
    lines = Polylines.of([strip.center_m for strip in strips])
    left_m, right_m = (
        np.concatenate([np.empty((0, 3)), *sides_m])
        for sides_m in ([strip.left_m for strip in strips], [strip.right_m for strip in strips])
    )
    row, at_m = lines.places(_SPACING_M)
    place = lines.parameter(row, at_m)
    middle_m = lines.values(place)
    # Slope g of the plane: its rise along both directions is theirs; least squares where they are nearly parallel.
    around_m = [lines.values(lines.parameter(row, at_m + step_m)) for step_m in (-_SPACING_M / 2.0, _SPACING_M / 2.0)]
    along, across = around_m[1] - around_m[0], lines.values(place, left_m - right_m)
    xx, xy, yy, xz, yz = (along[:, a] * along[:, b] + across[:, a] * across[:, b] for a, b in _PRODUCTS)
    xx, yy = xx + 1e-9, yy + 1e-9
    slope = np.column_stack([yy * xz - xy * yz, xx * yz - xy * xz]) / (xx * yy - xy * xy)[:, None]
    return middle_m, slope, np.array([bool(strip.junction) and not strip.continues for strip in strips])[row]
