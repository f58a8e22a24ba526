"""Heights of the roads at any place, level by level, from the centre lines of strips."""

from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree

from simbev_ros.maps.lane_kind import LaneKind
from simbev_ros.maps.layout import Layout, Strip
from simbev_ros.types import Float64Array, Int64Array

_SAMPLED = tuple(kind for kind in LaneKind if kind not in (LaneKind.WALKING_AREA, LaneKind.CROSSING))
_SPACING_M = 4.0
_NEIGHBOURS = 8
_SOFTENING_M = 0.5  # keeps weights finite on the samples themselves


class Elevation:
    """The carriageways as one smooth surface per level, defined everywhere and meaningful near roads of that level.

    Modified Shepard interpolation (Franke and Nielson 1980): near every sample of a strip the road is the plane through
    its two borders; a point's height is the mean of its nearest samples' planes, with weights that vanish at the
    farthest of them, so the surface is continuous, exact on planes, and goes on beside the road as the road lies.
    """

    def __init__(self, layout: Layout) -> None:
        self._levels = tuple(_Samples(layout.strips_of(*_SAMPLED, level=level)) for level in layout.levels)

    @property
    def levels(self) -> range:
        """All levels, 0 to the highest."""
        return range(len(self._levels))

    def height_m(self, xy_m: Float64Array, level: int = 0) -> Float64Array:
        """(N,) height of a level's carriageway plane at (N, 2) points of the map frame; 0 where a map has no roads."""
        return self._levels[level].height_m(xy_m)

    def distance_m(self, xy_m: Float64Array, level: int = 0) -> Float64Array:
        """(N,) distance in plan to the nearest sample of a level's centre lines, at most 4 m apart along them."""
        return self._levels[level].distance_m(xy_m)

    def level_at(self, xyz_m: Float64Array, near_m: float = 30.0) -> Int64Array:
        """(N,) level whose carriageway is nearest in height to (N, 3) points, of those within ``near_m`` in plan."""
        gaps_m = np.stack(
            [
                np.where(
                    self.distance_m(xyz_m[:, :2], level) <= near_m,
                    np.abs(self.height_m(xyz_m[:, :2], level) - xyz_m[:, 2]),
                    np.inf,
                )
                for level in self.levels
            ]
        )
        level: Int64Array = np.argmin(gaps_m, axis=0)
        return level


class _Samples:
    """Planes at places along the strips of one level."""

    def __init__(self, strips: Sequence[Strip]) -> None:
        planes = [_planes(strip) for strip in strips if strip.outline_m is None]
        self._xyz_m = np.concatenate([np.empty((0, 3)), *(places for places, _ in planes)])
        self._slope = np.concatenate([np.empty((0, 2)), *(slopes for _, slopes in planes)])
        self._tree = cKDTree(self._xyz_m[:, :2])

    def height_m(self, xy_m: Float64Array) -> Float64Array:
        """As ``Elevation.height_m``."""
        if not self._xyz_m.any() and not self._slope.any():
            return np.zeros(len(xy_m))
        count = min(_NEIGHBOURS, len(self._xyz_m))
        distance_m, index = self._tree.query(xy_m, k=count)
        distance_m, index = distance_m.reshape(-1, count), index.reshape(-1, count)
        reach_m = np.maximum(distance_m[:, -1:], 1e-3)
        weight = (np.maximum(reach_m - distance_m, 0.0) / (reach_m * (distance_m + _SOFTENING_M))) ** 2
        weight[:, 0] += 1e-9  # where all neighbours are equally far
        offset_m = np.asarray(xy_m)[:, None, :] - self._xyz_m[index, :2]
        plane_m = self._xyz_m[index, 2] + np.sum(offset_m * self._slope[index], axis=2)
        height_m: Float64Array = np.sum(weight * plane_m, axis=1) / np.sum(weight, axis=1)
        return height_m

    def distance_m(self, xy_m: Float64Array) -> Float64Array:
        """As ``Elevation.distance_m``."""
        if len(self._xyz_m) == 0:
            return np.full(len(xy_m), np.inf)
        distance_m: Float64Array = self._tree.query(xy_m)[0]
        return distance_m


def _planes(strip: Strip) -> tuple[Float64Array, Float64Array]:
    """(N, 3) places along a strip's centre line and the (N, 2) slope of the road there, in metres per metre."""
    center_m = strip.center_m
    lengths_m = np.linalg.norm(np.diff(center_m[:, :2], axis=0), axis=1)
    stations_m = np.concatenate([[0.0], np.cumsum(lengths_m)])
    count = max(2, int(np.ceil(stations_m[-1] / _SPACING_M)) + 1)
    at_m = np.linspace(0.0, stations_m[-1], count)
    left_m, right_m, middle_m = (
        np.stack([np.interp(at_m, stations_m, line[:, axis]) for axis in range(3)], axis=1)
        for line in (strip.left_m, strip.right_m, center_m)
    )
    along = np.gradient(middle_m, axis=0)
    across = left_m - right_m
    # Slope g of the plane: its rise along both directions is theirs; least squares where they are nearly parallel.
    directions = np.stack([along[:, :2], across[:, :2]], axis=1)
    rises = np.stack([along[:, 2], across[:, 2]], axis=1)[..., None]
    normal_matrix = np.swapaxes(directions, 1, 2) @ directions + 1e-9 * np.eye(2)
    slope = np.linalg.solve(normal_matrix, np.swapaxes(directions, 1, 2) @ rises)[..., 0]
    return middle_m, slope
