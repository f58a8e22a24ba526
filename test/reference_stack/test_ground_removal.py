"""Heights above known planes are right, and the road ends at its curb."""

import numpy as np
import pytest
from analytic_lidar import HEIGHT_M, Block, scan

from simbev_ros.reference_stack.ground import find_ground, sector_of

UP = np.array([0.0, 0.0, HEIGHT_M])
AHEAD = int(sector_of(np.array([0.01]))[0])
CAR = Block(15.0, 0.0, 0.0, (4.5, 1.9, 1.5))


def _within(points: np.ndarray, range_m: float) -> np.ndarray:
    return points[np.hypot(points[:, 0], points[:, 1]) < range_m]


@pytest.mark.parametrize("slope", [-0.04, 0.0, 0.04])
def test_sloping_plane_is_ground(slope: float) -> None:
    points = _within(scan([], slope)[0] + UP, 40.0)
    height_m = find_ground(points).height_m
    assert np.abs(height_m).max() < 0.2
    assert np.quantile(np.abs(height_m), 0.95) < 0.05


def test_car_hides_the_road_but_is_not_ground() -> None:
    points = _within(scan([CAR])[0] + UP, 40.0)
    height_m = find_ground(points).height_m
    assert height_m == pytest.approx(points[:, 2], abs=0.01)
    assert height_m.max() == pytest.approx(1.5, abs=0.15)


def test_road_ends_at_the_curb_and_where_a_car_hides_it() -> None:
    curb = Block(0.0, 14.0, 0.0, (80.0, 20.0, 0.12))  # starts 4 m to the left
    ground = find_ground(_within(scan([CAR, curb])[0] + UP, 50.0))
    left, right = sector_of(np.array([np.pi / 2, -np.pi / 2]))
    assert ground.road_m[left] == pytest.approx(4.0, abs=0.6)
    assert ground.has_curb[left]
    assert 10.0 < ground.road_m[AHEAD] <= 13.0
    assert not ground.has_curb[AHEAD]
    assert ground.road_m[right] > 15.0
    assert not ground.has_curb[right]


def test_without_points_there_is_no_road() -> None:
    ground = find_ground(np.zeros((0, 3)))
    assert ground.height_m.shape == (0,)
    assert not ground.road_m.any()
