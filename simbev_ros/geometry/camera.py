"""Pinhole camera model.

Pixel centres lie at integer coordinates (as in OpenCV and image_geometry); optical frame x right, y down, z forward.
"""

import math
from dataclasses import dataclass
from typing import Self

import numpy as np

from simbev_ros.types import Float64Array


@dataclass(frozen=True, slots=True)
class PinholeCamera:
    """An ideal camera: pixel = (fx · x/z + cx, fy · y/z + cy)."""

    width_px: int
    height_px: int
    fx_px: float
    fy_px: float
    cx_px: float
    cy_px: float

    @classmethod
    def from_field_of_view(cls, width_px: int, height_px: int, horizontal_fov_rad: float) -> Self:
        """Square pixels, principal point in the middle of the image, i.e. at ((width - 1) / 2, (height - 1) / 2)."""
        focal_px = width_px / 2.0 / math.tan(horizontal_fov_rad / 2.0)
        return cls(width_px, height_px, focal_px, focal_px, (width_px - 1) / 2.0, (height_px - 1) / 2.0)

    @property
    def matrix(self) -> Float64Array:
        """(3, 3) intrinsic matrix K."""
        return np.array([[self.fx_px, 0.0, self.cx_px], [0.0, self.fy_px, self.cy_px], [0.0, 0.0, 1.0]])

    def project(self, points_optical: Float64Array) -> Float64Array:
        """(N, 2) pixel coordinates of (N, 3) points with z > 0, metres, optical frame."""
        z = points_optical[:, 2:]
        return points_optical[:, :2] / z * [self.fx_px, self.fy_px] + [self.cx_px, self.cy_px]

    def rays(self, pixels: Float64Array) -> Float64Array:
        """(N, 3) rays with z = 1, optical frame, through (N, 2) pixels; scaled by depth they give the point."""
        xy = (np.asarray(pixels, np.float64) - [self.cx_px, self.cy_px]) / [self.fx_px, self.fy_px]
        return np.concatenate([xy, np.ones((len(xy), 1))], axis=1)
