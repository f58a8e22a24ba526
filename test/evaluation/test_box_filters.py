"""Selection of the boxes that count, and conversion of box tables to columns."""

import numpy as np
import pytest

from simbev_ros.evaluation.filters import BoxFilter
from simbev_ros.evaluation.metrics.boxes import boxes_from_tables
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.types import Table
from simbev_ros.schema.boxes import blank_boxes


def table() -> Table:
    result = blank_boxes(4)
    result["distance"] = [10, 20, 30, 40]
    result["visibility"] = [0.9, 0.1, np.nan, 0.5]
    result["difficulty"] = [0, 1, 2, 2]
    result["lidar_points"] = [-1, 3, 0, 9]
    result["radar_points"] = [2, -1, -1, 1]
    return result


@pytest.mark.parametrize(
    ("condition", "expected"),
    [
        (BoxFilter(), [1, 1, 1, 1]),
        (BoxFilter(range_m=(20, 40)), [0, 1, 1, 0]),
        (BoxFilter(visibility=(0.5, np.inf)), [1, 0, 0, 1]),
        (BoxFilter(difficulties=("easy", "hard")), [1, 0, 1, 1]),
        (BoxFilter(points=(3, np.inf)), [0, 1, 0, 1]),
        (BoxFilter(seen=True), [1, 1, 0, 1]),
        (BoxFilter(range_m=(0, 30), points=(1, np.inf)), [1, 1, 0, 0]),
    ],
)
def test_only_boxes_that_meet_all_conditions_count(condition: BoxFilter, expected: list[int]) -> None:
    np.testing.assert_array_equal(condition.truth_mask(table()), np.array(expected, bool))


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"range_m": (40, 20)}, "range_m"),
        ({"visibility": (2, 3)}, "visibility"),
        ({"difficulties": ("impossible",)}, "easy, medium, hard"),
    ],
)
def test_impossible_conditions_are_refused(values: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        BoxFilter(**values)


def test_tables_become_columns_frame_by_frame() -> None:
    first, second = table()[:1], table()[1:3]
    second["x"], second["height"], second["vz"], second["class"] = [4, 5], [6, 7], [8, 9], [1, 2]
    boxes = boxes_from_tables({7: first, 3: second})
    np.testing.assert_array_equal(boxes.frame, [7, 3, 3])
    np.testing.assert_array_equal(boxes.center_m[:, 0], [0, 4, 5])
    np.testing.assert_array_equal(boxes.size_m[:, 2], [0, 6, 7])
    np.testing.assert_array_equal(boxes.velocity_mps[:, 2], [0, 8, 9])
    np.testing.assert_array_equal(boxes.label, [0, 1, 2])
    assert len(boxes_from_tables({})) == 0
