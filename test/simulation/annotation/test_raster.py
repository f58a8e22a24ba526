import numpy as np
import pytest

from simbev_ros.foundation.types import BoolArray, Float64Array
from simbev_ros.simulation.annotation.bev.raster import corners_near_centers, covered_cells

ROWS, COLUMNS = 40, 56


def draw(corners: Float64Array, rows: int = ROWS, columns: int = COLUMNS) -> BoolArray:
    """(rows, columns) coverage of (T, 3, 2) triangles."""
    points = corners.reshape(-1, 2).T
    near, _ = corners_near_centers(points, np.arange(len(corners) * 3, dtype=np.int32).reshape(-1, 3), rows, columns)
    return covered_cells(near, np.zeros(near.shape[2], np.uint8), (1, rows, columns))[0]


def signed_distances(corners: Float64Array) -> Float64Array:
    """(T, rows, columns) distance of each center to the nearest edge line, negative outside; NaN without area."""
    centers = np.stack(np.meshgrid(np.arange(ROWS), np.arange(COLUMNS), indexing="ij"), axis=-1)
    edges = np.roll(corners, -1, axis=1) - corners
    to_center = centers - corners[:, :, None, None]
    cross = edges[:, :, None, None, 0] * to_center[..., 1] - edges[:, :, None, None, 1] * to_center[..., 0]
    orientation = np.sign(edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0])
    length = np.linalg.norm(edges, axis=2)[:, :, None, None]
    return (cross * orientation[:, None, None, None] / length).min(axis=1)


@pytest.mark.parametrize("size", [0.3, 3.0, 30.0, 3000.0])
def test_cells_are_covered_if_their_center_lies_in_a_triangle(size: float) -> None:
    rng = np.random.default_rng(int(size))
    for _ in range(8):
        center = rng.uniform([-5, -5], [ROWS + 5, COLUMNS + 5], (40, 1, 2))
        corners = center + rng.uniform(-size, size, (40, 3, 2))
        distance = signed_distances(corners)
        clear = np.abs(distance).min(axis=0) > 1e-9
        assert clear.all()
        assert np.array_equal(draw(corners), (distance > 0).any(axis=0))


def test_shared_edges_have_no_gaps() -> None:
    rng = np.random.default_rng(3)
    for angle in rng.uniform(0, 2 * np.pi, 20):
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        steps = np.concatenate([[-40.0], np.sort(rng.uniform(-40, 40, 30)), [40.0]])
        points = np.stack(np.meshgrid(steps, steps, indexing="ij"), axis=-1) @ turn.T + [ROWS / 2, COLUMNS / 2]
        a, b, c, d = points[:-1, :-1], points[1:, :-1], points[1:, 1:], points[:-1, 1:]
        corners = np.stack([a, b, c, a, c, d], axis=-2).reshape(-1, 3, 2)
        assert draw(corners).all()


def test_shared_edges_through_cell_centers_have_no_gaps_or_overhang() -> None:
    rows, columns = np.meshgrid(np.arange(0, ROWS, 3), np.arange(0, COLUMNS, 5), indexing="ij")
    points = np.stack([rows, columns], axis=-1).astype(np.float64)
    a, b, c, d = points[:-1, :-1], points[1:, :-1], points[1:, 1:], points[:-1, 1:]
    filled = draw(np.stack([a, b, c, a, c, d], axis=-2).reshape(-1, 3, 2))
    assert filled[: rows.max() + 1, : columns.max() + 1].all()
    assert filled.sum() == (rows.max() + 1) * (columns.max() + 1)


def test_edges_are_covered_for_every_orientation() -> None:
    corners = np.array([[2.0, 3.0], [6.0, 3.0], [2.0, 7.0]])
    expected = np.zeros((ROWS, COLUMNS), bool)
    for row in range(2, 7):
        expected[row, 3 : 10 - row] = True
    for order in ([0, 1, 2], [2, 1, 0], [1, 2, 0], [0, 2, 1]):
        assert np.array_equal(draw(corners[None, order]), expected)


def test_triangles_without_area_cover_no_centers_beside_them() -> None:
    vertical = np.array([[3.5, 2.0], [3.5, 20.0], [3.5, 9.0]])
    horizontal = np.array([[2.0, 4.5], [20.0, 4.5], [9.0, 4.5]])
    slanted = np.array([[0.5, 1.0], [10.5, 11.0], [5.5, 6.0]])
    point = np.full((3, 2), 7.5)
    almost_flat = np.array([[8.0, 1.2], [8.0 + 1e-300, 9.7], [8.0, 1.2]])
    assert not draw(np.stack([vertical, horizontal, slanted, point])).any()
    assert draw(almost_flat[None]).sum() <= 8


def test_nothing_is_drawn_outside_the_grid() -> None:
    outside = np.array([[[-9.0, -9.0], [-2.0, 80.0], [-9.0, 80.0]], [[5.0, 60.0], [9.0, 90.0], [5.0, 90.0]]])
    assert not draw(outside).any()
    covering_all = np.array([[[-1e9, -1e9], [1e9, -1e9], [0.0, 3e9]]])
    assert draw(covering_all).all()


def test_planes_are_drawn_separately() -> None:
    points = np.array([[1.0, 1.0], [5.0, 1.0], [1.0, 5.0], [9.0, 9.0], [7.0, 9.0], [9.0, 7.0]])
    corners = points.reshape(2, 3, 2).transpose(2, 1, 0)
    filled = covered_cells(corners, np.array([2, 0], np.uint8), (3, 12, 12))
    assert filled[2].sum() == 15
    assert filled[2, 1, 5]
    assert filled[0].sum() == 6
    assert filled[0, 9, 7]
    assert not filled[1].any()
