"""Camera models: an ideal pinhole camera, and a camera with lens distortion.

Both project points of the optical frame (x right, y down, z forward) to pixels and turn pixels back into rays. Pixel
centers lie at integer coordinates, as in OpenCV and image_geometry.
"""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Self

import numpy as np

from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.types import Float64Array

MAX_RAY_ANGLE_RAD = math.radians(85.0)
"""Maximum angle between the optical axis and a ray through a pixel."""

_MAX_NEWTON_STEPS = 12
_NEWTON_TOLERANCE = 1e-6
"""Newton's method stops after a step smaller than this: the remaining error is about the square of the step."""

_RADIAL_TABLE_SIZE = 2049
_LATTICE_SIZE = 65
_MAX_IDEAL_PIXEL_RATIO = 4.0
_MAX_IDEAL_SIZE_PX = 8192
_MARGIN_PX = 2


@dataclass(frozen=True, slots=True)
class PinholeCamera:
    """Ideal pinhole camera without distortion: pixel = (fx · x/z + cx, fy · y/z + cy)."""

    width_px: int
    height_px: int
    fx_px: float
    fy_px: float
    cx_px: float
    cy_px: float

    @classmethod
    def from_field_of_view(cls, width_px: int, height_px: int, horizontal_fov_rad: float) -> Self:
        """Create a camera with square pixels and the principal point at ((width - 1) / 2, (height - 1) / 2)."""
        focal_px = width_px / 2.0 / math.tan(horizontal_fov_rad / 2.0)
        return cls(width_px, height_px, focal_px, focal_px, (width_px - 1) / 2.0, (height_px - 1) / 2.0)

    @property
    def matrix(self) -> Float64Array:
        """(3, 3) intrinsic matrix K."""
        return np.array([[self.fx_px, 0.0, self.cx_px], [0.0, self.fy_px, self.cy_px], [0.0, 0.0, 1.0]])

    def project(self, points_optical: Float64Array) -> Float64Array:
        """(N, 2) pixel coordinates of (N, 3) points with z > 0, meters, optical frame."""
        z = points_optical[:, 2:]
        return points_optical[:, :2] / z * [self.fx_px, self.fy_px] + [self.cx_px, self.cy_px]

    def rays(self, pixels: Float64Array) -> Float64Array:
        """(N, 3) rays through (N, 2) pixels, optical frame, with z = 1: a ray times the depth is the point seen."""
        return _homogeneous(self._plane(pixels))

    def depth_m(self, points_optical: Float64Array) -> Float64Array:
        """(N,) depth of (N, 3) points as in depth images: along the optical axis."""
        return points_optical[:, 2]

    def relative_illumination(self, rays: Float64Array) -> Float64Array:
        """(N,) illumination of the pixels of (N, 3) rays behind a simple lens, relative to that on its optical axis."""
        cosine = np.maximum(rays[:, 2] / np.linalg.norm(rays, axis=1), 0.0)
        illumination: Float64Array = cosine**4
        return illumination

    def _plane(self, pixels: Float64Array) -> Float64Array:
        """(N, 2) points on the plane z = 1 of (N, 2) pixels."""
        return (np.asarray(pixels, np.float64) - [self.cx_px, self.cy_px]) / [self.fx_px, self.fy_px]


