"""Ragged arrays: N segments of different lengths, one after the other in one flat array."""

import numpy as np

from simbev_ros.foundation.types import AnyArray, Int64Array


def ragged_starts(counts: AnyArray) -> Int64Array:
    """(N,) index of the first element of each segment, from their (N,) lengths."""
    return np.cumsum(counts) - counts


def ragged_indices(counts: AnyArray) -> tuple[Int64Array, Int64Array]:
    """Segment and offset of each element.

    Args:
        counts: (N,) length of each segment.

    Returns:
        (sum of counts,) index of the segment, and offset of the element within it, both int64.
    """
    segment = np.repeat(np.arange(len(counts)), counts)
    return segment, np.arange(len(segment)) - np.repeat(ragged_starts(counts), counts)
