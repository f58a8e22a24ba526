"""Fisheye camera: the equidistant model with distortion, and the ideal cameras that cover its view.

A ray at the angle θ to the optical axis meets the image at θ (1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸) from the principal
point, in units of the focal length (Kannala and Brandt 2006). One pinhole camera cannot see 180° and more, so the
view is covered by faces of a cube around the optical center.
"""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np

from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.geometry.camera import PinholeCamera
from simbev_ros.foundation.types import BoolArray, Float64Array

MAX_ANGLE_RAD: Final = math.radians(120.0)
"""Maximum angle between the optical axis and a ray; the five faces of the cube in front and beside see up to 125°."""

_ANGLES_RAD: Final = np.linspace(0.0, MAX_ANGLE_RAD, 4097)
_MIN_SLOPE = 1e-3
"""Derivative of the radius by the angle below which the model no longer counts as one-to-one."""

_MIN_EXTENDED_SLOPE = 0.1
_MAX_NEWTON_STEPS = 12
_NEWTON_TOLERANCE = 1e-12
_LATTICE_SIZE = 257
_MARGIN_PX = 4
_MAX_PIXEL_RATIO = 4.0
_MAX_SIDE_PX = 8192
_MIN_CIRCLE_PX = 16
_FINITE_STEP = 1e-4


@dataclass(frozen=True, slots=True)
class FisheyeCamera(PinholeCamera):
    """Camera with a fisheye lens: ``cv2.fisheye``, and ``equidistant`` in sensor_msgs/CameraInfo.

    Attributes:
        distortion: k1, k2, k3, k4.
        max_angle_rad: Angle to the optical axis at which the image circle ends; pixels outside it see nothing.

    Raises:
        InputError: The distortion is not one-to-one within the image and its circle, or the principal point is outside
            the image.
    """

    distortion: tuple[float, ...]
    max_angle_rad: float

    def __post_init__(self) -> None:
        """Reject coefficients that cannot be inverted where the image needs it."""
        corner = np.abs(self._plane(np.array([[-0.5, -0.5], [self.width_px - 0.5, self.height_px - 0.5]]))).max(axis=0)
        if self._reach_rad < self.max_angle_rad and np.hypot(*corner) > self._radius(self._reach_rad):
            raise InputError(
                f"distortion: k1, k2, k3, k4 {_listed(self.distortion)}: the radius in the image grows "
                f"with the angle to the optical axis only up to {math.degrees(self._reach_rad):.4g}°, which lies "
                f"within the image of {self.width_px} x {self.height_px} pixels; take an image circle of at most "
                f"{2.0 * math.degrees(self._reach_rad):.4g}°, or coefficients that were fitted up to the corners"
            )
        if not (-0.5 <= self.cx_px <= self.width_px - 0.5 and -0.5 <= self.cy_px <= self.height_px - 0.5):
            raise InputError(
                f"cx {self.cx_px:g}, cy {self.cy_px:g}: the principal point of a fisheye must lie in its image of "
                f"{self.width_px} x {self.height_px} pixels"
            )
        diameter_px = 2.0 * float(self._radius(self.seen_angle_rad)) * min(self.fx_px, self.fy_px)
        if diameter_px < _MIN_CIRCLE_PX:
            raise InputError(
                f"fx {self.fx_px:g}, fy {self.fy_px:g}: the image circle of a fisheye would be {diameter_px:.3g} "
                f"pixels across; at least {_MIN_CIRCLE_PX} are needed"
            )

    @property
    def seen_angle_rad(self) -> float:
        """Angle to the optical axis up to which directions have a pixel, which may be outside the image."""
        return min(self.max_angle_rad, self._reach_rad)

    def project(self, points_optical: Float64Array) -> Float64Array:
        """(N, 2) pixels of (N, 3) points in any direction, optical frame; NaN outside the image circle."""
        across = np.hypot(points_optical[:, 0], points_optical[:, 1])
        angle = np.arctan2(across, points_optical[:, 2])
        scale = self._radius(np.where(angle <= self.seen_angle_rad, angle, np.nan)) / np.where(across > 0, across, 1.0)
        return points_optical[:, :2] * scale[:, None] * [self.fx_px, self.fy_px] + [self.cx_px, self.cy_px]

    def rays(self, pixels: Float64Array) -> Float64Array:
        """(N, 3) unit vectors through (N, 2) pixels, optical frame; NaN outside the image circle.

        A ray times the depth, which fisheye cameras measure along the ray, is the point seen.
        """
        plane = self._plane(pixels)
        radius = np.hypot(*plane.T)
        angle = self._angle(np.where(radius <= self._radius(self.seen_angle_rad), radius, np.nan))
        across = plane * (np.sin(angle) / np.where(radius > 0.0, radius, 1.0))[:, None]
        return np.concatenate([across, np.cos(angle)[:, None]], axis=1)

    def extended_radius(self, angle_rad: Float64Array) -> Float64Array:
        """Distances from the principal point, in focal lengths; beyond the image circle, they continue linearly."""
        rim_rad = np.array(self.seen_angle_rad)
        slope = np.maximum(_slope(self.distortion, rim_rad), _MIN_EXTENDED_SLOPE)
        return self._radius(np.minimum(angle_rad, rim_rad)) + slope * np.maximum(angle_rad - rim_rad, 0.0)

    def depth_m(self, points_optical: Float64Array) -> Float64Array:
        """(N,) depth of (N, 3) points: the distance, because a depth along the axis ends at 90°."""
        return np.linalg.norm(points_optical, axis=1)

    def relative_illumination(self, rays: Float64Array) -> Float64Array:
        """(N,) solid angles of the pixels of (N, 3) rays, relative to that on the optical axis."""
        angle = np.arctan2(np.hypot(rays[:, 0], rays[:, 1]), rays[:, 2])
        area = np.where(angle > 0.0, self._radius(angle) * _slope(self.distortion, angle), 1.0)
        return np.where(angle > 0.0, np.sin(angle), 1.0) / area

    @property
    def _reach_rad(self) -> float:
        return _one_to_one_rad(self.distortion)

    def _radius(self, angle_rad: Float64Array | float) -> Float64Array:
        return _radius(self.distortion, angle_rad)

    def _angle(self, radius: Float64Array) -> Float64Array:
        """Angles to the optical axis at distances from the principal point, by Newton's method."""
        table = _ANGLES_RAD[self._reach_rad >= _ANGLES_RAD]
        angle = np.interp(radius, self._radius(table), table)
        for _ in range(_MAX_NEWTON_STEPS):
            step = (self._radius(angle) - radius) / _slope(self.distortion, angle)
            angle = np.clip(angle - step, 0.0, self._reach_rad)
            if not (np.abs(step) > _NEWTON_TOLERANCE).any():
                break
        return angle


