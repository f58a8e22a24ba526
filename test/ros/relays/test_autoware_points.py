"""Points in Autoware's type lie where ours do, and are timed from the first shot."""

import numpy as np
import pytest

from simbev_ros.foundation.types import Table
from simbev_ros.ros.relays.autoware_points import AUTOWARE_POINT_DTYPE, autoware_points
from simbev_ros.schema.points import POINT_DTYPE


@pytest.fixture
def points() -> Table:
    """Points ahead, to the left, behind and straight up, with a shot every 25 ms, of which the last is at the stamp."""
    return np.array(
        [
            (3.0, 0.0, 0.0, 0.0, 0, -0.075),
            (0.0, 4.0, 3.0, 0.4, 7, -0.05),
            (-2.0, 0.0, -2.0, 1.0, 63, -0.025),
            (0.0, 0.0, 5.0, 0.2, 127, 0.0),
        ],
        POINT_DTYPE,
    )


def test_positions_and_channels_stay(points: Table) -> None:
    rows, _ = autoware_points(points, rolling=False)
    for name, autoware_name in (("x", "x"), ("y", "y"), ("z", "z"), ("ring", "channel")):
        np.testing.assert_array_equal(rows[autoware_name], points[name])


def test_angles_and_distance_are_those_of_the_position(points: Table) -> None:
    rows, _ = autoware_points(points, rolling=False)
    np.testing.assert_allclose(np.degrees(rows["azimuth"]), [0, 90, 180, 0], atol=1e-4)
    np.testing.assert_allclose(np.degrees(rows["elevation"]), [0, 36.8699, -45, 90], atol=1e-4)
    np.testing.assert_allclose(rows["distance"], [3, 5, np.sqrt(8), 5], rtol=1e-6)


def test_the_brightest_return_fills_the_byte(points: Table) -> None:
    rows, _ = autoware_points(points, rolling=False)
    assert rows["intensity"].tolist() == [0, 102, 255, 51]


def test_a_cloud_that_was_cast_at_once_has_no_times(points: Table) -> None:
    rows, first_ns = autoware_points(points, rolling=False)
    assert first_ns == 0 and not rows["time_stamp"].any()


def test_a_rolling_cloud_is_stamped_with_its_first_shot(points: Table) -> None:
    rows, first_ns = autoware_points(points[[2, 0, 3, 1]], rolling=True)
    assert first_ns == pytest.approx(-75_000_000, abs=5)
    np.testing.assert_allclose(rows["time_stamp"], [50_000_000, 0, 75_000_000, 25_000_000], atol=5)


@pytest.mark.parametrize("rolling", [False, True])
def test_an_empty_cloud_stays_empty(rolling: bool) -> None:
    rows, first_ns = autoware_points(np.zeros(0, POINT_DTYPE), rolling=rolling)
    assert rows.shape == (0,) and rows.dtype == AUTOWARE_POINT_DTYPE and first_ns == 0
