from dataclasses import replace

import numpy as np
import pytest
from road_strips import layout_of_strips, level_ground, side_by_side, straight

from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.roads.elevation import Elevation
from simbev_ros.maps.roads.layout import Layout, Strip
from simbev_ros.maps.roads.levels import assign_levels

_LIFT_M = 0.2


def _banked_slope(xy_m: Float64Array) -> Float64Array:
    return 7.0 + 0.06 * xy_m[:, 0] - 0.04 * xy_m[:, 1]


def _in_junction(strips: list[Strip]) -> list[Strip]:
    return [replace(strip, junction="J") for strip in strips]


@pytest.mark.parametrize("junction", [False, True])
def test_banked_slope_is_exact_on_the_road_and_beside_it(junction: bool) -> None:
    roads = side_by_side(3, name="a", start_m=(0, 0), end_m=(150, 40), height=_banked_slope)
    roads += side_by_side(2, name="b", start_m=(80, -60), end_m=(60, 90), height=_banked_slope)
    roads = _in_junction(roads) if junction else roads
    xy_m = np.random.default_rng(0).uniform([-30, -80], [180, 110], (2000, 2))
    assert Elevation(layout_of_strips(*roads)).height_m(xy_m) == pytest.approx(_banked_slope(xy_m), abs=1e-6)


def test_vertical_curve_is_reproduced_within_a_centimeter() -> None:
    def crest(xy_m: Float64Array) -> Float64Array:
        return np.asarray(10.0 - xy_m[:, 0] ** 2 / (2.0 * 1000.0))  # radius 1000 m, usual for 60 km/h

    elevation = Elevation(layout_of_strips(*side_by_side(2, name="a", start_m=(-100, 0), end_m=(100, 0), height=crest)))
    xy_m = np.random.default_rng(1).uniform([-98, -5], [98, 1.5], (2000, 2))
    assert np.abs(elevation.height_m(xy_m) - crest(xy_m)).max() < 0.01


def test_surface_has_no_steps_even_where_roads_disagree() -> None:
    roads = [straight("a", (0, 0), (100, 0), _banked_slope), straight("b", (50, -60), (70, 60), level_ground)]
    elevation = Elevation(layout_of_strips(*roads))
    steps_m = []
    for count in (20_001, 200_001):
        along_m = np.linspace(-40.0, 60.0, count)
        steps_m.append(np.abs(np.diff(elevation.height_m(np.column_stack([40.0 + 0.3 * along_m, along_m])))).max())
    assert steps_m[1] < 0.15 * steps_m[0], "ten times finer samples, steps about ten times as small"


def test_roads_of_different_heights_meet_without_humps_in_a_junction() -> None:
    high = _in_junction(
        side_by_side(4, name="a", start_m=(-40, 7), end_m=(40, 7), height=lambda xy_m: _LIFT_M + 0 * xy_m[:, 0])
    )
    low = _in_junction(side_by_side(4, name="b", start_m=(-7, -40), end_m=(-7, 40), height=level_ground))
    elevation = Elevation(layout_of_strips(*high, *low))
    along_m = np.arange(-30.0, 30.0, 0.25)
    for beside_m in (-5.0, -1.7, 0.0, 1.7, 5.0):
        for axis, own_m in ((0, _LIFT_M), (1, 0.0)):
            positions_m = np.full((len(along_m), 2), beside_m)
            positions_m[:, axis] = along_m
            height_m = elevation.height_m(positions_m)
            bend_m = height_m[8:] - 2.0 * height_m[4:-4] + height_m[:-8]
            assert np.abs(bend_m).max() < 0.03, "over a meter before and behind, with 0.2 m between both roads"
            assert -0.01 < height_m.min() < height_m.max() < _LIFT_M + 0.01
            assert height_m[[0, -1]] == pytest.approx([own_m, own_m], abs=1e-9)


def test_heights_do_not_depend_on_earlier_queries() -> None:
    roads = side_by_side(3, name="a", start_m=(-50, 4), end_m=(50, -9), height=_banked_slope)
    roads += side_by_side(2, name="b", start_m=(3, -50), end_m=(-8, 50), height=level_ground)
    layout = layout_of_strips(*_in_junction(roads))
    xy_m = np.random.default_rng(2).uniform(-40, 40, (300, 2))
    at_once, one_by_one = Elevation(layout).height_m(xy_m), Elevation(layout)
    assert [one_by_one.height_m(xy_m[[row]])[0] for row in range(299, -1, -1)] == at_once[::-1].tolist()


def test_levels_are_distinguished_by_height() -> None:
    under = straight("under", (0, -100), (0, 100), level_ground)
    over = straight("over", (-100, 0), (100, 0), lambda xy_m: np.full(len(xy_m), 6.0))
    elevation = Elevation(assign_levels(layout_of_strips(under, over)))
    positions_m = np.array([[0, 0, 0.5], [0, 0, 5.0], [0.5, 60, 0.1], [-90, 0, 6.1], [0, 0, 40.0]])
    assert elevation.level_at(positions_m).tolist() == [0, 1, 0, 0, 1]
    assert elevation.height_m(np.zeros((1, 2)), 0) == pytest.approx([0.0], abs=1e-9)
    assert elevation.height_m(np.zeros((1, 2)), 1) == pytest.approx([6.0], abs=1e-9)
    assert elevation.distance_m(np.array([[0.0, 50.0]]), 1)[0] == pytest.approx(50.0, abs=0.1)


def test_map_without_roads_is_level() -> None:
    elevation = Elevation(Layout((), (), (), ()))
    assert elevation.height_m(np.ones((3, 2))).tolist() == [0.0, 0.0, 0.0]
    assert np.isinf(elevation.distance_m(np.ones((3, 2)))).all()


def test_single_short_lane_is_enough() -> None:
    lane = straight("a", (0, 0), (0.5, 0), _banked_slope)
    lane = replace(lane, left_m=lane.left_m[[0, -1]], right_m=lane.right_m[[0, -1]])
    xy_m = np.array([[0.2, 0.1], [3.0, 3.0]])
    assert Elevation(layout_of_strips(lane)).height_m(xy_m) == pytest.approx(_banked_slope(xy_m), abs=1e-6)