def focal_length_px(width_px: int, horizontal_fov_rad: float, distortion: tuple[float, ...]) -> float:
    """Focal length of a fisheye whose image has a field of view, edge to edge, with the principal point in the middle.

    Raises:
        InputError: The distortion is not one-to-one up to the edge.
    """
    if horizontal_fov_rad / 2.0 > _one_to_one_rad(distortion):
        raise InputError(
            f"distortion: k1, k2, k3, k4 {_listed(distortion)}: the radius in the image grows with the angle to the "
            f"optical axis only up to {math.degrees(_one_to_one_rad(distortion)):.4g}°, which is less than half of the "
            f"horizontal field of view of {math.degrees(horizontal_fov_rad):.4g}°"
        )
    return width_px / 2.0 / float(_radius(distortion, horizontal_fov_rad / 2.0))


class Face(NamedTuple):
    """An ideal camera that sees part of a fisheye's view.

    Attributes:
        camera: The ideal camera.
        optical_from_face: (3, 3) rotation to the fisheye's optical frame; a permutation of axes, up to signs.
    """

    camera: PinholeCamera
    optical_from_face: Float64Array


_FACE_AXES: Final = {
    "front": ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
    "right": ((0, 0, -1), (0, 1, 0), (1, 0, 0)),
    "left": ((0, 0, 1), (0, 1, 0), (-1, 0, 0)),
    "bottom": ((1, 0, 0), (0, 0, -1), (0, 1, 0)),
    "top": ((1, 0, 0), (0, 0, 1), (0, -1, 0)),
}
"""x, y and z axes of each face in the optical frame."""


