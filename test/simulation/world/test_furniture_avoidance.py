"""Pedestrians walk around obstacles on sidewalks."""

import numpy as np

from simbev_ros.assets.street.obstacles import OBSTACLE_DTYPE
from simbev_ros.simulation.world.pedestrians.furniture_avoidance import FurnitureAvoidance

RADIUS_M = 0.25
STEP_M = 0.02


def trees() -> FurnitureAvoidance:
    """Two trees along the x axis; the road is to the south."""
    obstacles = np.zeros(2, OBSTACLE_DTYPE)
    obstacles["x"], obstacles["radius"], obstacles["away_y"] = [10.0, 18.0], RADIUS_M, 1.0
    return FurnitureAvoidance(obstacles)


def straight_walk(y_m: float, z_m: float = 0.0) -> np.ndarray:
    x_m = np.arange(0.0, 28.0, STEP_M)
    return np.column_stack([x_m, np.full(len(x_m), y_m), np.full(len(x_m), z_m)])


def test_paths_along_the_sidewalk_bend_around_trees_on_the_side_away_from_the_road() -> None:
    for y_m in np.arange(-0.5, 2.0, 0.1):
        path_m = trees().move_aside(straight_walk(y_m))
        for x_m in (10.0, 18.0):
            assert np.hypot(path_m[:, 0] - x_m, path_m[:, 1]).min() >= RADIUS_M + 0.25
        assert np.all(path_m[:, 1] >= y_m - 1e-9)
        assert np.linalg.norm(np.diff(path_m, axis=0), axis=1).max() < 2.2 * STEP_M
        np.testing.assert_array_equal(path_m[:300], straight_walk(y_m)[:300])


def test_pedestrians_who_cross_the_road_or_are_on_another_level_walk_straight() -> None:
    for path_m in (straight_walk(-1.3), straight_walk(0.0, z_m=6.0), straight_walk(0.8)):
        np.testing.assert_array_equal(trees().move_aside(path_m), path_m)


def test_no_pedestrian_jumps_even_when_stepping_off_the_curb_beside_a_tree() -> None:
    y_m = np.arange(2.0, -4.0, -STEP_M)
    for x_m in np.arange(8.0, 12.0, 0.1):
        path_m = trees().move_aside(np.column_stack([np.full(len(y_m), x_m), y_m, np.zeros(len(y_m))]))
        assert np.abs(np.diff(path_m[:, 1])).max() < 4.5 * STEP_M
        assert np.all(np.diff(path_m[:, 1]) <= 1e-9)
