"""Road and box scores equal cells worked out by hand."""

import numpy as np
import pytest

from simbev_ros.foundation.geometry.grid import BevGrid
from simbev_ros.foundation.semantics import BEV_CLASSES
from simbev_ros.reference_stack.classes import load_kinds
from simbev_ros.reference_stack.grid import CHANNELS, GridShape, RoadMemory, box_scores
from simbev_ros.reference_stack.ground import SECTORS, Ground
from simbev_ros.reference_stack.pipeline import BOX_DTYPE

SHAPE = GridShape(4, 6, 1.0)
"""Cell centers at x = 1.5 0.5 -0.5 -1.5 and y = 2.5 1.5 0.5 -0.5 -1.5 -2.5."""
TURNED = np.array([[0.0, -1.0, 0.0, 100.0], [1.0, 0.0, 0.0, 50.0], [0.0, 0.0, 1.0, 3.0], [0.0, 0.0, 0.0, 1.0]])
"""``map_from_ego`` of an ego at (100, 50) that faces along y."""


def _box(x: float, y: float, yaw: float, length: float, width: float, score: float) -> np.ndarray:
    box = np.zeros(1, BOX_DTYPE)
    for name, value in (("x", x), ("y", y), ("yaw", yaw), ("length", length), ("width", width), ("score", score)):
        box[name] = value
    return box


def _ground(road_m: float, has_curb: bool) -> Ground:
    return Ground(np.zeros(0), np.full(SECTORS, road_m), np.full(SECTORS, has_curb))


def test_channels_and_layout_are_those_of_the_graph() -> None:
    assert CHANNELS == BEV_CLASSES
    assert SHAPE.centers_ego == pytest.approx(BevGrid(4, 6, 1.0).centers_ego)


def test_box_covers_the_cells_whose_centers_are_inside() -> None:
    box = _box(0.5, 1.0, 0.0, 2.2, 1.4, 0.8)  # x -0.6 … 1.6, y 0.3 … 1.7
    car = box_scores(box, load_kinds(), SHAPE, np.eye(4))[..., CHANNELS.index("car")]
    assert np.argwhere(car).tolist() == [[0, 1], [0, 2], [1, 1], [1, 2], [2, 1], [2, 2]]
    assert set(car[car > 0]) == {int(255 * np.float32(0.8))}


def test_box_in_the_map_frame_is_transformed_to_the_ego_frame() -> None:
    there = _box(99.0, 50.5, np.pi / 2, 2.2, 1.4, 0.8)  # 0.5 ahead, 1 to the left
    here = _box(0.5, 1.0, 0.0, 2.2, 1.4, 0.8)
    kinds = load_kinds()
    assert np.array_equal(box_scores(there, kinds, SHAPE, TURNED), box_scores(here, kinds, SHAPE, np.eye(4)))


def test_highest_score_counts_and_boxes_off_the_grid_are_ignored() -> None:
    boxes = np.concatenate([_box(0.5, 0.5, 0, 1, 1, 0.2), _box(0.5, 0.5, 0, 1, 1, 0.6), _box(50, 0, 0, 4, 2, 1.0)])
    grid = box_scores(boxes, load_kinds(), SHAPE, np.eye(4))
    assert np.argwhere(grid).tolist() == [[1, 2, CHANNELS.index("car")]]
    assert grid.max() == int(255 * np.float32(0.6))


def test_cells_up_to_the_end_of_the_road_are_road() -> None:
    scores = RoadMemory(SHAPE).add_ground(_ground(1.0, False), np.eye(4))
    assert np.argwhere(scores).tolist() == [[1, 2], [1, 3], [2, 2], [2, 3]]


def test_road_score_rises_with_observations_and_falls_behind_the_curb() -> None:
    memory = RoadMemory(SHAPE)
    first = memory.add_ground(_ground(1.0, True), np.eye(4))
    second = memory.add_ground(_ground(2.0, True), np.eye(4))
    assert first[1, 2] == 127
    assert second[1, 2] == 170  # 2 of 2 observations, and the prior
    assert second[0, 2] == 85  # 1.58 m away: behind the curb, then in front of it


def test_road_stays_fixed_to_the_map_while_the_ego_moves_and_turns() -> None:
    memory, no_road = RoadMemory(SHAPE), _ground(0.0, False)
    ahead = np.eye(4)
    ahead[0, 3] = 1.0
    memory.add_ground(_ground(1.0, False), np.eye(4))
    behind = memory.add_ground(no_road, ahead)
    assert np.argwhere(behind).tolist() == [[2, 2], [2, 3], [3, 2], [3, 3]]
    turned = np.eye(4)
    turned[:2, :2] = [[0.0, -1.0], [1.0, 0.0]]
    turned[0, 3] = 1.0  # at the same position, facing left: the road lies on its left
    assert np.argwhere(memory.add_ground(no_road, turned)).tolist() == [[1, 1], [1, 2], [2, 1], [2, 2]]


def test_grid_stays_level_on_a_steep_road() -> None:
    box, kinds, pitch = _box(1.4, 0.4, 0.3, 1.6, 0.8, 0.9), load_kinds(), 0.6
    steep = np.eye(4)
    steep[0, [0, 2]], steep[2, [0, 2]] = [np.cos(pitch), np.sin(pitch)], [-np.sin(pitch), np.cos(pitch)]
    assert np.array_equal(box_scores(box, kinds, SHAPE, steep), box_scores(box, kinds, SHAPE, np.eye(4)))
    scores = [RoadMemory(SHAPE).add_ground(_ground(1.5, False), pose) for pose in (steep, np.eye(4))]
    assert np.array_equal(*scores)


def test_road_far_behind_is_forgotten() -> None:
    memory, no_road, far = RoadMemory(SHAPE), _ground(0.0, False), np.eye(4)
    memory.add_ground(_ground(1.0, False), np.eye(4))
    far[:2, 3] = 300.0, -40.0
    assert not memory.add_ground(no_road, far).any()
    assert not memory.add_ground(no_road, np.eye(4)).any()
