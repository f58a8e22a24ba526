"""Counts the pixels of each object in an instance image and finds their bounds."""

from typing import NamedTuple

import numpy as np

from simbev_ros.foundation.types import AnyArray, Float64Array, Int64Array, UInt16Array


class VisiblePixels(NamedTuple):
    """Visible pixels of N objects.

    Attributes:
        pixels: (N,) number of pixels that show the object.
        box_px: (N, 4) left, top, right, bottom of the box around them, pixel centers at integers; NaN if there are
            none.
    """

    pixels: Int64Array
    box_px: Float64Array


def count_visible_pixels(instance: UInt16Array, ids: AnyArray) -> VisiblePixels:
    """Visible pixels of objects with (N,) ascending ids in an (H, W) instance image.

    The image is processed in runs of equal pixels per row.
    """
    if not len(ids):
        return VisiblePixels(np.zeros(0, np.int64), np.zeros((0, 4)))
    width = instance.shape[1]
    labels = instance.ravel()
    is_run_start = np.ones(len(labels), bool)
    np.not_equal(labels[1:], labels[:-1], out=is_run_start[1:])
    is_run_start[::width] = True
    start = np.flatnonzero(is_run_start)
    length = np.diff(start, append=len(labels))
    index = np.searchsorted(ids, labels[start]).clip(max=len(ids) - 1)
    requested = ids[index] == labels[start]
    start, length, index = start[requested], length[requested], index[requested]
    row, column = np.divmod(start, width)
    low, high = np.full((2, len(ids)), np.inf), np.full((2, len(ids)), -np.inf)
    for axis, (first, last) in enumerate(((column, column + length - 1), (row, row))):
        np.minimum.at(low[axis], index, first)
        np.maximum.at(high[axis], index, last)
    box_px = np.concatenate([low - 0.5, high + 0.5]).T
    box_px[np.isinf(box_px)] = np.nan
    return VisiblePixels(np.bincount(index, length, len(ids)).astype(np.int64), box_px)
