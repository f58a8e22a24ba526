"""Occlusion culling: finds objects that are certainly hidden behind what is already drawn, so skipping them is exact.

Objects are tested by their boxes, against the farthest depth drawn anywhere within their screen area. All errors are
conservative: pixels are grouped into blocks, and a box is replaced by the rectangle around its projection, one pixel
wider on each side, at the depth of its nearest corner, minus a margin.
"""

from collections.abc import Callable
from itertools import product
from typing import Self

import moderngl
import numpy as np

from simbev_ros.foundation.types import BoolArray, Float32Array, Float64Array
from simbev_ros.simulation.render.view import NEAR_M, View

_BLOCK_PX = 16
_MARGIN = 2e-6
"""Safety margin in the depth buffer's range 0..1: 0.2 m at 100 m, 1 cm at 20 m.

Float32 vertices are accurate to 5e-7, road markings are brought forward by 3e-7 (shaders/include/vertex.glsl), and the
buffer's steps are 6e-8.
"""
_CORNERS = np.array(list(product((False, True), repeat=3)))


class Occluders:
    """Depth buffer of a view that is still being drawn, for culling."""

    def __init__(self, depth: Float32Array) -> None:
        """Prepare (H, W) depths, 0 (near) … 1 (nothing drawn); row 0 is the image's top row."""
        self._size_px = np.array(depth.shape[::-1])
        rows = np.ascontiguousarray(_row_maxima(depth).T)
        self._farthest = _range_maxima(_row_maxima(rows).T)

    @classmethod
    def from_framebuffer(cls, framebuffer: moderngl.Framebuffer) -> Self:
        """Read back what has been drawn until now."""
        width, height = framebuffer.size
        depth = np.empty((height, width), np.float32)
        framebuffer.read_into(depth, components=1, attachment=-1, dtype="f4")
        return cls(depth)

    def hidden(self, view: View, low_m: Float64Array, high_m: Float64Array) -> BoolArray:
        """(N,) whether axis-aligned boxes, given by two (N, 3) world corners, are completely hidden."""
        clip_from_world = view.clip_from_world
        corners_m = np.where(_CORNERS, high_m[:, None], low_m[:, None])
        corners = corners_m @ clip_from_world[:, :3].T + clip_from_world[:, 3]
        is_hidden: BoolArray = corners[:, :, 3].min(axis=1) > NEAR_M
        screen_position = (corners[is_hidden, :, :3] / corners[is_hidden, :, 3:] + 1.0) / 2.0
        low, high = screen_position.min(axis=1), screen_position.max(axis=1)
        farthest = self._farthest_in(low[:, :2] * self._size_px - 1.0, high[:, :2] * self._size_px + 1.0)
        is_hidden[is_hidden] = low[:, 2] > farthest + _MARGIN
        return is_hidden

    def _farthest_in(self, low_px: Float64Array, high_px: Float64Array) -> Float32Array:
        """(N,) farthest depth in rectangles, given by two (N, 2) corners, x and y, clipped to the screen."""
        first, last = (
            np.clip(corner_px, 0, self._size_px - 1).astype(np.int64) // _BLOCK_PX for corner_px in (low_px, high_px)
        )
        level = np.frexp(last - first + 1)[1] - 1  # exponent of the largest powers of two that fit
        (i, j), (x0, y0), (x1, y1) = level.T, first.T, (last + 1 - (1 << level)).T
        return np.maximum.reduce([self._farthest[j, i, y, x] for y in (y0, y1) for x in (x0, x1)])


ReadOccluders = Callable[[], Occluders]
"""Reads the depth that is drawn until now. Only worth it on the CPU; a GPU would stall for longer than it draws."""


def _row_maxima(depth: Float32Array) -> Float32Array:
    """(R, W) farthest depths of blocks of rows; the last block overlaps if the rows do not fill it."""
    whole = depth[: len(depth) // _BLOCK_PX * _BLOCK_PX].reshape(-1, _BLOCK_PX, depth.shape[1])
    return np.concatenate([whole.max(axis=1), depth[-_BLOCK_PX:].max(axis=0, keepdims=True)])


def _range_maxima(blocks: Float32Array) -> Float32Array:
    """(J, I, h, w) maximum of the 2^j x 2^i blocks that begin at each block; four of them cover any rectangle."""
    height, width = blocks.shape
    maxima = np.empty((height.bit_length(), width.bit_length(), height, width), np.float32)
    maxima[:] = blocks
    for i in range(1, maxima.shape[1]):
        step = 1 << i - 1
        np.maximum(maxima[0, i - 1, :, :-step], maxima[0, i - 1, :, step:], out=maxima[0, i, :, :-step])
    for j in range(1, maxima.shape[0]):
        step = 1 << j - 1
        np.maximum(maxima[j - 1, :, :-step], maxima[j - 1, :, step:], out=maxima[j, :, :-step])
    return maxima
