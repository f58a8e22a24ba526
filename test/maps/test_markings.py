from dataclasses import replace

import numpy as np
import pytest
import shapely
from road_strips import layout_of_strips, level_ground, side_by_side, straight

from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.roads.bands import Border, painted_bands
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.layout import Crosswalk, Layout, Line, Paint, PaintColor, StopLine, Strip
from simbev_ros.maps.roads.levels import assign_levels
from simbev_ros.maps.roads.markings import Marking, MarkingKind, lane_markings
from simbev_ros.maps.roads.surface import crosswalk_polygons, strip_polygons, surfaces_of


@pytest.fixture(scope="module")
def markings(blocks: RoadNetwork) -> tuple[Marking, ...]:
    return lane_markings(blocks.layout)


def _area_m2(markings: tuple[Marking, ...], *kinds: MarkingKind) -> float:
    return sum(marking.polygon.area for marking in markings if marking.kind in kinds)


def test_paint_lies_on_the_road_and_never_overlaps_other_paint(
    blocks: RoadNetwork, markings: tuple[Marking, ...]
) -> None:
    paint = np.array([marking.polygon for marking in markings])
    assert shapely.is_valid(paint).all()
    assert shapely.area(shapely.difference(paint, surfaces_of(blocks.layout).road)).max() < 1e-3
    assert shapely.union_all(paint).area == pytest.approx(shapely.area(paint).sum(), rel=1e-6)


def test_inside_junctions_only_crosswalks_are_painted(blocks: RoadNetwork, markings: tuple[Marking, ...]) -> None:
    inside = [strip for strip in blocks.layout.strips_of(LaneKind.DRIVING) if strip.junction]
    junctions = shapely.union_all(strip_polygons(inside), grid_size=0.001)
    crossings = shapely.union_all(crosswalk_polygons(blocks.layout.crosswalks))
    for marking in markings:
        if marking.kind is MarkingKind.CROSSWALK:
            assert shapely.difference(marking.polygon, crossings).area < 1e-6
        else:
            # Turning lanes begin askew, so their corners extend slightly beyond the end of the center line.
            assert shapely.intersection(marking.polygon, junctions).area < 0.03


def test_window_equals_that_part_of_the_whole(blocks: RoadNetwork, markings: tuple[Marking, ...]) -> None:
    window = shapely.box(-140.3, -77.7, 31.1, 60.9)
    part = lane_markings(blocks.layout, 0, window)
    for kind in MarkingKind:
        whole = shapely.union_all([each.polygon for each in markings if each.kind is kind])
        seen = shapely.union_all([each.polygon for each in part if each.kind is kind])
        assert shapely.symmetric_difference(seen, shapely.intersection(whole, window)).area < 1e-3, kind


def test_center_lines_separate_opposite_directions_and_dashes_the_same_direction(
    blocks: RoadNetwork, markings: tuple[Marking, ...]
) -> None:
    driving = [strip for strip in blocks.layout.strips_of(LaneKind.DRIVING) if not strip.junction]
    steps_m = {strip.lane: np.linalg.norm(np.diff(strip.left_m, axis=0), axis=1) for strip in driving}
    length_m = {lane: float(steps.sum()) for lane, steps in steps_m.items()}
    centers_m = sum(length_m[strip.lane] for strip in driving if strip.left_line.color is PaintColor.YELLOW) / 2.0
    assert _area_m2(markings, MarkingKind.CENTER) == pytest.approx(2 * 0.12 * centers_m, rel=0.02)
    dashed_m = sum(length_m[strip.lane] for strip in driving if strip.left_line.paint is Paint.BROKEN)
    assert _area_m2(markings, MarkingKind.LANE) == pytest.approx(0.12 * dashed_m * 3.0 / 9.0, rel=0.1)
    assert _area_m2(markings, MarkingKind.EDGE) == 0.0, "curbs on both sides"


