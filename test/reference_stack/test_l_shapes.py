"""Clusters of known shapes are found, and rectangles are fitted to them."""

import numpy as np
import pytest

from simbev_ros.reference_stack.arrays import Floats, box_axes
from simbev_ros.reference_stack.box_fit import fit_rectangles
from simbev_ros.reference_stack.clusters import Clusters, find_clusters


def _l_shape(yaw_rad: float, center_m: tuple[float, float], noise_m: float = 0.0) -> Floats:
    """(N, 3) points, 0.6 m high, on the rear (1.8 m) and right (4 m) edge of a rectangle."""
    along, across = np.linspace(-2.0, 2.0, 40), np.linspace(-0.9, 0.9, 20)
    local = np.concatenate([np.column_stack([along, along * 0 - 0.9]), np.column_stack([across * 0 - 2.0, across])])
    local = local + np.random.default_rng(0).normal(0.0, noise_m, local.shape)
    return np.column_stack([local @ box_axes(np.array(yaw_rad)) + center_m, np.full(len(local), 0.6)])


def _clusters(points_m: Floats) -> Clusters:
    return find_clusters(points_m, points_m[:, 2])


@pytest.mark.parametrize("yaw_deg", [0.0, 12.0, 45.0, 81.0])
def test_l_shape_is_fitted_at_its_heading(yaw_deg: float) -> None:
    fitted = fit_rectangles(_clusters(_l_shape(np.radians(yaw_deg), (10.0, 5.0), noise_m=0.01)))
    assert np.degrees(fitted.yaw_rad) == pytest.approx([yaw_deg], abs=1.6)
    assert fitted.side_m == pytest.approx(np.array([[4.0, 1.8]]), abs=0.15)
    assert fitted.center_m == pytest.approx(np.array([[10.0, 5.0]]), abs=0.1)
    assert fitted.top_m == pytest.approx([0.6])
    assert fitted.points.tolist() == [60]


def test_two_objects_are_two_clusters_in_any_order_of_points() -> None:
    points_m = np.concatenate([_l_shape(0.3, (10.0, 5.0)), _l_shape(1.0, (10.0, -5.0))])
    fitted = fit_rectangles(_clusters(points_m))
    shuffled = fit_rectangles(_clusters(np.random.default_rng(1).permutation(points_m)))
    assert fitted.points.tolist() == [60, 60]
    order = np.argsort(shuffled.center_m[:, 1])
    assert shuffled.center_m[order] == pytest.approx(fitted.center_m[np.argsort(fitted.center_m[:, 1])], abs=1e-6)


def test_leaves_above_a_car_are_not_part_of_it() -> None:
    car = _l_shape(0.0, (10.0, 5.0))
    leaves = np.array([[10.0, 4.1, 3.5], [9.5, 4.1, 3.8]])
    assert fit_rectangles(_clusters(np.concatenate([car, leaves]))).top_m == pytest.approx([0.6])


def test_walls_houses_and_single_points_are_no_clusters() -> None:
    wall = np.column_stack([np.linspace(-10, 10, 200), np.full(200, 8.0), np.full(200, 1.0)])
    house = np.column_stack(
        [np.full(40, 20.0), np.tile(np.arange(4) * 0.2, 10), np.repeat(np.linspace(0.5, 4.5, 10), 4)]
    )
    single = np.array([[5.0, -9.0, 1.0]])
    found = _clusters(np.concatenate([wall, house, single]))
    assert len(found.cluster) == 0
    assert len(fit_rectangles(found).points) == 0