@dataclass(frozen=True, slots=True)
class LensCamera(PinholeCamera):
    """Camera with lens distortion: OpenCV's five-coefficient model, ``plumb_bob`` in sensor_msgs/CameraInfo.

    Attributes:
        distortion: k1, k2, p1, p2, k3.

    Raises:
        InputError: The distortion is not one-to-one within the image, or a pixel's ray is more than 85° off the
            optical axis.
    """

    distortion: tuple[float, ...]

    def __post_init__(self) -> None:
        """Reject coefficients that cannot be inverted over the whole image."""
        pixels = _lattice(self.width_px, self.height_px)
        distorted = self._plane(pixels)
        if np.linalg.norm(distorted, axis=1).max() > self._radial_map[1][-1]:
            self._raise_not_invertible()
        undistorted = self._undistort(distorted)
        xx, xy, yy = _distortion_derivatives(undistorted.T, self.distortion)
        residual = np.abs(_distort(undistorted.T, self.distortion).T - distorted).max(axis=1)
        seen = np.linalg.norm(undistorted, axis=1) <= math.tan(MAX_RAY_ANGLE_RAD)
        if not ((xx * yy - xy * xy > 0.0) & (residual < 1e-9) & seen).all():
            self._raise_not_invertible()

    @property
    def max_radius2(self) -> float:
        """Maximum x² + y² on the plane z = 1 up to which the model is one-to-one and within 85° of the axis."""
        return float(self._radial_map[0][-1] ** 2)

    def ideal(self) -> PinholeCamera:
        """Pinhole camera that covers this camera's whole view with at least its resolution everywhere.

        The resolution is reduced where that would take more than four times as many pixels.
        """
        plane = self._undistort(self._plane(_lattice(self.width_px, self.height_px)))
        low, high = plane.min(axis=0), plane.max(axis=0)
        xx, xy, yy = _distortion_derivatives(plane.T, self.distortion)
        finest = ((xx + yy) / 2.0 + np.hypot((xx - yy) / 2.0, xy)).max()
        focal_px = np.array([self.fx_px, self.fy_px])
        extent_px = (high - low) * focal_px
        max_pixels = _MAX_IDEAL_PIXEL_RATIO * self.width_px * self.height_px
        scale = min(finest, math.sqrt(max_pixels / extent_px.prod()), _MAX_IDEAL_SIZE_PX / extent_px.max())
        width_px, height_px = np.ceil(extent_px * scale).astype(int) + 1 + 2 * _MARGIN_PX
        center_px = _MARGIN_PX - low * focal_px * scale
        return PinholeCamera(int(width_px), int(height_px), *(focal_px * scale).tolist(), *center_px.tolist())

    def project(self, points_optical: Float64Array) -> Float64Array:
        """(N, 2) pixels as in ``PinholeCamera``; NaN for points too far off the axis for the model to be one-to-one."""
        plane_xy = points_optical[:, :2] / points_optical[:, 2:]
        seen = (plane_xy**2).sum(axis=1) <= self.max_radius2
        distorted = np.where(seen[:, None], _distort(plane_xy.T, self.distortion).T, np.nan)
        return distorted * [self.fx_px, self.fy_px] + [self.cx_px, self.cy_px]

    def rays(self, pixels: Float64Array) -> Float64Array:
        """(N, 3) rays as in ``PinholeCamera``, for pixels within the image; accurate to 1e-6 pixel."""
        return _homogeneous(self._undistort(self._plane(pixels)))

    @property
    def _radial_map(self) -> tuple[Float64Array, Float64Array]:
        return _radial_table(self.distortion)

    def _undistort(self, distorted: Float64Array) -> Float64Array:
        """(N, 2) undistorted points on the plane z = 1 for (N, 2) distorted ones, by Newton's method."""
        target = np.ascontiguousarray(distorted.T)
        radius = np.hypot(*target)
        plane_xy = target * (np.interp(radius, self._radial_map[1], self._radial_map[0]) / np.maximum(radius, 1e-12))
        for _ in range(_MAX_NEWTON_STEPS):
            error_x, error_y = _distort(plane_xy, self.distortion) - target
            xx, xy, yy = _distortion_derivatives(plane_xy, self.distortion)
            determinant = np.maximum(
                xx * yy - xy * xy, 1e-9
            )  # where not one-to-one: never converges; checked on creation
            step = np.stack([yy * error_x - xy * error_y, xx * error_y - xy * error_x]) / determinant
            plane_xy -= np.clip(step, -0.5, 0.5)
            if np.abs(step).max(initial=0.0) < _NEWTON_TOLERANCE:
                break
        return np.ascontiguousarray(plane_xy.T)

    def _raise_not_invertible(self) -> None:
        k1, k2, p1, p2, k3 = self.distortion
        raise InputError(
            f"distortion: k1 {k1:g}, k2 {k2:g}, p1 {p1:g}, p2 {p2:g}, k3 {k3:g} cannot be inverted over the whole "
            f"image of {self.width_px} x {self.height_px} pixels with fx {self.fx_px:.6g}, fy {self.fy_px:.6g}, "
            f"cx {self.cx_px:.6g}, cy {self.cy_px:.6g}: the distorted radius must grow with the angle to the optical "
            "axis up to every corner, and that angle must stay below 85°; use a narrower field of view, or "
            "coefficients that were fitted up to the corners"
        )


@lru_cache(maxsize=64)
def ideal_camera(camera: PinholeCamera) -> PinholeCamera:
    """Distortion-free camera that covers the whole view of ``camera``; ``camera`` itself if it has no distortion."""
    return camera.ideal() if isinstance(camera, LensCamera) else camera


def _homogeneous(plane_xy: Float64Array) -> Float64Array:
    return np.concatenate([plane_xy, np.ones((len(plane_xy), 1))], axis=1)


def _distort(plane_xy: Float64Array, distortion: tuple[float, ...]) -> Float64Array:
    """(2, N) distorted points on the plane z = 1 for (2, N) ideal ones (OpenCV, calib3d)."""
    k1, k2, p1, p2, k3 = distortion
    x, y = plane_xy
    r2 = x * x + y * y
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    return np.stack(
        [
            x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
            y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
        ]
    )


def _distortion_derivatives(plane_xy: Float64Array, distortion: tuple[float, ...]) -> Float64Array:
    """(3, N) derivatives of ``_distort``: xx, xy = yx, yy."""
    k1, k2, p1, p2, k3 = distortion
    x, y = plane_xy
    r2 = x * x + y * y
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    growth = 2.0 * (k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3))
    return np.stack(
        [
            radial + x * x * growth + 2.0 * p1 * y + 6.0 * p2 * x,
            x * y * growth + 2.0 * p1 * x + 2.0 * p2 * y,
            radial + y * y * growth + 6.0 * p1 * y + 2.0 * p2 * x,
        ]
    )


@lru_cache(maxsize=64)
def _radial_table(distortion: tuple[float, ...]) -> tuple[Float64Array, Float64Array]:
    """Radii on the plane z = 1 and their distorted radii, up to where the latter stop growing."""
    k1, k2, _, _, k3 = distortion
    roots = np.roots([7.0 * k3, 5.0 * k2, 3.0 * k1, 1.0])
    turning_radii = np.sqrt(roots.real[(np.abs(roots.imag) < 1e-12) & (roots.real > 0.0)])
    radii = np.linspace(0.0, min(turning_radii.min(initial=math.inf), math.tan(MAX_RAY_ANGLE_RAD)), _RADIAL_TABLE_SIZE)
    r2 = radii * radii
    return radii, radii * (1.0 + r2 * (k1 + r2 * (k2 + r2 * k3)))


def _lattice(width_px: int, height_px: int) -> Float64Array:
    """(N, 2) pixels on a regular lattice over the image, including its border half a pixel outside the centers."""
    u, v = np.linspace(-0.5, width_px - 0.5, _LATTICE_SIZE), np.linspace(-0.5, height_px - 0.5, _LATTICE_SIZE)
    return np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
