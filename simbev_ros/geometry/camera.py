"""Camera models: the ideal pinhole, and the lens that bends its rays.

Pixel centres lie at integer coordinates (as in OpenCV and image_geometry); optical frame x right, y down, z forward.
"""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Self

import numpy as np

from simbev_ros.errors import InputError
from simbev_ros.types import Float64Array

WIDEST_RAD = math.radians(85.0)
"""The largest angle to the optical axis of a ray through a pixel."""

_STEPS = 12
_CONVERGED = 1e-6
"""Steps below this are the last: the error after a step of Newton's is about the square of the step."""

_TABLE_SIZE = 2049
_CHECKED_PX = 65
_MOST_IDEAL_PIXELS = 4.0
_LARGEST_IDEAL_PX = 8192
_MARGIN_PX = 2


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
        return _homogeneous(self._plane(pixels))

    def _plane(self, pixels: Float64Array) -> Float64Array:
        """(N, 2) places on the plane z = 1, of (N, 2) pixels."""
        places: Float64Array = (np.asarray(pixels, np.float64) - [self.cx_px, self.cy_px]) / [self.fx_px, self.fy_px]
        return places


@dataclass(frozen=True, slots=True)
class LensCamera(PinholeCamera):
    """A camera whose lens distorts by OpenCV's five-coefficient model, ``plumb_bob`` of sensor_msgs/CameraInfo.

    Attributes:
        distortion: k1, k2, p1, p2, k3.

    Raises:
        InputError: The model folds within the image, or a pixel looks more than 85° away from the optical axis.
    """

    distortion: tuple[float, ...]

    def __post_init__(self) -> None:
        """Refuse what cannot be inverted over the image."""
        pixels = _lattice(self.width_px, self.height_px)
        distorted = self._plane(pixels)
        if np.linalg.norm(distorted, axis=1).max() > self._radii[1][-1]:
            self._refuse()
        undistorted = self._undistorted(distorted)
        xx, xy, yy = _slopes(undistorted.T, self.distortion)
        missed = np.abs(_distorted(undistorted.T, self.distortion).T - distorted).max(axis=1)
        seen = np.linalg.norm(undistorted, axis=1) <= math.tan(WIDEST_RAD)
        if not ((xx * yy - xy * xy > 0.0) & (missed < 1e-9) & seen).all():
            self._refuse()

    @property
    def widest(self) -> float:
        """Largest x² + y² on the plane z = 1 up to which the model is one-to-one and within 85° of the axis."""
        return float(self._radii[0][-1] ** 2)

    def ideal(self) -> PinholeCamera:
        """A pinhole camera that sees all that this one sees, and nowhere more coarsely.

        Where that would be more than four times as many pixels it is coarser.
        """
        plane = self._undistorted(self._plane(_lattice(self.width_px, self.height_px)))
        low, high = plane.min(axis=0), plane.max(axis=0)
        xx, xy, yy = _slopes(plane.T, self.distortion)
        finest = ((xx + yy) / 2.0 + np.hypot((xx - yy) / 2.0, xy)).max()
        focal_px = np.array([self.fx_px, self.fy_px])
        extent_px = (high - low) * focal_px
        most = _MOST_IDEAL_PIXELS * self.width_px * self.height_px
        scale = min(finest, math.sqrt(most / extent_px.prod()), _LARGEST_IDEAL_PX / extent_px.max())
        width_px, height_px = np.ceil(extent_px * scale).astype(int) + 1 + 2 * _MARGIN_PX
        center_px = _MARGIN_PX - low * focal_px * scale
        return PinholeCamera(int(width_px), int(height_px), *(focal_px * scale).tolist(), *center_px.tolist())

    def project(self, points_optical: Float64Array) -> Float64Array:
        """As of the base; NaN for points that are so far off the axis that the model would fold them back."""
        places = points_optical[:, :2] / points_optical[:, 2:]
        seen = (places**2).sum(axis=1) <= self.widest
        bent = np.where(seen[:, None], _distorted(places.T, self.distortion).T, np.nan)
        return bent * [self.fx_px, self.fy_px] + [self.cx_px, self.cy_px]

    def rays(self, pixels: Float64Array) -> Float64Array:
        """As of the base, for pixels of the image; right to 1e-6 pixel."""
        return _homogeneous(self._undistorted(self._plane(pixels)))

    @property
    def _radii(self) -> tuple[Float64Array, Float64Array]:
        return _radial_table(self.distortion)

    def _undistorted(self, distorted: Float64Array) -> Float64Array:
        """(N, 2) places on the plane z = 1 that the lens moves to (N, 2) others: Newton's method."""
        target = np.ascontiguousarray(distorted.T)
        radius = np.hypot(*target)
        places = target * (np.interp(radius, self._radii[1], self._radii[0]) / np.maximum(radius, 1e-12))
        for _ in range(_STEPS):
            miss_x, miss_y = _distorted(places, self.distortion) - target
            xx, xy, yy = _slopes(places, self.distortion)
            determinant = np.maximum(xx * yy - xy * xy, 1e-9)  # folded: stays wrong, which the constructor finds
            step = np.stack([yy * miss_x - xy * miss_y, xx * miss_y - xy * miss_x]) / determinant
            places -= np.clip(step, -0.5, 0.5)
            if np.abs(step).max(initial=0.0) < _CONVERGED:
                break
        return np.ascontiguousarray(places.T)

    def _refuse(self) -> None:
        k1, k2, p1, p2, k3 = self.distortion
        raise InputError(
            f"distortion: k1 {k1:g}, k2 {k2:g}, p1 {p1:g}, p2 {p2:g}, k3 {k3:g} cannot be inverted over the whole "
            f"image of {self.width_px} x {self.height_px} pixels with fx {self.fx_px:.6g}, fy {self.fy_px:.6g}, "
            f"cx {self.cx_px:.6g}, cy {self.cy_px:.6g}: the distorted radius must grow with the angle to the optical "
            "axis up to every corner, and that angle stay below 85°; take a narrower field of view, or coefficients "
            "that were fitted up to the corners"
        )


