from itertools import pairwise

import numpy as np
import pytest
import shapely
from road_strips import layout_of_strips, level_ground, side_by_side, straight

from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.land_features import Water
from simbev_ros.maps.roads.layout import Crosswalk, Layout, StopLine, Strip
from simbev_ros.maps.roads.levels import assign_levels


def _at(height_m: float):  # type: ignore[no-untyped-def]
    return lambda xy_m: np.full(len(xy_m), height_m)


def _span_m(layout: Layout, level: int, axis: int = 0) -> tuple[float, float]:
    """Extent of the strips of a level along an axis."""
    points_m = np.concatenate([np.concatenate([s.left_m, s.right_m]) for s in layout.strips if s.level == level])
    return float(points_m[:, axis].min()), float(points_m[:, axis].max())


def test_road_over_a_road_is_carried_from_abutment_to_abutment() -> None:
    under = straight("under", (0, -100), (0, 100), level_ground)
    over = straight("over", (-100, 0), (100, 0), _at(6.0))
    layout = assign_levels(layout_of_strips(under, over))
    assert [strip.level for strip in layout.strips] == [0, 0, 1, 0]
    low_m, high_m = _span_m(layout, 1)
    slope_m = 1.75 + 1.5 * 6.0  # half the lane beneath, and an abutment as long as 1.5 times its height
    assert -slope_m - 6.0 < low_m <= -slope_m
    assert slope_m <= high_m < slope_m + 6.0


def test_cut_strips_add_up_to_the_original_strip() -> None:
    under = straight("under", (0, -100), (0, 100), level_ground)
    over = straight("over", (-100, 3), (100, -5), lambda xy_m: 6.0 + 0.02 * xy_m[:, 0])
    parts = [strip for strip in assign_levels(layout_of_strips(under, over)).strips if strip.lane == "over"]
    assert len({strip.id for strip in parts}) == len(parts) == 3
    for before, after in pairwise(parts):
        assert before.left_m[-1] == pytest.approx(after.left_m[0], abs=1e-9)
        assert before.right_m[-1] == pytest.approx(after.right_m[0], abs=1e-9)
        length_m = np.linalg.norm(np.diff(before.center_m[:, :2], axis=0), axis=1).sum()
        assert after.s_start_m == pytest.approx(before.s_start_m + length_m)
    assert sum(_area_m2(strip) for strip in parts) == pytest.approx(_area_m2(over), abs=1e-6)


def _area_m2(strip: Strip) -> float:
    return shapely.Polygon(np.concatenate([strip.left_m, strip.right_m[::-1]])[:, :2]).area


def test_deck_ends_straight_across_lanes_that_are_cut_differently() -> None:
    under = straight(
        "under", (-30, -100), (30, 100), level_ground
    )  # askew, so that lanes leave it at different stations
    east = side_by_side(3, name="east", start_m=(-103, 0), end_m=(100, 0), height=_at(6.0))
    west = side_by_side(2, name="west", start_m=(99, 3.5), end_m=(-100, 3.5), height=_at(6.0))
    layout = assign_levels(layout_of_strips(under, *east, *west))
    decks = [strip for strip in layout.strips if strip.level == 1]
    assert len(decks) == 5
    ends_m = np.array([sorted(side[[0, -1], 0]) for deck in decks for side in (deck.left_m, deck.right_m)])
    assert np.ptp(ends_m, axis=0).max() < 0.01


def test_levels_count_layers_and_ramps_over_themselves() -> None:
    ground = straight("ground", (-100, 0), (100, 0), level_ground)
    middle = straight("middle", (0, -100), (0, 100), _at(6.0))
    top = straight("top", (-100, -100), (100, 100), _at(12.0))
    layout = assign_levels(layout_of_strips(ground, middle, top))
    assert {strip.level for strip in layout.strips if strip.lane == "middle"} == {0, 1}
    assert {strip.level for strip in layout.strips if strip.lane == "top"} == {0, 2}
    turn_rad = np.linspace(0.0, 3.0 * np.pi, 150)
    helix_m = np.column_stack([30.0 * np.cos(turn_rad), 30.0 * np.sin(turn_rad), 6.0 * turn_rad / (2.0 * np.pi)])
    outward = np.column_stack([np.cos(turn_rad), np.sin(turn_rad), np.zeros(150)])
    helix = straight("helix", (0, 0), (1, 0), level_ground)
    ramp = Strip("ramp", "ramp", helix.kind, helix_m - 2.0 * outward, helix_m + 2.0 * outward)
    parts = assign_levels(layout_of_strips(ramp)).strips
    assert [strip.level for strip in parts] == [0, 1]
    assert parts[1].center_m[0, 2] == pytest.approx(6.0 - 9.0 * 6.0 / 188.5, abs=0.3), "a slope before the overlap"


def test_roads_that_merge_or_cross_at_one_height_stay_on_the_ground() -> None:
    main = straight("main", (-100, 0), (100, 0), lambda xy_m: 5.0 + 0.03 * xy_m[:, 0])
    ramp = straight("ramp", (-100, -30), (60, 1), lambda xy_m: 5.0 + 0.03 * xy_m[:, 0])
    side = straight("side", (0, -50), (0, 50), lambda xy_m: 5.0 + 0.03 * xy_m[:, 0])
    assert assign_levels(layout_of_strips(main, ramp, side)).strips == (main, ramp, side)


def test_water_and_declared_structures_are_bridged() -> None:
    road = straight("road", (-100, 0), (100, 0), _at(2.0))
    declared = straight("declared", (-100, 50), (-40, 50), _at(2.0))
    river = Water(shapely.box(-8, -200, 8, 40), surface_m=-1.0)
    layout = assign_levels(layout_of_strips(road, Strip(**{**_fields(declared), "structure": True})), [river])
    assert [strip.level for strip in layout.strips] == [0, 1, 0, 1]
    low_m, high_m = _span_m(Layout(tuple(s for s in layout.strips if s.lane == "road"), (), (), ()), 1)
    assert -8 - 6 - 6 <= low_m <= -8 - 6
    assert 8 + 6 <= high_m <= 8 + 6 + 6
    assert all(strip.level == 0 for strip in assign_levels(layout_of_strips(road)).strips), "without water, no bridge"


def _fields(strip: Strip) -> dict[str, object]:
    return {name: getattr(strip, name) for name in Strip.__slots__}


def test_crosswalks_and_stop_lines_lie_on_the_level_of_their_road() -> None:
    under = straight("under", (0, -100), (0, 100), level_ground)
    over = straight("over", (-100, 0), (100, 0), _at(6.0))

    def rectangle_m(height_m: float) -> Float64Array:
        return np.array([[-2.0, -2, height_m], [2, -2, height_m], [2, 2, height_m], [-2, 2, height_m]])

    layout = assign_levels(
        Layout(
            (under, over),
            (Crosswalk(rectangle_m(0.0), np.array([1.0, 0.0])), Crosswalk(rectangle_m(6.0), np.array([0.0, 1.0]))),
            (StopLine(rectangle_m(6.0)[:2]), StopLine(rectangle_m(0.0)[:2])),
            (),
        )
    )
    assert [crosswalk.level for crosswalk in layout.crosswalks] == [0, 1]
    assert [line.level for line in layout.stop_lines] == [1, 0]
