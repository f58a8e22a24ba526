"""Contours distorted by a camera lens: straight segments become polylines of short segments.

Enters: ``Contours`` on the plane z = 1; leaves: ``Contours`` that a pinhole camera would map to the same pixels.
Outside the image, where the lens model is no longer valid, it is extrapolated: along each ray from the principal point,
everything is scaled as at the last valid point. So every direction in front of the camera has an image position.
"""

import numpy as np

from simbev_ros.foundation.geometry.camera import LensCamera
from simbev_ros.foundation.geometry.ragged import ragged_indices
from simbev_ros.foundation.types import Float64Array
from simbev_ros.simulation.annotation.visibility.contours import Contours

_MARGIN = 1.1
_DOMAIN_SHARE = 1.0 - 1e-6


def bend_contours(contours: Contours, camera: LensCamera) -> Contours:
    """Contours that a pinhole camera of the same intrinsics would see in the same pixels, accurate to 0.1 pixel."""
    radius = _MARGIN * _canvas_radius(camera)
    beyond = (np.abs(contours.ends) > radius).any(axis=(0, 1))
    points = _clamped_to_canvas(contours.ends[..., beyond], radius)
    start, end = (
        np.concatenate([contours.ends[:, end_index, ~beyond], bounded.reshape(2, -1)], axis=1)
        for end_index, bounded in enumerate((points[:, :-1], points[:, 1:]))
    )
    original = np.concatenate([np.flatnonzero(~beyond), np.tile(np.flatnonzero(beyond), 5)])
    step = 0.5 / np.sqrt(max(camera.fx_px, camera.fy_px))  # half the square root of the focal length, in pixels
    count = np.ceil(np.hypot(*(end - start)) / step).astype(np.int64)
    segment, offset = ragged_indices(count)
    start, end, count, original = start[:, segment], end[:, segment], count[segment], original[segment]
    ends = [_through_lens(_interpolate(start, end, share / count), camera) for share in (offset, offset + 1)]
    return Contours(contours.slot[original], contours.sign[original], np.stack(ends, axis=1))


def _clamped_to_canvas(ends: Float64Array, reach: float) -> Float64Array:
    """(2, 6, M) points along segments; those beyond ±reach are clamped, so that nothing inside changes."""
    start, end = ends[:, 0], ends[:, 1]
    run = end - start
    limits = np.array([-reach, reach])[:, None, None]
    shares = np.clip((limits - start) / np.where(run == 0.0, np.inf, run), 0.0, 1.0).reshape(4, -1)
    shares = np.concatenate([np.zeros_like(shares[:1]), np.sort(shares, axis=0), np.ones_like(shares[:1])])
    return np.clip(_interpolate(start[:, None], end[:, None], shares), -reach, reach)


def _interpolate(start: Float64Array, end: Float64Array, share: Float64Array) -> Float64Array:
    """Points between ``start`` and ``end``; at share 0 and 1 bit-equal to them."""
    return start * (1.0 - share) + end * share


def _through_lens(points: Float64Array, camera: LensCamera) -> Float64Array:
    """(2, N) points on the plane z = 1 after distortion by the lens."""
    scale = np.maximum(np.hypot(*points) / (np.sqrt(camera.max_radius2) * _DOMAIN_SHARE), 1.0)
    pixels = camera.project(np.stack([*(points / scale), np.ones_like(scale)], axis=1)).T
    return (pixels - [[camera.cx_px], [camera.cy_px]]) / [[camera.fx_px], [camera.fy_px]] * scale


def _canvas_radius(camera: LensCamera) -> float:
    """Maximum distance from the principal point, on the plane z = 1, of anything that appears on the canvas."""
    size_px = np.array([camera.width_px, camera.height_px])
    corners = (np.array([-size_px, 2 * size_px]) - [camera.cx_px, camera.cy_px]) / [camera.fx_px, camera.fy_px]
    widest = np.sqrt(camera.max_radius2)
    rim = _through_lens(widest * np.array([[1.0, -1.0, 0.0, 0.0], [0.0, 0.0, 1.0, -1.0]]), camera)
    max_radius = np.hypot(*np.abs(corners).max(axis=0))
    return float(widest * max(1.0, max_radius / np.hypot(*rim).min()))