@lru_cache(maxsize=64)
def ideal_camera(camera: PinholeCamera) -> PinholeCamera:
    """A camera that is free of distortion and sees all that ``camera`` sees; itself if it is."""
    return camera.ideal() if isinstance(camera, LensCamera) else camera


def _homogeneous(places: Float64Array) -> Float64Array:
    return np.concatenate([places, np.ones((len(places), 1))], axis=1)


def _distorted(places: Float64Array, distortion: tuple[float, ...]) -> Float64Array:
    """(2, N) places on the plane z = 1 where the lens moves (2, N) ideal ones (OpenCV, calib3d)."""
    k1, k2, p1, p2, k3 = distortion
    x, y = places
    r2 = x * x + y * y
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    return np.stack(
        [
            x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
            y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
        ]
    )


def _slopes(places: Float64Array, distortion: tuple[float, ...]) -> Float64Array:
    """(3, N) derivatives of ``_distorted``: xx, xy = yx, yy."""
    k1, k2, p1, p2, k3 = distortion
    x, y = places
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
    """Radii on the plane z = 1, and where the radial part moves them, as far as that grows."""
    k1, k2, _, _, k3 = distortion
    roots = np.roots([7.0 * k3, 5.0 * k2, 3.0 * k1, 1.0])
    turns = np.sqrt(roots.real[(np.abs(roots.imag) < 1e-12) & (roots.real > 0.0)])
    radii = np.linspace(0.0, min(turns.min(initial=math.inf), math.tan(WIDEST_RAD)), _TABLE_SIZE)
    r2 = radii * radii
    return radii, radii * (1.0 + r2 * (k1 + r2 * (k2 + r2 * k3)))


def _lattice(width_px: int, height_px: int) -> Float64Array:
    """(N, 2) pixels all over the image, its border among them; the border half a pixel outside the centres."""
    u, v = np.linspace(-0.5, width_px - 0.5, _CHECKED_PX), np.linspace(-0.5, height_px - 0.5, _CHECKED_PX)
    return np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
