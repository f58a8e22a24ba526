"""Groups points above the ground into clusters that may be road users."""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from simbev_ros.reference_stack.arrays import Booleans, Floats, Integers

_CELL_M, _GROWTH_M = 0.3, 40.0
"""Cell side at the ego, and the distance at which cells are twice as large, since rings and columns spread."""
_NEIGHBORS = np.ones((3, 3), np.int8)
_MIN_HEIGHT_M, _OVERHEAD_HEIGHT_M, _MAX_HEIGHT_M = 0.25, 2.8, 4.6
_MAX_VEHICLE_HEIGHT_M = 4.3
"""Height that no vehicle exceeds; a cluster with points overhead and points above this height is a building."""
_MAX_OVERHEAD_SHARE = 0.2
"""Share of points overhead up to which they are a tree or a sign above the object, not a part of it."""
_MIN_POINTS, _MAX_DIAGONAL_M = 4, 16.0


@dataclass(frozen=True)
class Clusters:
    """Points grouped by cluster.

    Attributes:
        points_m: (N, 3) points sorted by cluster, ego frame.
        height_m: (N,) heights above the ground.
        cluster: (N,) cluster number of each point, ascending from 0 without gaps.
    """

    points_m: Floats
    height_m: Floats
    cluster: Integers


def find_clusters(points_ego: Floats, height_m: Floats) -> Clusters:
    """Find clusters among (N, 3) points, ego frame, at (N,) heights above the ground."""
    above = (height_m > _MIN_HEIGHT_M) & (height_m < _MAX_HEIGHT_M)
    points_ego, height_m = points_ego[above], height_m[above]
    is_low = height_m < _OVERHEAD_HEIGHT_M
    label = _patch_labels(points_ego[:, :2], is_low)
    count = np.bincount(label)
    overhead = np.bincount(label, ~is_low) / np.maximum(count, 1)
    has_overhead = overhead > _MAX_OVERHEAD_SHARE
    is_building = has_overhead & (np.bincount(label, height_m > _MAX_VEHICLE_HEIGHT_M) > 0)
    size_m = _diagonal_m(points_ego, label, len(count))
    is_kept_cluster = (count >= _MIN_POINTS) & (size_m < _MAX_DIAGONAL_M) & ~is_building
    is_kept_cluster[:1] = False  # label 0: points outside all patches
    is_kept_point = is_kept_cluster[label] & (is_low | has_overhead[label])
    number = np.cumsum(is_kept_cluster) - 1
    order = np.flatnonzero(is_kept_point)[np.argsort(label[is_kept_point], kind="stable")]
    return Clusters(points_ego[order], height_m[order], number[label[order]])


def _patch_labels(points_m: Floats, is_low: Booleans) -> Integers:
    """(N,) number, from 1, of the connected patch of cells of (N, 2) points; 0: the cell contains no low point."""
    range_m = np.maximum(np.hypot(points_m[:, 0], points_m[:, 1]), 1e-6)
    cells_per_m = _GROWTH_M / _CELL_M * np.log1p(range_m / _GROWTH_M) / range_m
    cell = np.floor(points_m * cells_per_m[:, None]).astype(np.int64)
    half = int(np.abs(cell).max(initial=0)) + 1
    row, column = (cell + half).T
    occupied = np.zeros((2 * half + 1, 2 * half + 1), np.bool_)
    occupied[row[is_low], column[is_low]] = True
    patches, _ = ndimage.label(occupied, _NEIGHBORS)
    label: Integers = patches[row, column].astype(np.int64)
    return label


def _diagonal_m(points_m: Floats, label: Integers, count: int) -> Floats:
    """(count,) diagonal of the axis-aligned rectangle around each label's points; inf for labels without points."""
    low_m, high_m = np.full((count, 2), np.inf), np.full((count, 2), -np.inf)
    for axis in range(2):
        np.minimum.at(low_m[:, axis], label, points_m[:, axis])
        np.maximum.at(high_m[:, axis], label, points_m[:, axis])
    diagonal_m: Floats = np.hypot(*(high_m - low_m).T)
    return diagonal_m
