"""A grid that is turned to the map's axes shows what lies at each cell, at every heading."""

import numpy as np
import pytest

from simbev_ros.foundation.geometry.transforms import matrices_from_xyz_rpy
from simbev_ros.foundation.types import BoolArray, Float64Array
from simbev_ros.ros.relays.nav2_map import LevelGrid, align

CELL_M = 0.4
POSES = [(0.0, 0.0, 0.0), (105.3, -40.7, 30.0), (-12.0, 3.3, 90.0), (7.7, 8.8, -163.0)]


def on_road(points_m: Float64Array) -> BoolArray:
    """Whether (..., 2) points lie on a road 7 m wide that bends away from the x axis."""
    return np.asarray(np.abs(points_m[..., 1] - 0.01 * points_m[..., 0] ** 2) < 3.5, bool)


def centers_m(grid: LevelGrid) -> Float64Array:
    """(height, width, 2) centers of a grid's cells in the map."""
    rows, columns = np.indices(grid.cells.shape) + 0.5
    local = np.stack([columns * grid.cell_m, rows * grid.cell_m, np.zeros(rows.shape), np.ones(rows.shape)], axis=-1)
    return np.asarray((local @ grid.map_from_grid.T)[..., :2])


def around(x_m: float, y_m: float, yaw_deg: float, height: int = 90, width: int = 140) -> LevelGrid:
    """The grid around an ego at a pose, of the road as it is in the map; longer than wide."""
    map_from_ego = matrices_from_xyz_rpy(np.array([x_m, y_m, 1.5]), np.radians([0.0, 0.0, yaw_deg]))
    corner = matrices_from_xyz_rpy(np.array([-width, -height, 0.0]) * CELL_M / 2.0, np.zeros(3))
    empty = LevelGrid(np.zeros((height, width), bool), CELL_M, map_from_ego @ corner)
    return LevelGrid(on_road(centers_m(empty)), CELL_M, empty.map_from_grid)


@pytest.mark.parametrize("pose", POSES)
def test_cells_show_the_road_that_is_there_up_to_a_cell_beside_its_edges(pose: tuple[float, float, float]) -> None:
    aligned = align(around(*pose))
    here_m = centers_m(aligned)
    nearby = np.stack([on_road(here_m + np.array([dx, dy]) * CELL_M) for dx in (-1, 0, 1) for dy in (-1, 0, 1)])
    inside, outside = nearby.all(axis=0), ~nearby.any(axis=0)
    assert aligned.cells[inside].all() and not aligned.cells[outside].any()


@pytest.mark.parametrize("pose", POSES)
def test_axes_are_those_of_the_map_and_the_ego_is_in_the_middle(pose: tuple[float, float, float]) -> None:
    aligned = align(around(*pose))
    np.testing.assert_array_equal(aligned.map_from_grid[:3, :3], np.eye(3))
    middle_m = aligned.map_from_grid[:2, 3] + np.array(aligned.cells.shape[::-1]) * CELL_M / 2.0
    np.testing.assert_allclose(middle_m, pose[:2], atol=CELL_M)
    assert aligned.map_from_grid[2, 3] == 1.5


def test_cells_of_successive_maps_coincide() -> None:
    corners_m = np.array([align(around(0.1 * step, 0.07 * step, 3.0 * step)).map_from_grid[:2, 3] for step in range(9)])
    np.testing.assert_allclose(corners_m / CELL_M, np.rint(corners_m / CELL_M), atol=1e-9)


def test_without_a_turn_nothing_is_lost() -> None:
    grid = LevelGrid(np.random.default_rng(3).random((40, 40)) < 0.5, CELL_M, np.eye(4))
    aligned = align(grid)
    row, column = np.rint(aligned.map_from_grid[[1, 0], 3] / CELL_M).astype(int)
    height, width = aligned.cells.shape
    np.testing.assert_array_equal(aligned.cells, grid.cells[row : row + height, column : column + width])
