"""Projects bird's-eye-view labels onto the ground in a camera's picture and tints the picture with their colors.

A camera, its pose, and the ground truth at its time enter; an image of labels and a tinted picture leave.
"""

from functools import lru_cache

import cv2
import numpy as np

from simbev_ros.foundation.geometry.camera import PinholeCamera
from simbev_ros.foundation.geometry.grid import BevGrid
from simbev_ros.foundation.geometry.transforms import inverse
from simbev_ros.foundation.semantics import BEV_CLASSES, Tag
from simbev_ros.foundation.types import Float32Array, Float64Array, Int64Array, UInt8Array, UInt16Array
from simbev_ros.schema.palette import bev_color
from simbev_ros.show.sheet.truth import Truth

GROUND_CLASSES = ("road", "hazard", "road_line", "sidewalk", "crosswalk")
"""Bird's-eye-view classes that lie on the ground."""

GROUND_BITS = np.uint16(sum(1 << BEV_CLASSES.index(name) for name in GROUND_CLASSES))
"""Their bits; other classes may move."""
_GROUND_TAGS = np.isin(np.arange(256), [Tag.ROAD, Tag.SIDEWALK, Tag.TERRAIN, Tag.ROAD_LINE, Tag.GROUND, Tag.BRIDGE])

_HEIGHT_M, _SLOPE = 0.4, 0.05
"""Tolerance around the ego's own plane within which a point counts as ground: constant part (m), and increase per
meter of depth."""

_STRENGTH = 0.55
"""Opacity of the tint."""


def ground_labels(
    camera: PinholeCamera,
    ego_from_optical: Float64Array,
    truth: Truth,
    cell_m: float,
    size_px: tuple[int, int],
    *,
    depth_m: Float32Array | None = None,
    tags: UInt8Array | None = None,
) -> UInt16Array:
    """The bird's-eye-view label of the ground that each pixel of a camera sees, 0 where it sees none.

    Args:
        camera: Model of the camera.
        ego_from_optical: (4, 4) pose of the camera's optical frame.
        truth: The labels and their pose; ``truth.labels`` must not be None.
        cell_m: Side of a cell of the labels.
        size_px: Width and height of the result; each of its pixels takes the nearest pixel of the camera.
        depth_m: (H, W) depth image of the camera; None: everything visible is assumed to be flat ground.
        tags: (H, W) semantic tags, which identify ground; None: everything close to the ego's plane counts as ground,
            except cells with a class that stands on the ground.

    Returns:
        (height, width) uint16, bit k for class k.
    """
    assert truth.labels is not None
    rows, columns = truth.labels.shape
    pixels, rays = _rays(camera, size_px)
    depth = _flat_depth_m(ego_from_optical, rays) if depth_m is None else depth_m[pixels].reshape(-1)
    near = depth < np.hypot(rows, columns) * cell_m
    if tags is not None:
        near &= _GROUND_TAGS[tags[pixels].reshape(-1)]
    seen = np.flatnonzero(near)
    points = rays[seen] * depth[seen, None]
    grid_from_optical = inverse(truth.map_from_grid) @ truth.map_from_ego @ ego_from_optical
    xy = _transform(grid_from_optical, points)
    height = _transform(ego_from_optical, points)[:, 2]
    row, column = np.rint(BevGrid(rows, columns, cell_m).cells_from_ego(xy.astype(np.float64)).T).astype(np.int32)
    ground = np.abs(height) < _HEIGHT_M + _SLOPE * depth[seen]
    ground &= (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
    found = truth.labels[row[ground], column[ground]]
    labels = np.zeros(depth.size, np.uint16)
    labels[seen[ground]] = np.where(found & ~GROUND_BITS, 0, found) if tags is None else found
    return labels.reshape(size_px[::-1])


def tint_ground(picture: UInt8Array, labels: UInt16Array) -> UInt8Array:
    """Blend the colors of labels into a picture.

    Args:
        picture: (H, W, 3) uint8 RGB.
        labels: (H, W) result of ``ground_labels``; 0 leaves a pixel unchanged.

    Returns:
        (H, W, 3) uint8 RGB.
    """
    mixed = cv2.addWeighted(picture, 1 - _STRENGTH, bev_color(labels), _STRENGTH, 0)
    return np.where((labels > 0)[..., None], mixed, picture)


def _flat_depth_m(ego_from_optical: Float64Array, rays: Float32Array) -> Float32Array:
    """(N,) depth at which (N, 3) rays meet the ego's own plane, m; infinite where they do not."""
    fall = ego_from_optical[2, 3] - _transform(ego_from_optical, rays)[:, 2]
    meets = fall > 1e-6
    return np.where(meets, ego_from_optical[2, 3] / np.where(meets, fall, 1), np.inf).astype(np.float32)


def _transform(target_from_source: Float64Array, points: Float32Array) -> Float32Array:
    """Transform (N, 3) points into the target frame; with OpenCV, because numpy would start threads."""
    if not len(points):
        return points
    return np.asarray(cv2.transform(points[:, None], target_from_source[:3])[:, 0], np.float32)


@lru_cache(maxsize=16)
def _rays(camera: PinholeCamera, size_px: tuple[int, int]) -> tuple[tuple[Int64Array, Int64Array], Float32Array]:
    """Camera pixels nearest to those of a (w, h) picture, rows (h, 1) and columns (1, w), and (h w, 3) rays."""
    u, v = (
        np.rint((np.arange(size) + 0.5) * full / size - 0.5).astype(np.int64)
        for size, full in zip(size_px, (camera.width_px, camera.height_px), strict=True)
    )
    pixels = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2).astype(np.float64)
    return (v[:, None], u[None]), camera.rays(pixels).astype(np.float32)
