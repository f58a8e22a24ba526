"""Footprints: the ground area that boxes cover, seen from above."""

import numpy as np
import shapely

from simbev_ros.foundation.types import AnyArray, Float64Array


def footprints(size_m: Float64Array, center_m: Float64Array, yaw_rad: Float64Array) -> AnyArray:
    """(N,) footprint polygons of boxes.

    Args:
        size_m: (N, 2) or (2,) lengths and widths; further columns are ignored.
        center_m: (N, 2) or more columns, map frame.
        yaw_rad: (N,) headings, along the lengths of the boxes.
    """
    half_m = np.broadcast_to(np.asarray(size_m, np.float64)[..., :2] / 2.0, (len(center_m), 2))
    ahead = half_m[:, :1] * np.column_stack([np.cos(yaw_rad), np.sin(yaw_rad)])
    left = half_m[:, 1:] * np.column_stack([-np.sin(yaw_rad), np.cos(yaw_rad)])
    corners_m = np.stack([ahead + left, left - ahead, -ahead - left, ahead - left], axis=1)
    return np.asarray(shapely.polygons(center_m[:, None, :2] + corners_m), object)
