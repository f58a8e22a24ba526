"""Silhouettes of objects drawn alone: their pixel counts in the image and around it, and their 2D boxes.

``Contours`` of a camera enter, ``Silhouettes`` leave. A pixel belongs to a silhouette if its center lies inside. Along
a row of pixels, each contour segment changes the number of surfaces over a pixel by one, up or down. Pixels are counted
from step to step and never drawn, so large objects take no longer than small ones.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from simbev_ros.foundation.geometry.camera import LensCamera, PinholeCamera
from simbev_ros.foundation.geometry.fisheye import FisheyeCamera
from simbev_ros.foundation.geometry.ragged import ragged_indices
from simbev_ros.foundation.types import BoolArray, Float64Array, Int64Array
from simbev_ros.simulation.annotation.visibility.contours import Contours
from simbev_ros.simulation.annotation.visibility.lens_paths import bend_contours

_GRID_PX = 1.0 / 256.0
"""Vertex grid of OpenGL renderers; contour ends snap to it as well, unless a lens is in between."""


@dataclass(frozen=True, slots=True)
class Silhouettes:
    """Silhouettes of N objects. The canvas is the image plus a margin of its size on every side, nine times the area.

    Attributes:
        image_px: (N,) number of pixels in the image.
        canvas_px: (N,) number of pixels on the canvas.
        box_px: (N, 4) left, top, right, bottom of the silhouette on the canvas, with subpixel accuracy. Pixel centers
            are at integers, so that the canvas begins at -width - 0.5. NaN if nothing is on the canvas.
    """

    image_px: Int64Array
    canvas_px: Int64Array
    box_px: Float64Array


class _Runs(NamedTuple):
    """(S,) runs of pixels of objects; rows and columns count from the canvas origin."""

    slot: Int64Array
    row: Int64Array
    first: Int64Array
    end: Int64Array


def measure_silhouettes(contours: Contours, camera: PinholeCamera, count: int) -> Silhouettes:
    """Silhouettes of the objects 0 … count - 1 as a camera sees each of them alone."""
    if isinstance(camera, LensCamera):
        contours = bend_contours(contours, camera)
    ends_px = _pixels(contours.ends, camera)
    if not isinstance(camera, LensCamera | FisheyeCamera):
        ends_px = np.rint(ends_px / _GRID_PX) * _GRID_PX
    contours, width, height = contours._replace(ends=ends_px), camera.width_px, camera.height_px
    runs = _runs(contours, width, height)
    canvas_px = np.bincount(runs.slot, runs.end - runs.first, count)
    first, end = _seen_columns(camera, runs.row)
    within = np.clip(runs.end, first, end) - np.clip(runs.first, first, end)
    image_px = np.bincount(runs.slot, within * (runs.row // height == 1), count)
    return Silhouettes(
        image_px.astype(np.int64), canvas_px.astype(np.int64), _boxes(contours, runs, width, height, count)
    )


def _pixels(ends: Float64Array, camera: PinholeCamera) -> Float64Array:
    """(2, 2, M) pixel coordinates of positions on the plane z = 1, without distortion."""
    pixels: Float64Array = ends * np.array([camera.fx_px, camera.fy_px])[:, None, None]
    pixels += np.array([camera.cx_px, camera.cy_px])[:, None, None]
    return pixels


def _seen_columns(camera: PinholeCamera, row: Int64Array) -> tuple[Int64Array | int, Int64Array | int]:
    """First column and end of the image in (N,) rows of the canvas; of a fisheye, within its image circle."""
    width = camera.width_px
    if not isinstance(camera, FisheyeCamera):
        return width, 2 * width
    radius = camera.extended_radius(np.array(camera.seen_angle_rad))
    down = (row - camera.height_px - camera.cy_px) / camera.fy_px
    across_px = np.sqrt(np.maximum(radius**2 - down**2, 0.0)) * camera.fx_px
    first = np.clip(np.ceil(camera.cx_px - across_px), 0, width).astype(np.int64) + width
    end = np.clip(np.floor(camera.cx_px + across_px) + 1.0, 0, width).astype(np.int64) + width
    return first, np.where(np.abs(down) < radius, end, first)


def _runs(contours: Contours, width: int, height: int) -> _Runs:
    """Runs of pixels enclosed by contours with ends in pixels.

    The canvas rows of all objects are stacked; the last step of every row leads down to zero.
    """
    line, column, up = _steps(contours, width, height)
    bits = (3 * width).bit_length()
    steps = np.sort((line << bits | column) << 1 | up)
    start = np.flatnonzero(np.cumsum(2 * (steps & 1) - 1) > 0)
    position = steps >> 1
    slot, row = np.divmod(position[start] >> bits, 3 * height)
    column_mask = (1 << bits) - 1
    return _Runs(slot, row, position[start] & column_mask, position[start + 1] & column_mask)


def _steps(contours: Contours, width: int, height: int) -> tuple[Int64Array, Int64Array, Int64Array]:
    """(S,) line, first column, and direction (1 up, 0 down) of the step of each segment in each row."""
    start, end = contours.ends[:, 0], contours.ends[:, 1]
    first, last = (
        np.ceil(np.clip(border, -height, 2 * height)).astype(np.int64)
        for border in (np.minimum(start[1], end[1]), np.maximum(start[1], end[1]))
    )
    crossing = np.flatnonzero(last > first)
    (x, y), (run, rise), first = start[:, crossing], (end - start)[:, crossing], first[crossing]
    up = (rise > 0.0) == (contours.sign[crossing] > 0)
    segment, step = ragged_indices(last[crossing] - first)
    row = first[segment] + step
    crossing_x = x[segment] + (run / rise)[segment] * (row - y[segment])
    column = np.ceil(np.clip(crossing_x, -width, 2 * width)).astype(np.int64) + width
    return (contours.slot[crossing] * (3 * height) + height)[segment] + row, column, up.astype(np.int64)[segment]


def _boxes(contours: Contours, runs: _Runs, width: int, height: int, count: int) -> Float64Array:
    """(N, 4) ``Silhouettes.box_px``: bounds of the contours, extended to the canvas borders that pixels touch."""
    min_px, max_px = np.array([-width - 0.5, -height - 0.5]), np.array([2 * width - 0.5, 2 * height - 0.5])
    box_px = _bounding_boxes(contours.slot, contours.ends, count)
    beyond: BoolArray = np.any((box_px < np.tile(min_px, 2)) | (box_px > np.tile(max_px, 2)), axis=1)
    slot, ends_px = _clip_to_canvas(contours, np.flatnonzero(beyond[contours.slot]), min_px, max_px)
    box_px[beyond] = _bounding_boxes(slot, ends_px, count)[beyond]
    for border, at_border, limit in zip(
        box_px.T,
        (runs.first == 0, runs.row == 0, runs.end == 3 * width, runs.row == 3 * height - 1),
        (*min_px, *max_px),
        strict=True,
    ):
        border[runs.slot[at_border]] = limit
    return box_px


def _bounding_boxes(slot: Int64Array, ends_px: Float64Array, count: int) -> Float64Array:
    """(N, 4) bounding boxes of the segments of each object, NaN where it has none."""
    low, high = np.full((2, count), np.nan), np.full((2, count), np.nan)
    for axis, (start, end) in enumerate(ends_px):
        np.fmin.at(low[axis], slot, np.minimum(start, end))
        np.fmax.at(high[axis], slot, np.maximum(start, end))
    return np.concatenate([low, high]).T


def _clip_to_canvas(
    contours: Contours, selected: Int64Array, min_px: Float64Array, max_px: Float64Array
) -> tuple[Int64Array, Float64Array]:
    """(K,) objects and (2, 2, K) ends of the selected segments, clipped to a rectangle (Liang, Barsky 1984)."""
    start, end = contours.ends[:, 0, selected], contours.ends[:, 1, selected]
    run = end - start
    limits = np.stack([min_px, max_px])[:, :, None]
    shares = (limits - start) / np.where(run == 0.0, 1.0, run)
    shares = np.where(run == 0.0, np.where(limits < start, -np.inf, np.inf), shares)  # parallel: always or never inside
    enters, leaves = shares.min(axis=0).max(axis=0).clip(min=0.0), shares.max(axis=0).min(axis=0).clip(max=1.0)
    kept = np.flatnonzero(enters <= leaves)
    ends = [start[:, kept] + run[:, kept] * share[kept] for share in (enters, leaves)]
    return contours.slot[selected[kept]], np.stack(ends, axis=1)