@lru_cache(maxsize=64)
def cube_faces(camera: FisheyeCamera) -> tuple[Face, ...]:
    """The faces that a fisheye's image needs, the front one first; each is nowhere coarser than the image.

    A ray belongs to the face along whose axis it is longest. Faces extend a few pixels beyond that. All are made
    coarser where they would have more than four times as many pixels as the image.
    """
    radius = float(_radius(camera.distortion, camera.seen_angle_rad))
    x_px, y_px = (
        np.linspace(max(-0.5, center - radius * focal), min(size - 0.5, center + radius * focal), _LATTICE_SIZE)
        for size, center, focal in (
            (camera.width_px, camera.cx_px, camera.fx_px),
            (camera.height_px, camera.cy_px, camera.fy_px),
        )
    )
    rays = camera.rays(np.stack(np.meshgrid(x_px, y_px), axis=-1).reshape(-1, 2))
    rays = rays[~np.isnan(rays[:, 0])]
    cell_px = math.hypot(x_px[1] - x_px[0], y_px[1] - y_px[0])
    slope = _slope(camera.distortion, _ANGLES_RAD[camera.seen_angle_rad >= _ANGLES_RAD]).min()
    cell_rad = math.hypot((x_px[1] - x_px[0]) / camera.fx_px, (y_px[1] - y_px[0]) / camera.fy_px) / float(slope)
    needed = []
    for axes in _FACE_AXES.values():
        optical_from_face = np.array(axes, np.float64).T
        rays_face = rays @ optical_from_face
        rays_face = rays_face[_belongs(rays_face, min(2.0 * cell_rad, 0.5))]
        if len(rays_face):
            plane = rays_face[:, :2] / rays_face[:, 2:]
            finest_px, coarsest_px = _resolutions(camera, plane, optical_from_face)
            limits = np.clip(
                [plane.min(axis=0) - cell_px / coarsest_px, plane.max(axis=0) + cell_px / coarsest_px], -1.0, 1.0
            )
            needed.append((optical_from_face, limits, finest_px))
    pixels = sum(np.prod((limits[1] - limits[0]) * focal_px) for _, limits, focal_px in needed)
    scale = min(1.0, math.sqrt(_MAX_PIXEL_RATIO * camera.width_px * camera.height_px / pixels))
    return tuple(Face(_cropped(limits, focal_px * scale), rotation) for rotation, limits, focal_px in needed)


def _belongs(rays_face: Float64Array, tolerance: float) -> BoolArray:
    """(N,) whether rays belong to a face, in whose frame they are given, or nearly so."""
    return rays_face[:, 2] >= (1.0 - tolerance) * np.abs(rays_face[:, :2]).max(axis=1)


def _resolutions(camera: FisheyeCamera, plane: Float64Array, optical_from_face: Float64Array) -> tuple[float, float]:
    """Largest and smallest number of the image's pixels per unit on the plane z = 1 of a face, in any direction."""
    columns = []
    for step in (np.array([_FINITE_STEP, 0.0]), np.array([0.0, _FINITE_STEP])):
        ends_px = [
            camera.project(np.column_stack([plane + sign * step, np.ones(len(plane))]) @ optical_from_face.T)
            for sign in (-1.0, 1.0)
        ]
        columns.append((ends_px[1] - ends_px[0]) / (2.0 * _FINITE_STEP))
    jacobian = np.stack(columns, axis=2)
    singular = np.linalg.svd(jacobian[np.isfinite(jacobian).all(axis=(1, 2))], compute_uv=False)
    return float(singular.max()), float(singular.min())


def _cropped(limits: Float64Array, focal_px: float) -> PinholeCamera:
    """The camera that sees a rectangle of the plane z = 1 and a small margin."""
    focal_px = min(focal_px, (_MAX_SIDE_PX - 2 * _MARGIN_PX - 2) / float((limits[1] - limits[0]).max()))
    width_px, height_px = np.ceil((limits[1] - limits[0]) * focal_px).astype(int) + 1 + 2 * _MARGIN_PX
    center_px = _MARGIN_PX - limits[0] * focal_px
    return PinholeCamera(int(width_px), int(height_px), focal_px, focal_px, *center_px.tolist())


def _radius(distortion: tuple[float, ...], angle_rad: Float64Array | float) -> Float64Array:
    """Distances from the principal point at angles to the optical axis, in focal lengths."""
    k1, k2, k3, k4 = distortion
    square = np.square(angle_rad)
    radius: Float64Array = angle_rad * (1.0 + square * (k1 + square * (k2 + square * (k3 + square * k4))))
    return radius


def _slope(distortion: tuple[float, ...], angle_rad: Float64Array) -> Float64Array:
    """Derivatives of ``_radius``."""
    k1, k2, k3, k4 = distortion
    square = angle_rad**2
    slope: Float64Array = 1.0 + square * (3 * k1 + square * (5 * k2 + square * (7 * k3 + square * 9 * k4)))
    return slope


@lru_cache(maxsize=64)
def _one_to_one_rad(distortion: tuple[float, ...]) -> float:
    """Angle to the optical axis up to which the radius grows with it."""
    turns = np.flatnonzero(_slope(distortion, _ANGLES_RAD) <= _MIN_SLOPE)
    return float(_ANGLES_RAD[turns[0] - 1] if len(turns) else MAX_ANGLE_RAD)


def _listed(distortion: tuple[float, ...]) -> str:
    return ", ".join(f"{k:g}" for k in distortion)