def _painted(paint: Paint, **line: object) -> Layout:
    """Two eastbound lanes with paint between them, on which both agree, and a third lane far away."""
    left, right = side_by_side(2, name="a", start_m=(0, 0), end_m=(40, 0), height=level_ground)
    line_between = Line(paint, **line)  # type: ignore[arg-type]
    left = replace(left, right_line=line_between, right=right.lane)
    mirrored = {Paint.SOLID_BROKEN: Paint.BROKEN_SOLID, Paint.BROKEN_SOLID: Paint.SOLID_BROKEN}.get(paint, paint)
    right = replace(right, left_line=replace(line_between, paint=mirrored), left=left.lane)
    return layout_of_strips(left, right, straight("b", (0, 50), (40, 50), level_ground))


_BORDER_Y_M = -1.75


@pytest.mark.parametrize(
    ("paint", "left_share", "right_share"),
    [
        (Paint.SOLID_SOLID, 1.0, 1.0),
        (Paint.SOLID_BROKEN, 1.0, 12.0 / 40.0),
        (Paint.BROKEN_SOLID, 12.0 / 40.0, 1.0),
        (Paint.BROKEN_BROKEN, 12.0 / 40.0, 12.0 / 40.0),
    ],
)
def test_double_lines_are_seen_from_the_left_lane_outward(paint: Paint, left_share: float, right_share: float) -> None:
    paints = [marking.polygon for marking in lane_markings(_painted(paint, width_m=0.1))]
    for share, y_m in ((left_share, _BORDER_Y_M + 0.1), (right_share, _BORDER_Y_M - 0.1)):
        line = shapely.box(0, y_m - 0.05, 40, y_m + 0.05)
        assert shapely.union_all(paints).intersection(line).area == pytest.approx(share * 4.0, rel=1e-6)
    assert shapely.union_all(paints).area == pytest.approx((left_share + right_share) * 4.0, rel=1e-6)


def test_single_lines_lie_on_the_border_in_their_color() -> None:
    (solid,) = lane_markings(_painted(Paint.SOLID, color=PaintColor.BLUE, width_m=0.2))
    assert solid.polygon.equals(shapely.box(0, _BORDER_Y_M - 0.1, 40, _BORDER_Y_M + 0.1))
    assert (solid.kind, solid.color) == (MarkingKind.LANE, PaintColor.BLUE)
    dots = lane_markings(_painted(Paint.BOTTS_DOTS))
    assert len(dots) == 32, "every 1.2 m of 38"
    assert lane_markings(_painted(Paint.CURB)) == lane_markings(_painted(Paint.NONE)) == ()


def test_nearly_coinciding_lines_of_overlapping_roads_are_painted_once() -> None:
    road = replace(straight("a", (0, 0), (40, 0), level_ground), left_line=Line(Paint.BROKEN))
    in_junction = straight("b", (-3, 0.1), (43, 0.1), level_ground)
    in_junction = replace(in_junction, left_line=Line(Paint.BROKEN), junction="j")
    alone, both = lane_markings(layout_of_strips(road)), lane_markings(layout_of_strips(in_junction, road))
    assert shapely.union_all([mark.polygon for mark in both]).equals(shapely.union_all([m.polygon for m in alone]))


def test_lines_stop_at_crosswalks_and_stop_lines_are_bars_or_teeth() -> None:
    crosswalk = Crosswalk(np.array([[18.0, -9, 0], [22, -9, 0], [22, 5, 0], [18, 5, 0]]), np.array([0.0, 1.0]))
    ends_m = np.array([[30.0, -1.5, 0], [30, 1.5, 0]])
    for yields, kind, shape in ((False, MarkingKind.STOP, (29.8, 30.2)), (True, MarkingKind.YIELD, (29.5, 30.2))):
        layout = replace(_painted(Paint.SOLID), crosswalks=(crosswalk,), stop_lines=(StopLine(ends_m, yields=yields),))
        markings = lane_markings(layout)
        lines = shapely.union_all([mark.polygon for mark in markings if mark.kind is MarkingKind.LANE])
        assert lines.area == pytest.approx(36.0 * 0.12)
        bars = [mark.polygon.bounds for mark in markings if mark.kind is kind]
        assert (min(bar[0] for bar in bars), max(bar[2] for bar in bars)) == pytest.approx(shape)
        assert len(bars) == (4 if yields else 1)


