"""Footprints of boxes in plan: whether pairs of oriented rectangles overlap."""

import numpy as np

from simbev_ros.foundation.geometry.plan_view import left_of
from simbev_ros.foundation.types import BoolArray, Float64Array


def footprints_overlap(position_m: Float64Array, yaw_rad: Float64Array, size_m: Float64Array) -> BoolArray:
    """(K,) whether the two rectangles of each pair overlap in plan, found with separating axes.

    Args:
        position_m: (K, 2, 2+) centers.
        yaw_rad: (K, 2) headings.
        size_m: (K, 2, 2+) lengths and widths.
    """
    half_m = size_m[..., :2] / 2.0
    ahead = np.stack([np.cos(yaw_rad), np.sin(yaw_rad)], axis=-1)
    axes = np.stack([ahead, left_of(ahead)], axis=2)  # pair, body, side, xy
    normals = axes.reshape(len(size_m), 4, 2)
    gap_m = np.abs(np.einsum("kax,kx->ka", normals, position_m[:, 1, :2] - position_m[:, 0, :2]))
    projection = np.abs(np.einsum("kax,kbsx->kabs", normals, axes))
    reach_m = np.einsum("kabs,kbs->ka", projection, half_m)
    is_apart: BoolArray = np.any(gap_m >= reach_m, axis=1)
    return ~is_apart


def rectangle_corners(position_m: Float64Array, yaw_rad: Float64Array, size_m: Float64Array) -> Float64Array:
    """(K, 4, 2) corners of rectangles with (K, 2+) centers, (K,) headings and (K, 2+) lengths and widths, in order."""
    ahead = np.stack([np.cos(yaw_rad), np.sin(yaw_rad)], axis=-1) * size_m[:, :1] / 2.0
    left = left_of(ahead) / size_m[:, :1] * size_m[:, 1:2]
    return position_m[:, None, :2] + np.stack([ahead + left, left - ahead, -ahead - left, ahead - left], axis=1)
