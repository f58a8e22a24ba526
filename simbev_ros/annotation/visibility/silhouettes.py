"""Objects drawn alone: how many pixels their silhouettes have in an image and around it, and how far they reach.

A pixel belongs to a silhouette if its centre lies within. Along a row of pixels each segment of a contour is one step
up or down of how many surfaces lie over a pixel. So pixels are counted from step to step and never drawn, which takes
no longer for large objects than for small ones.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from simbev_ros.annotation.occupancy.triangle_soup import counted
from simbev_ros.annotation.visibility.contours import Contours
from simbev_ros.annotation.visibility.lens_paths import bent
from simbev_ros.geometry.camera import LensCamera, PinholeCamera
from simbev_ros.types import BoolArray, Float64Array, Int64Array

_GRID_PX = 1.0 / 256.0
"""Renderers of OpenGL snap vertices to such a grid, and so does this where there is no lens in between."""


@dataclass(frozen=True, slots=True)
class Silhouettes:
    """Of N objects. The canvas is the image with as much again on every side, nine times as large.

    Attributes:
        image_px: (N,) pixels in the image.
        canvas_px: (N,) pixels on the canvas.
        box_px: (N, 4) left, top, right, bottom of the box around what is on the canvas, exact to fractions of pixels.
            Centres of pixels lie at integers, so that the canvas begins at -width - 0.5. NaN where nothing is.
    """

    image_px: Int64Array
    canvas_px: Int64Array
    box_px: Float64Array


class _Runs(NamedTuple):
    """(S,) runs of pixels of objects; rows and columns count from the canvas' first."""

    slot: Int64Array
    row: Int64Array
    first: Int64Array
    end: Int64Array


def silhouettes(contours: Contours, camera: PinholeCamera, count: int) -> Silhouettes:
    """The silhouettes of the objects 0 … count - 1 as a camera sees each of them alone."""
    if isinstance(camera, LensCamera):
        contours = bent(contours, camera)
        ends_px = _pixels(contours.ends, camera)
    else:
        ends_px = np.rint(_pixels(contours.ends, camera) / _GRID_PX) * _GRID_PX
    contours, width, height = contours._replace(ends=ends_px), camera.width_px, camera.height_px
    runs = _runs(contours, width, height)
    canvas_px = np.bincount(runs.slot, runs.end - runs.first, count)
    within = np.clip(runs.end, width, 2 * width) - np.clip(runs.first, width, 2 * width)
    image_px = np.bincount(runs.slot, within * (runs.row // height == 1), count)
    return Silhouettes(
        image_px.astype(np.int64), canvas_px.astype(np.int64), _boxes(contours, runs, width, height, count)
    )


def _pixels(ends: Float64Array, camera: PinholeCamera) -> Float64Array:
    """(2, 2, M) pixel coordinates of places on the plane z = 1, without distortion."""
    pixels: Float64Array = ends * np.array([camera.fx_px, camera.fy_px])[:, None, None]
    pixels += np.array([camera.cx_px, camera.cy_px])[:, None, None]
    return pixels


def _runs(contours: Contours, width: int, height: int) -> _Runs:
    """What contours with ends in pixels enclose.

    The canvas' rows of all objects lie one below the other; every row's last step leads down to zero.
    """
    line, column, up = _steps(contours, width, height)
    bits = (3 * width).bit_length()
    steps = np.sort((line << bits | column) << 1 | up)
    start = np.flatnonzero(np.cumsum(2 * (steps & 1) - 1) > 0)
    place = steps >> 1
    slot, row = np.divmod(place[start] >> bits, 3 * height)
    below = (1 << bits) - 1
    return _Runs(slot, row, place[start] & below, place[start + 1] & below)


def _steps(contours: Contours, width: int, height: int) -> tuple[Int64Array, Int64Array, Int64Array]:
    """(S,) line, first column, and whether it is a step up (1) or down (0), of each segment in each row."""
    start, end = contours.ends[:, 0], contours.ends[:, 1]
    first, last = (
        np.ceil(np.clip(border, -height, 2 * height)).astype(np.int64)
        for border in (np.minimum(start[1], end[1]), np.maximum(start[1], end[1]))
    )
    crossing = np.flatnonzero(last > first)
    (x, y), (run, rise), first = start[:, crossing], (end - start)[:, crossing], first[crossing]
    up = (rise > 0.0) == (contours.sign[crossing] > 0)
    segment, step = counted(last[crossing] - first)
    row = first[segment] + step
    place = x[segment] + (run / rise)[segment] * (row - y[segment])
    column = np.ceil(np.clip(place, -width, 2 * width)).astype(np.int64) + width
    return (contours.slot[crossing] * (3 * height) + height)[segment] + row, column, up.astype(np.int64)[segment]


def _boxes(contours: Contours, runs: _Runs, width: int, height: int, count: int) -> Float64Array:
    """(N, 4) ``Silhouettes.box_px``: around the contours on the canvas, and to its borders where pixels there are."""
    least, most = np.array([-width - 0.5, -height - 0.5]), np.array([2 * width - 0.5, 2 * height - 0.5])
    box_px = _around(contours.slot, contours.ends, count)
    beyond: BoolArray = np.any((box_px < np.tile(least, 2)) | (box_px > np.tile(most, 2)), axis=1)
    slot, ends_px = _on_canvas(contours, np.flatnonzero(beyond[contours.slot]), least, most)
    box_px[beyond] = _around(slot, ends_px, count)[beyond]
    for border, at_border, limit in zip(
        box_px.T,
        (runs.first == 0, runs.row == 0, runs.end == 3 * width, runs.row == 3 * height - 1),
        (*least, *most),
        strict=True,
    ):
        border[runs.slot[at_border]] = limit
    return box_px


def _around(slot: Int64Array, ends_px: Float64Array, count: int) -> Float64Array:
    """(N, 4) boxes around the segments of each object, NaN where it has none."""
    low, high = np.full((2, count), np.nan), np.full((2, count), np.nan)
    for axis, (start, end) in enumerate(ends_px):
        np.fmin.at(low[axis], slot, np.minimum(start, end))
        np.fmax.at(high[axis], slot, np.maximum(start, end))
    return np.concatenate([low, high]).T


def _on_canvas(
    contours: Contours, chosen: Int64Array, least: Float64Array, most: Float64Array
) -> tuple[Int64Array, Float64Array]:
    """(K,) objects and (2, 2, K) ends of what of the chosen segments lies within a rectangle (Liang, Barsky 1984)."""
    start, end = contours.ends[:, 0, chosen], contours.ends[:, 1, chosen]
    run = end - start
    limits = np.stack([least, most])[:, :, None]
    shares = (limits - start) / np.where(run == 0.0, 1.0, run)
    shares = np.where(
        run == 0.0, np.where(limits < start, -np.inf, np.inf), shares
    )  # parallel: within for ever or never
    enters, leaves = shares.min(axis=0).max(axis=0).clip(min=0.0), shares.max(axis=0).min(axis=0).clip(max=1.0)
    kept = np.flatnonzero(enters <= leaves)
    ends = [start[:, kept] + run[:, kept] * share[kept] for share in (enters, leaves)]
    return contours.slot[chosen[kept]], np.stack(ends, axis=1)
