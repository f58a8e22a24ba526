"""What is certainly hidden behind what is already drawn: boxes are tested against the farthest depth of their pixels.

Conservative, so that leaving out what is hidden changes no pixel: pixels are taken together in blocks, a box is tested by
its projection's bounding rectangle, enlarged by a pixel, at the depth of its nearest corner, less a margin.
"""

from itertools import product
from typing import Self

import moderngl
import numpy as np

from simbev_ros.render.view import NEAR_M
from simbev_ros.types import BoolArray, Float32Array, Float64Array

_BLOCK_PX = 8

_MARGIN = 2e-6
"""Of the depth buffer's range 0..1. Vertices in float32 are right to 5e-7, markings are brought forward by 3e-7, and the
buffer's steps are 6e-8; as a length this is 0.2 m at 100 m, and grows with the square of the distance."""
_CORNERS = np.array(list(product((False, True), repeat=3)))


class Screen:
    """The depth buffer of a view, while it is being drawn."""

    def __init__(self, depth: Float32Array) -> None:
        """Take (H, W) depths, 0 near … 1 where nothing was drawn, row 0 for clip y = -1."""
        self._size_px = np.array(depth.shape[::-1])
        self._farthest = _range_maxima(_blocks_maxima(depth))

    @classmethod
    def of(cls, framebuffer: moderngl.Framebuffer) -> Self:
        """Read back the depth that was drawn so far."""
        width, height = framebuffer.size
        depth = np.empty((height, width), np.float32)
        framebuffer.read_into(depth, components=1, attachment=-1, dtype="f4")
        return cls(depth)

    def hides(self, clip_from_world: Float64Array, corners_m: Float64Array) -> BoolArray:
        """(N,) whether boxes with (N, 8, 3) corners in the world are hidden wholly."""
        corners_clip = corners_m @ clip_from_world[:, :3].T + clip_from_world[:, 3]
        in_front = corners_clip[:, :, 3].min(axis=1) > NEAR_M
        corners = corners_clip[in_front]
        places = corners[:, :, :3] / corners[:, :, 3:]
        hidden = np.zeros(len(corners_clip), bool)
        low, high = places[:, :, :2].min(axis=1), places[:, :, :2].max(axis=1)
        farthest = self._farthest_within((low + 1.0) / 2.0 * self._size_px - 1.0, (high + 1.0) / 2.0 * self._size_px + 1.0)
        hidden[in_front] = (places[:, :, 2].min(axis=1) + 1.0) / 2.0 > farthest + _MARGIN
        return hidden

    def _farthest_within(self, low_px: Float64Array, high_px: Float64Array) -> Float32Array:
        """(N,) farthest depth in rectangles between (N, 2) places, x and y; clipped to the picture's border."""
        first, last = (
            (np.clip(place, 0, self._size_px - 1) // _BLOCK_PX).astype(np.int64) for place in (low_px, high_px)
        )
        level = np.frexp(last - first + 1)[1] - 1  # of the largest power of two in it
        second = last + 1 - (1 << level)
        (i, j), (x0, y0), (x1, y1) = level.T, first.T, second.T
        table = self._farthest
        return np.maximum(
            np.maximum(table[j, i, y0, x0], table[j, i, y0, x1]), np.maximum(table[j, i, y1, x0], table[j, i, y1, x1])
        )


def box_corners(low_m: Float64Array, high_m: Float64Array) -> Float64Array:
    """(N, 8, 3) corners of axis-parallel boxes, given by two (N, 3) of them."""
    corners: Float64Array = np.where(_CORNERS, high_m[:, None], low_m[:, None])
    return corners


def _blocks_maxima(depth: Float32Array) -> Float32Array:
    """Farthest depth of each block of pixels."""
    rows, columns = (-(-size // _BLOCK_PX) for size in depth.shape)
    padded = np.zeros((rows * _BLOCK_PX, columns * _BLOCK_PX), np.float32)
    padded[: depth.shape[0], : depth.shape[1]] = depth
    stripes = padded.reshape(rows, _BLOCK_PX, -1).max(axis=1)
    blocks: Float32Array = np.maximum.reduce([stripes[:, start::_BLOCK_PX] for start in range(_BLOCK_PX)])
    return blocks


def _range_maxima(blocks: Float32Array) -> Float32Array:
    """(J, I, h, w) maxima of the 2^j x 2^i blocks from each on: four of them, overlapping, make up any rectangle."""
    height, width = blocks.shape
    table = np.empty((height.bit_length(), width.bit_length(), height, width), np.float32)
    table[0, 0] = blocks
    for i in range(1, table.shape[1]):
        step = 1 << i - 1
        table[0, i] = table[0, i - 1]
        np.maximum(table[0, i, :, :-step], table[0, i - 1, :, step:], out=table[0, i, :, :-step])
    for j in range(1, table.shape[0]):
        step = 1 << j - 1
        table[j] = table[j - 1]
        np.maximum(table[j, :, :-step], table[j - 1, :, step:], out=table[j, :, :-step])
    return table
