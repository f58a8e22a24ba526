"""Which objects an instance image shows: how many of its pixels, and where."""

from typing import NamedTuple

import numpy as np

from simbev_ros.types import AnyArray, Float64Array, Int64Array, UInt16Array


class Visible(NamedTuple):
    """Of N objects.

    Attributes:
        pixels: (N,) how many show it.
        box_px: (N, 4) left, top, right, bottom of the box around them, centres of pixels at integers; NaN: there are
            none.
    """

    pixels: Int64Array
    box_px: Float64Array


def visible(instance: UInt16Array, ids: AnyArray) -> Visible:
    """What an image (H, W) shows of at least one object with (N,) ascending ids.

    It is read in runs of equal pixels of a row.
    """
    width = instance.shape[1]
    labels = instance.ravel()
    begins = np.ones(len(labels), bool)
    np.not_equal(labels[1:], labels[:-1], out=begins[1:])
    begins[::width] = True
    start = np.flatnonzero(begins)
    length = np.diff(start, append=len(labels))
    index = np.searchsorted(ids, labels[start]).clip(max=len(ids) - 1)
    wanted = ids[index] == labels[start]
    start, length, index = start[wanted], length[wanted], index[wanted]
    row, column = np.divmod(start, width)
    low, high = np.full((2, len(ids)), np.inf), np.full((2, len(ids)), -np.inf)
    for axis, (first, last) in enumerate(((column, column + length - 1), (row, row))):
        np.minimum.at(low[axis], index, first)
        np.maximum.at(high[axis], index, last)
    box_px = np.concatenate([low - 0.5, high + 0.5]).T
    box_px[np.isinf(box_px)] = np.nan
    return Visible(np.bincount(index, length, len(ids)).astype(np.int64), box_px)
