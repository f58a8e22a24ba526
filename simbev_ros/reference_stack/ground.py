"""The ground around the ego: in each sector its height is followed outwards, bin by bin, and so is the road."""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from simbev_ros.reference_stack.arrays import Booleans, Floats, Integers

SECTORS, BINS, BIN_M = 180, 120, 0.5
RANGE_M = BINS * BIN_M
_STEP_M, _STEP_PER_M = 0.12, 0.02
"""The ground may be so far off the line that it has followed, and more for each metre without a return."""
_KERB_M, _KERB_PER_M = 0.06, 0.006
"""The same for the road, which ends at kerbs."""
_LEVEL_WEIGHT = 0.3
_NARROWEST = 3
_STEEPEST = 0.2
_SLOPE_WEIGHT = 0.15
_SLOPE_BASE_M = 4.0
"""A slope is measured over this length at least, as heights are noisy."""


@dataclass(frozen=True)
class Ground:
    """What of a cloud is ground.

    Attributes:
        height_m: (N,) of each point above it.
        road_m: (SECTORS,) how far the road reaches from the ego, as far as is seen.
        has_kerb: (SECTORS,) whether it ends there at a step; else it is hidden, or ends at something high.
    """

    height_m: Floats
    road_m: Floats
    has_kerb: Booleans


def sector_of(azimuth_rad: Floats) -> Integers:
    """Number of the sector of each azimuth -π … π."""
    return ((azimuth_rad / (2 * np.pi) + 0.5) * SECTORS).astype(np.int64) % SECTORS


def find_ground(points_ego: Floats) -> Ground:
    """Ground under (N, 3) points within ``RANGE_M``, ego frame: x forward, z up, origin on the ground.

    The lowest point of a bin is ground if it lies close to the line that the ground before it follows; where nothing
    does, the line goes on. So a car hides the road, but does not become one.
    """
    sector = sector_of(np.arctan2(points_ego[:, 1], points_ego[:, 0]))
    row = np.minimum((np.hypot(points_ego[:, 0], points_ego[:, 1]) / BIN_M).astype(np.int64), BINS - 1)
    lowest = np.full((BINS, SECTORS), np.inf)
    np.minimum.at(lowest, (row, sector), points_ego[:, 2])
    ground_m, road_m, has_kerb = _follow(lowest)
    return Ground(points_ego[:, 2] - ground_m[row, sector], road_m, has_kerb)


def _follow(lowest_m: Floats) -> tuple[Floats, Floats, Booleans]:
    """(BINS, SECTORS) height of the ground, and reach and end of the road, of the lowest points; inf: none."""
    ground_m = np.empty_like(lowest_m)
    height_m, slope, gap_m, level_m, road_m = np.zeros((5, SECTORS))
    on_road, has_kerb = np.ones(SECTORS, np.bool_), np.zeros(SECTORS, np.bool_)
    for row, found_m in enumerate(lowest_m):
        gap_m = gap_m + BIN_M
        expected_m = height_m + slope * BIN_M
        off_m = found_m - expected_m
        is_ground = np.abs(off_m) < _STEP_M + _STEP_PER_M * gap_m
        step_m = found_m - level_m - slope * BIN_M
        is_flat = np.abs(step_m) < _KERB_M + _KERB_PER_M * gap_m
        has_kerb |= on_road & is_ground & ~is_flat
        on_road &= is_flat | np.isinf(found_m)
        road_m = np.where(on_road & is_flat, (row + 1) * BIN_M, road_m)
        level_m = level_m + slope * BIN_M + _LEVEL_WEIGHT * np.where(on_road & is_flat, step_m, 0.0)
        off_m = np.where(is_ground, off_m, 0.0)
        height_m = expected_m + off_m
        slope = slope + _SLOPE_WEIGHT * off_m / np.maximum(gap_m, _SLOPE_BASE_M)
        slope = np.minimum(np.maximum(slope, -_STEEPEST), _STEEPEST)
        ground_m[row] = height_m
        gap_m = np.where(is_ground, 0.0, gap_m)
    return ground_m, ndimage.grey_opening(road_m, _NARROWEST, mode="wrap"), has_kerb
