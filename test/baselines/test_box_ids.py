"""Boxes keep their ids while they move as predicted; others get new ones."""

import numpy as np

from simbev_ros.baselines.boxes import BOX_DTYPE
from simbev_ros.baselines.node.ids import BoxIds
from simbev_ros.foundation.types import Table


def boxes(*rows: tuple[float, float, float, int]) -> Table:
    """Boxes with x, y, velocity along x, and class."""
    table = np.zeros(len(rows), BOX_DTYPE)
    for box, (x, y, vx, label) in zip(table, rows, strict=True):
        box["x"], box["y"], box["vx"], box["class"] = x, y, vx, label
    return table


def test_a_box_that_moves_at_its_velocity_keeps_its_id() -> None:
    ids = BoxIds()
    assert ids.assign(boxes((0, 0, 20, 0), (0, 5, 0, 0)), 1.0).tolist() == [1, 2]
    assert ids.assign(boxes((0.1, 5, 0, 0), (10, 0, 20, 0)), 1.5).tolist() == [2, 1]


def test_ids_go_to_the_nearest_box_of_the_same_class() -> None:
    ids = BoxIds()
    ids.assign(boxes((0, 0, 0, 0)), 1.0)
    assert ids.assign(boxes((0.1, 0, 0, 5), (1.5, 0, 0, 0), (-0.5, 0, 0, 0)), 1.1).tolist() == [2, 3, 1]


def test_an_object_keeps_its_id_when_it_is_missed_for_a_moment_only() -> None:
    ids = BoxIds()
    ids.assign(boxes((0, 0, 0, 0)), 1.0)
    assert ids.assign(boxes(), 1.2).tolist() == []
    assert ids.assign(boxes((0, 0, 0, 0)), 1.4).tolist() == [1]
    ids.assign(boxes(), 2.6)
    assert ids.assign(boxes((0, 0, 0, 0)), 2.8).tolist() == [2]


def test_ids_are_new_when_time_goes_back() -> None:
    ids = BoxIds()
    ids.assign(boxes((0, 0, 0, 0)), 5.0)
    assert ids.assign(boxes((0, 0, 0, 0)), 1.0).tolist() == [2]