def test_paint_belongs_to_the_level_of_its_road() -> None:
    under = replace(straight("under", (0, -60), (0, 60), level_ground), left_line=Line(Paint.SOLID))
    over = replace(
        straight("over", (-60, 0), (60, 0), lambda xy_m: np.full(len(xy_m), 6.0)), left_line=Line(Paint.SOLID)
    )
    layout = assign_levels(layout_of_strips(under, over))
    ground, deck = (shapely.union_all([m.polygon for m in lane_markings(layout, level)]) for level in (0, 1))
    assert ground.area + deck.area == pytest.approx(2 * 120 * 0.12, rel=1e-3)
    assert deck.bounds[1] > 1.0, "only the deck's line, just inside its left border"
    assert _decks(layout) == pytest.approx(deck.area / 0.12 * 3.5, rel=1e-3)


def _decks(layout: Layout) -> float:
    decks: list[Strip] = [strip for strip in layout.strips if strip.level == 1]
    return float(shapely.area(strip_polygons(decks)).sum())


@pytest.mark.parametrize(
    ("corner_radius_m", "turn", "gap_m", "joined"),
    [
        (3.0, 0.05, 3.0, True),
        (3.0, 0.6, 3.0, False),
        (3.0, 0.05, 8.0, False),
        (0.0, 0.05, 3.0, False),
    ],
)
def test_edge_lines_continue_across_nodes_where_the_road_continues(
    corner_radius_m: float, turn: float, gap_m: float, joined: bool
) -> None:
    end_m = (30.0 + gap_m + 20.0 * np.cos(turn), 20.0 * np.sin(turn))
    lanes = straight("a", (0, 0), (30, 0), level_ground), straight("b", (30 + gap_m, 0), end_m, level_ground)
    strips = [replace(lane, right_line=Line(Paint.SOLID)) for lane in lanes]
    markings = lane_markings(replace(layout_of_strips(*strips), corner_radius_m=corner_radius_m))
    assert {marking.kind for marking in markings} == {MarkingKind.EDGE}
    line = shapely.union_all([marking.polygon for marking in markings])
    assert line.area == pytest.approx(0.12 * (50.0 + joined * gap_m), abs=0.06)
    assert line.intersects(shapely.box(30.2, -2.0, 29.8 + gap_m, 0.0)) == joined


@pytest.mark.parametrize("paint", [Paint.SOLID, Paint.BROKEN, Paint.SOLID_SOLID])
@pytest.mark.parametrize("times", [2, 3, 5])
def test_repeated_points_of_a_border_leave_its_paint_as_it_is(paint: Paint, times: int) -> None:
    angles_rad = np.linspace(0.0, np.pi, 13)
    bend_m = 3.0 * np.column_stack([np.cos(angles_rad), np.sin(angles_rad)])
    straight_m = np.column_stack([np.full(5, -3.0), np.arange(-2.0, -12.0, -2.0)])
    line_m = np.concatenate([bend_m, straight_m])
    repeated_m = np.repeat(line_m, np.where(np.arange(len(line_m)) % 3 == 1, times, 1), axis=0)
    repeated_m += 1e-5 * np.sin(np.arange(repeated_m.size)).reshape(-1, 2)  # as computed positions are
    areas = []
    for points_m in (line_m, repeated_m):
        _, polygons = painted_bands([Border(points_m, paint, 0.12, -1.0, 0.16)])
        areas.append(shapely.union_all(polygons))
    assert areas[0].area > 0.5
    assert shapely.hausdorff_distance(*areas) < 0.01
