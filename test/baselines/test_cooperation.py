"""Features and points of several agents come together where they belong."""

import numpy as np
import pytest

from simbev_ros.baselines.cooperation import (
    CellFeatures,
    fuse_features,
    level_from_level,
    moved_points,
    points_message_bytes,
)
from simbev_ros.baselines.grid import CELLS
from simbev_ros.foundation.geometry.transforms import matrices_from_xyz_rpy
from simbev_ros.foundation.types import Float64Array


def at(rows_and_columns: list[tuple[int, int]], values: list[list[float]]) -> CellFeatures:
    order = sorted(range(len(values)), key=lambda index: rows_and_columns[index])
    cells = [row * CELLS + column for row, column in (rows_and_columns[index] for index in order)]
    return CellFeatures(np.array(cells, np.int64), np.array([values[index] for index in order], np.float32))


def pose(x: float, y: float, z: float = 0.0, yaw_deg: float = 0.0, pitch_deg: float = 0.0) -> Float64Array:
    return matrices_from_xyz_rpy(np.array([x, y, z]), np.radians([0.0, pitch_deg, yaw_deg]))


def test_the_maximum_counts_where_both_agents_have_points() -> None:
    own = at([(10, 20), (10, 21)], [[1.0, 5.0], [0.0, 0.0]])
    other = at([(10, 20), (11, 30)], [[3.0, 2.0], [0.5, 0.0]])
    fused = fuse_features(own, [(other, np.eye(4))])
    wanted = at([(10, 20), (10, 21), (11, 30)], [[3.0, 5.0], [0.0, 0.0], [0.5, 0.0]])
    assert fused.cells.tolist() == wanted.cells.tolist()
    assert fused.values.tolist() == wanted.values.tolist()


@pytest.mark.parametrize(
    ("own_from_other", "expected"),
    [
        (pose(0.8, -0.4), (98, 201)),  # 0.8 m ahead are two rows up, 0.4 m to the right one column
        (pose(0.5, 0.1), (99, 200)),  # the cell in which the center lies
        (pose(0.0, 0.0, yaw_deg=90), (CELLS - 1 - 200, 100)),  # ahead of the other, to its right: left and ahead
        (pose(0.0, 0.0, yaw_deg=180), (CELLS - 1 - 100, CELLS - 1 - 200)),
    ],
)
def test_features_move_with_the_frame_of_their_sender(own_from_other: Float64Array, expected: tuple[int, int]) -> None:
    fused = fuse_features(at([(5, 5)], [[1.0]]), [(at([(100, 200)], [[7.0]]), own_from_other)])
    assert dict(zip(fused.cells.tolist(), fused.values[:, 0].tolist(), strict=True)) == {
        5 * CELLS + 5: 1.0,
        expected[0] * CELLS + expected[1]: 7.0,
    }


def test_features_beyond_the_grid_are_left_out() -> None:
    fused = fuse_features(at([(5, 5)], [[1.0]]), [(at([(1, 200), (0, 0)], [[7.0], [8.0]]), pose(0.8, 0.0))])
    assert fused.cells.tolist() == [5 * CELLS + 5]


def test_an_agent_without_points_adds_nothing_and_receives_all() -> None:
    nothing = CellFeatures(np.zeros(0, np.int64), np.zeros((0, 1), np.float32))
    own = at([(3, 4)], [[2.0]])
    assert fuse_features(own, [(nothing, np.eye(4))]).cells.tolist() == own.cells.tolist()
    assert fuse_features(nothing, [(own, np.eye(4))]).values.tolist() == [[2.0]]
    assert len(nothing.sent()[0].cells) == 0


def test_a_message_keeps_features_to_half_a_step_of_their_channel_and_is_smaller() -> None:
    rng = np.random.default_rng(0)
    values = (rng.random((500, 8)) * [1, 2, 4, 8, 16, 32, 64, 0]).astype(np.float32)
    features = CellFeatures(np.sort(rng.choice(CELLS * CELLS, 500, replace=False)), values)
    sent, size = features.sent()
    assert np.array_equal(sent.cells, features.cells)
    assert (np.abs(sent.values - values) <= values.max(axis=0) / 255 / 2 + 1e-5).all()
    assert 500 * 7 < size < values.nbytes / 2


def test_a_level_frame_keeps_headings_and_heights_of_the_map_and_drops_pitch() -> None:
    own, other = pose(10.0, 0.0, z=2.0, yaw_deg=90, pitch_deg=5), pose(10.0, 30.0, z=-1.0, yaw_deg=180, pitch_deg=-3)
    ahead_of_other = np.array([[4.0, 0.0, 0.5, 2.0]], np.float32)
    # The other is 30 m ahead and 3 m lower; 4 m ahead of it, to the west, are 4 m to the left.
    assert moved_points(ahead_of_other, level_from_level(own, other)) == pytest.approx(
        np.array([[30.0, 4.0, -2.5, 2.0]]), abs=1e-5
    )


def test_a_message_of_points_has_the_newest_sweep_within_the_grid() -> None:
    rng = np.random.default_rng(0)
    newest = np.column_stack([rng.uniform(-70, 70, (4000, 3)), np.zeros(4000)]).astype(np.float32)
    older, beyond = newest.copy(), newest.copy()
    older[:, 3], beyond[:, 0] = 1.0, 80.0
    size = points_message_bytes(newest)
    assert 4000 * 4 < size < 4000 * 6.1  # random points: 14 bits each
    assert points_message_bytes(np.concatenate([newest, older, beyond])) == size
