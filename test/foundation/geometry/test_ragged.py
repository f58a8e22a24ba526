"""Segments of different lengths in one flat array."""

import numpy as np

from simbev_ros.foundation.geometry.ragged import ragged_indices, ragged_starts

COUNTS = np.array([2, 0, 3, 1])


def test_each_element_knows_its_segment_and_its_offset() -> None:
    segment, offset = ragged_indices(COUNTS)
    assert segment.tolist() == [0, 0, 2, 2, 2, 3]
    assert offset.tolist() == [0, 1, 0, 1, 2, 0]
    assert segment.dtype == offset.dtype == np.int64


def test_segments_start_where_the_ones_before_end() -> None:
    assert ragged_starts(COUNTS).tolist() == [0, 2, 2, 5]


def test_no_segments_have_no_elements() -> None:
    segment, offset = ragged_indices(np.zeros(0, np.int64))
    assert len(segment) == len(offset) == 0
