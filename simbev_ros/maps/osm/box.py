"""Parts of Earth's surface between two longitudes and two latitudes: given by users, or where roads are dense."""

from typing import NamedTuple, Self

import numpy as np

from simbev_ros.foundation.geometry.ragged import ragged_indices
from simbev_ros.foundation.types import BoolArray, Float64Array

MAX_SIDE_M = 30_000.0
"""Largest width and height of a map."""
_DENSEST_SIDE_M = 0.99 * MAX_SIDE_M
"""Less, because lengths of degrees are approximate."""
_M_PER_DEG = 111_320.0
_CELL_M = 1_000.0
_MAX_CELLS = 512
_MAX_SAMPLES = 4_000_000


class Box(NamedTuple):
    """West, south, east and north in degrees; ``east`` is above ``west``, beyond 180 at the antimeridian."""

    west: float
    south: float
    east: float
    north: float

    @classmethod
    def of_bounds(cls, bounds: tuple[float, float, float, float]) -> Self:
        """The box of bounds, which cross the antimeridian if west is above east."""
        west, south, east, north = bounds
        return cls(west, south, east + 360.0 * (east < west), north)

    @property
    def size_m(self) -> tuple[float, float]:
        """Approximate width and height."""
        latitude = np.clip(0.0, self.south, self.north)  # where the box is widest
        width_deg, height_deg = self.east - self.west, self.north - self.south
        return width_deg * _M_PER_DEG * float(np.cos(np.radians(latitude))), height_deg * _M_PER_DEG

    def grow(self, margin_m: float) -> Self:
        """The box with a margin on all sides; it ends at the poles."""
        height_deg = margin_m / _M_PER_DEG
        south, north = max(self.south - height_deg, -90.0), min(self.north + height_deg, 90.0)
        width_deg = height_deg / max(float(np.cos(np.radians(max(-south, north)))), 0.01)
        return self._replace(west=self.west - width_deg, south=south, east=self.east + width_deg, north=north)

    def unwrap(self, longitude_latitude_deg: Float64Array) -> Float64Array:
        """(N, 2) longitudes within 180 degrees of the box's middle, however they are given, and latitudes."""
        return _unwrap(longitude_latitude_deg, (self.west + self.east) / 2.0)

    def contains(self, longitude_latitude_deg: Float64Array) -> BoolArray:
        """(N,) whether each of N positions lies inside."""
        degrees = self.unwrap(longitude_latitude_deg)
        return np.asarray(((degrees >= self[:2]) & (degrees <= self[2:])).all(axis=1))

    def __str__(self) -> str:
        """The box as users write bounds."""
        west, east = ((value + 180.0) % 360.0 - 180.0 for value in (self.west, self.east))
        return ",".join(f"{value:.4f}" for value in (west, self.south, east, self.north))


def densest_box(longitude_latitude_deg: Float64Array, weight: Float64Array, max_weight: float) -> Box:
    """The square box with the greatest weight, of the greatest size that a map may have.

    Args:
        longitude_latitude_deg: (N, 2) positions, at least one.
        weight: (N,) weights.
        max_weight: Largest sum of weights in the box, which one of 1 km may exceed.
    """
    first_deg = float(longitude_latitude_deg[0, 0])
    degrees = _unwrap(longitude_latitude_deg, first_deg)
    scale_m = _M_PER_DEG * np.array([np.cos(np.radians(np.average(degrees[:, 1], weights=weight + 1e-9))), 1.0])
    xy_m = degrees * scale_m
    low_m, side_m, cell_m = _densest_square(xy_m, weight, max_weight)
    while cell_m > _CELL_M:
        near = (np.abs(xy_m - (low_m + side_m / 2.0)) <= 1.5 * side_m).all(axis=1)
        low_m, side_m, cell_m = _densest_square(xy_m[near], weight[near], max_weight)
    middle = (low_m + side_m / 2.0) / scale_m
    scale_m = _M_PER_DEG * np.array([np.cos(np.radians(middle[1])), 1.0])
    half = side_m / 2.0 / scale_m
    return Box(*(middle - half).tolist(), *(middle + half).tolist())


def sample_segments(start_deg: Float64Array, end_deg: Float64Array) -> tuple[Float64Array, Float64Array]:
    """Positions along (N, 2) segments, at most about 1 km apart, and the length in meters that each stands for."""
    step, lengths_m = _step(start_deg, end_deg), segment_lengths_m(start_deg, end_deg)
    max_count = max(_MAX_SAMPLES // len(step), 1)
    count = np.clip(np.ceil(lengths_m / _CELL_M).astype(np.int64), 1, max_count)
    row, number = ragged_indices(count)
    share = (number + 0.5) / count[row]
    return start_deg[row] + share[:, None] * step[row], (lengths_m / count)[row]


def segment_lengths_m(start_deg: Float64Array, end_deg: Float64Array) -> Float64Array:
    """(N,) approximate lengths of segments between (N, 2) longitudes and latitudes."""
    step = _step(start_deg, end_deg)
    return np.asarray(_M_PER_DEG * np.hypot(step[:, 0] * np.cos(np.radians(start_deg[:, 1])), step[:, 1]))


def _step(start_deg: Float64Array, end_deg: Float64Array) -> Float64Array:
    """(N, 2) differences of longitude, the short way round, and latitude."""
    return (end_deg - start_deg + 180.0) % 360.0 - 180.0


def _densest_square(xy_m: Float64Array, weight: Float64Array, max_weight: float) -> tuple[Float64Array, float, float]:
    """(2,) low corner and side of the square with the greatest weight, and the step in which squares were tried."""
    extent_m = np.ptp(xy_m, axis=0)
    cell_m = max(_CELL_M, float(extent_m.max()) / _MAX_CELLS)
    low_m, extent_m = xy_m.min(axis=0) - cell_m / 2.0, extent_m + cell_m / 2.0  # positions are middles of segments
    count = np.floor(extent_m / cell_m).astype(int) + 1
    cell = np.minimum(np.floor((xy_m - low_m) / cell_m).astype(int), count - 1)
    cells = np.bincount(cell[:, 0] * count[1] + cell[:, 1], weight, int(count.prod())).reshape(count)
    sums = np.pad(cells.cumsum(axis=0).cumsum(axis=1), ((1, 0), (1, 0)))
    for side in range(max(int(_DENSEST_SIDE_M / cell_m), 1), 0, -1):
        x, y = np.minimum(side, count)
        squares = sums[x:, y:] - sums[:-x, y:] - sums[x:, :-y] + sums[:-x, :-y]
        if squares.max() <= max_weight or side == 1:
            break
    corner = np.array(np.unravel_index(np.argmax(squares), squares.shape))
    # A map narrower than the square lies in the square's middle.
    return low_m + (corner - np.maximum(side - count, 0) / 2.0) * cell_m, side * cell_m, cell_m


def _unwrap(longitude_latitude_deg: Float64Array, middle_deg: float) -> Float64Array:
    degrees = longitude_latitude_deg.copy()
    degrees[:, 0] = (degrees[:, 0] - middle_deg + 180.0) % 360.0 - 180.0 + middle_deg
    return degrees
