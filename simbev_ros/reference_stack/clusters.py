"""Points above the ground → clusters that may be something on the road."""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from simbev_ros.reference_stack.arrays import Booleans, Floats, Integers

_CELL_M, _GROWTH_M = 0.3, 40.0
"""Side of the cells at the ego, and at which distance they are twice as deep, as rings and columns spread."""
_NEIGHBOURS = np.ones((3, 3), np.int8)
_LOWEST_M, _OVERHEAD_M, _HIGHEST_M = 0.25, 2.8, 4.6
_TALLEST_M = 4.3
"""Nothing that drives is higher."""
_LARGEST_OVERHEAD_SHARE = 0.2
"""With fewer points overhead, what is there is a tree or a sign above, not a part."""
_FEWEST_POINTS, _LONGEST_M = 4, 16.0


@dataclass(frozen=True)
class Clusters:
    """Points by cluster.

    Attributes:
        points_m: (N, 3) sorted by cluster, ego frame.
        height_m: (N,) above the ground.
        cluster: (N,) number of the cluster of each point; all from 0 on have some.
    """

    points_m: Floats
    height_m: Floats
    cluster: Integers


def find_clusters(points_ego: Floats, height_m: Floats) -> Clusters:
    """Clusters among (N, 3) points at (N,) heights above the ground."""
    above = (height_m > _LOWEST_M) & (height_m < _HIGHEST_M)
    points_ego, height_m = points_ego[above], height_m[above]
    is_low = height_m < _OVERHEAD_M
    label = _connected(points_ego[:, :2], is_low)
    count = np.bincount(label)
    overhead = np.bincount(label, ~is_low) / np.maximum(count, 1)
    has_overhead = overhead > _LARGEST_OVERHEAD_SHARE
    is_building = has_overhead & (np.bincount(label, height_m > _TALLEST_M) > 0)
    size_m = _diagonal_m(points_ego, label, len(count))
    wanted = (count >= _FEWEST_POINTS) & (size_m < _LONGEST_M) & ~is_building
    wanted[:1] = False  # no cell of its own
    kept = wanted[label] & (is_low | has_overhead[label])
    number = np.cumsum(wanted) - 1
    order = np.flatnonzero(kept)[np.argsort(label[kept], kind="stable")]
    return Clusters(points_ego[order], height_m[order], number[label[order]])


def _connected(points_m: Floats, is_low: Booleans) -> Integers:
    """(N,) number of the connected patch of cells, from 1 on, of (N, 2) points; 0: no low point is in its cell."""
    range_m = np.maximum(np.hypot(points_m[:, 0], points_m[:, 1]), 1e-6)
    cells_per_m = _GROWTH_M / _CELL_M * np.log1p(range_m / _GROWTH_M) / range_m
    cell = np.floor(points_m * cells_per_m[:, None]).astype(np.int64)
    half = int(np.abs(cell).max(initial=0)) + 1
    row, column = (cell + half).T
    occupied = np.zeros((2 * half + 1, 2 * half + 1), np.bool_)
    occupied[row[is_low], column[is_low]] = True
    patches, _ = ndimage.label(occupied, _NEIGHBOURS)
    label: Integers = patches[row, column].astype(np.int64)
    return label


def _diagonal_m(points_m: Floats, label: Integers, count: int) -> Floats:
    """(count,) diagonal of the upright rectangle around each label's points, inf without points."""
    low_m, high_m = np.full((count, 2), np.inf), np.full((count, 2), -np.inf)
    for axis in range(2):
        np.minimum.at(low_m[:, axis], label, points_m[:, axis])
        np.maximum.at(high_m[:, axis], label, points_m[:, axis])
    diagonal_m: Floats = np.hypot(*(high_m - low_m).T)
    return diagonal_m
