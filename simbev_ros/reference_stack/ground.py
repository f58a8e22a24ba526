"""Finds the ground around the ego: in each sector, the heights of ground and road are followed outward, bin by bin."""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from simbev_ros.reference_stack.arrays import Booleans, Floats, Integers

SECTORS, BINS, BIN_M = 180, 120, 0.5
RANGE_M = BINS * BIN_M
_STEP_M, _STEP_PER_M = 0.12, 0.02
"""Maximum deviation of the ground from its extrapolated line, and its increase per meter without a return."""
_CURB_M, _CURB_PER_M = 0.06, 0.006
"""The same for the road, which ends at curbs."""
_LEVEL_WEIGHT = 0.3
_MIN_SECTORS = 3
_MAX_SLOPE = 0.2
_SLOPE_WEIGHT = 0.15
_SLOPE_BASE_M = 4.0
"""Minimum length over which a slope is measured, because heights are noisy."""


@dataclass(frozen=True)
class Ground:
    """The ground and the road of a cloud of N points.

    Attributes:
        height_m: (N,) height of each point above the ground.
        road_m: (SECTORS,) distance from the ego up to which road is seen.
        has_curb: (SECTORS,) whether the road ends there at a step; else it is hidden or ends at a high object.
    """

    height_m: Floats
    road_m: Floats
    has_curb: Booleans


def sector_of(azimuth_rad: Floats) -> Integers:
    """Sector number of each azimuth -π … π."""
    return ((azimuth_rad / (2 * np.pi) + 0.5) * SECTORS).astype(np.int64) % SECTORS


def find_ground(points_ego: Floats) -> Ground:
    """Find the ground under (N, 3) points within ``RANGE_M``, ego frame: x forward, z up, origin on the ground.

    The lowest point of a bin is ground if it lies close to the line extrapolated from the bins before it; otherwise
    the line continues. A car therefore hides the road but does not become road.
    """
    sector = sector_of(np.arctan2(points_ego[:, 1], points_ego[:, 0]))
    row = np.minimum((np.hypot(points_ego[:, 0], points_ego[:, 1]) / BIN_M).astype(np.int64), BINS - 1)
    lowest = np.full((BINS, SECTORS), np.inf)
    np.minimum.at(lowest, (row, sector), points_ego[:, 2])
    ground_m, road_m, has_curb = _follow(lowest)
    return Ground(points_ego[:, 2] - ground_m[row, sector], road_m, has_curb)


def _follow(lowest_m: Floats) -> tuple[Floats, Floats, Booleans]:
    """(BINS, SECTORS) ground heights, and (SECTORS,) reach and curb of the road, from the lowest points (inf: none)."""
    ground_m = np.empty_like(lowest_m)
    height_m, slope, gap_m, level_m, road_m = np.zeros((5, SECTORS))
    on_road, has_curb = np.ones(SECTORS, np.bool_), np.zeros(SECTORS, np.bool_)
    for row, found_m in enumerate(lowest_m):
        gap_m = gap_m + BIN_M
        expected_m = height_m + slope * BIN_M
        deviation_m = found_m - expected_m
        is_ground = np.abs(deviation_m) < _STEP_M + _STEP_PER_M * gap_m
        step_m = found_m - level_m - slope * BIN_M
        is_flat = np.abs(step_m) < _CURB_M + _CURB_PER_M * gap_m
        has_curb |= on_road & is_ground & ~is_flat
        on_road &= is_flat | np.isinf(found_m)
        road_m = np.where(on_road & is_flat, (row + 1) * BIN_M, road_m)
        level_m = level_m + slope * BIN_M + _LEVEL_WEIGHT * np.where(on_road & is_flat, step_m, 0.0)
        deviation_m = np.where(is_ground, deviation_m, 0.0)
        height_m = expected_m + deviation_m
        slope = slope + _SLOPE_WEIGHT * deviation_m / np.maximum(gap_m, _SLOPE_BASE_M)
        slope = np.minimum(np.maximum(slope, -_MAX_SLOPE), _MAX_SLOPE)
        ground_m[row] = height_m
        gap_m = np.where(is_ground, 0.0, gap_m)
    return ground_m, ndimage.grey_opening(road_m, _MIN_SECTORS, mode="wrap"), has_curb
