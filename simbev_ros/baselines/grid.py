"""The bird's-eye-view grid of the baselines, and the level frame that it and all predictions refer to.

The level frame has its origin at the ego's origin, x along the ego's heading, y to the left, z up; unlike the ego frame
it does not pitch or roll. The grid is that of /ego/bev/labels with the paper's size: row 0 is furthest ahead, column 0
furthest left.
"""

import numpy as np

from simbev_ros.foundation.types import Float64Array

CELLS = 360
"""Rows and columns of the grid."""
CELL_M = 0.4
HALF_M = CELLS * CELL_M / 2
"""Half of the grid's side."""
FEATURE_STRIDE = 2
"""Cells of the grid in one cell of a model's features, along each axis."""
FEATURE_CELLS = CELLS // FEATURE_STRIDE
FEATURE_CELL_M = CELL_M * FEATURE_STRIDE


def level_from_map(map_from_ego: Float64Array) -> Float64Array:
    """(…, 4, 4) transforms from the map to the level frame, given the (…, 4, 4) poses of the ego."""
    heading_rad = np.arctan2(map_from_ego[..., 1, 0], map_from_ego[..., 0, 0])
    cosine, sine = np.cos(heading_rad), np.sin(heading_rad)
    result = np.zeros_like(map_from_ego, np.float64)
    result[..., 0, 0], result[..., 0, 1] = cosine, sine
    result[..., 1, 0], result[..., 1, 1] = -sine, cosine
    result[..., 2, 2] = result[..., 3, 3] = 1.0
    result[..., :3, 3] = -np.einsum("...ij,...j->...i", result[..., :3, :3], map_from_ego[..., :3, 3])
    return result
