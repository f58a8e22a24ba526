"""Contours as a lens bends them: straight segments become paths of short ones.

Where the model of the lens no longer holds, which is outside of the image, it is continued: along a ray from the
principal point all is scaled as at the last place where it holds. So every direction before the camera has a place.
"""

import numpy as np

from simbev_ros.annotation.occupancy.triangle_soup import counted
from simbev_ros.annotation.visibility.contours import Contours
from simbev_ros.geometry.camera import LensCamera
from simbev_ros.types import Float64Array

_MARGIN = 1.1
_HOLDS = 1.0 - 1e-6


def bent(contours: Contours, camera: LensCamera) -> Contours:
    """Contours that an ideal camera of the same intrinsics would see in the same pixels, good to 0.1 pixel."""
    reach = _MARGIN * _canvas_reach(camera)
    beyond = (np.abs(contours.ends) > reach).any(axis=(0, 1))
    points = _bounded(contours.ends[..., beyond], reach)
    start, end = (
        np.concatenate([contours.ends[:, place, ~beyond], bounded.reshape(2, -1)], axis=1)
        for place, bounded in enumerate((points[:, :-1], points[:, 1:]))
    )
    original = np.concatenate([np.flatnonzero(~beyond), np.tile(np.flatnonzero(beyond), 5)])
    step = 0.5 / np.sqrt(max(camera.fx_px, camera.fy_px))  # half the root of the focal length, in pixels
    count = np.ceil(np.hypot(*(end - start)) / step).astype(np.int64)
    segment, turn = counted(count)
    start, end, count, original = start[:, segment], end[:, segment], count[segment], original[segment]
    ends = [_through_lens(_between(start, end, share / count), camera) for share in (turn, turn + 1)]
    return Contours(contours.slot[original], contours.sign[original], np.stack(ends, axis=1))


def _bounded(ends: Float64Array, reach: float) -> Float64Array:
    """(2, 6, M) points along segments, those beyond ±reach moved to there, so that nothing within changes."""
    start, end = ends[:, 0], ends[:, 1]
    run = end - start
    limits = np.array([-reach, reach])[:, None, None]
    shares = np.clip((limits - start) / np.where(run == 0.0, np.inf, run), 0.0, 1.0).reshape(4, -1)
    shares = np.concatenate([np.zeros_like(shares[:1]), np.sort(shares, axis=0), np.ones_like(shares[:1])])
    return np.clip(_between(start[:, None], end[:, None], shares), -reach, reach)


def _between(start: Float64Array, end: Float64Array, share: Float64Array) -> Float64Array:
    """Points between others; at the shares 0 and 1 exactly those."""
    points: Float64Array = start * (1.0 - share) + end * share
    return points


def _through_lens(places: Float64Array, camera: LensCamera) -> Float64Array:
    """(2, N) places on the plane z = 1 to which (2, N) others are moved."""
    scale = np.maximum(np.hypot(*places) / (np.sqrt(camera.widest) * _HOLDS), 1.0)
    pixels = camera.project(np.stack([*(places / scale), np.ones_like(scale)], axis=1)).T
    moved: Float64Array = (pixels - [[camera.cx_px], [camera.cy_px]]) / [[camera.fx_px], [camera.fy_px]] * scale
    return moved


def _canvas_reach(camera: LensCamera) -> float:
    """How far from the principal point on the plane z = 1 anything is that can be seen on the canvas."""
    size_px = np.array([camera.width_px, camera.height_px])
    corners = (np.array([-size_px, 2 * size_px]) - [camera.cx_px, camera.cy_px]) / [camera.fx_px, camera.fy_px]
    widest = np.sqrt(camera.widest)
    rim = _through_lens(widest * np.array([[1.0, -1.0, 0.0, 0.0], [0.0, 0.0, 1.0, -1.0]]), camera)
    farthest = np.hypot(*np.abs(corners).max(axis=0))
    return float(widest * max(1.0, farthest / np.hypot(*rim).min()))
