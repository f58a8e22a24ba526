from dataclasses import replace

import numpy as np
import pytest
import shapely
from road_strips import layout_of_strips, level_ground, side_by_side, straight

from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.build import load_network
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.layout import Layout, Strip
from simbev_ros.maps.roads.levels import assign_levels
from simbev_ros.maps.roads.surface import (
    Surfaces,
    crosswalk_polygons,
    strip_polygons,
    surfaces_of,
)
from simbev_ros.schema.scene.map_spec import MapSpec

_BLOCKS_LEFT = 4 * 4 - 2


@pytest.fixture(scope="module")
def surfaces(blocks: RoadNetwork) -> Surfaces:
    return surfaces_of(blocks.layout)


def _points_beside(blocks: RoadNetwork, kind: LaneKind, left_m: float) -> Float64Array:
    """(N, 2) points beside the middles of all street lanes of a kind; ``left_m`` is measured from the left border."""
    lanes = [lane for lane in blocks.lanes_of(kind) if not lane.junction]
    poses = [blocks.pose_on_lane(lane.id, lane.length_m * part) for lane in lanes for part in (0.05, 0.5, 0.95)]
    offsets_m = np.repeat([lane.width_m / 2.0 + left_m for lane in lanes], 3)
    yaw_rad = np.array([yaw for _, yaw in poses])
    left = np.stack([-np.sin(yaw_rad), np.cos(yaw_rad)], axis=1)
    middles_m: Float64Array = np.array([position_m[:2] for position_m, _ in poses])
    middles_m += offsets_m[:, None] * left
    return middles_m


def test_road_has_no_hole_but_the_blocks(surfaces: Surfaces) -> None:
    assert surfaces.road.is_valid
    assert len(surfaces.road.geoms) == 1
    assert len(surfaces.road.geoms[0].interiors) == _BLOCKS_LEFT
    assert surfaces.sidewalk.is_valid
    assert len(surfaces.sidewalk.geoms) == _BLOCKS_LEFT + 1, "one around each block and one outside the ring"


def test_road_covers_every_lane_and_adds_only_corners(blocks: RoadNetwork, surfaces: Surfaces) -> None:
    strips = blocks.layout.strips_of(LaneKind.DRIVING)
    lanes = shapely.union_all(strip_polygons([*strips, *blocks.layout.strips_of(LaneKind.PARKING)]))
    assert shapely.difference(lanes, surfaces.road).area < 1e-3 * lanes.area
    assert lanes.area <= surfaces.road.area < 1.03 * lanes.area
    streets = [lane for lane in blocks.lanes_of(LaneKind.DRIVING) if not lane.junction]
    straight_m2 = sum(lane.length_m * lane.width_m for lane in streets)
    outside = [strip for strip in strips if not strip.junction]
    assert shapely.area(strip_polygons(outside)).sum() == pytest.approx(straight_m2, rel=1e-4)


def test_road_and_sidewalk_share_no_area_and_leave_no_gap(blocks: RoadNetwork, surfaces: Surfaces) -> None:
    road, sidewalk = surfaces.road, surfaces.sidewalk
    assert shapely.intersection(road, sidewalk).area == 0.0
    beyond_curb = shapely.points(_points_beside(blocks, LaneKind.SIDEWALK, 0.01))
    before_curb = shapely.points(_points_beside(blocks, LaneKind.SIDEWALK, -0.01))
    assert shapely.contains(road, beyond_curb).all()
    assert shapely.contains(sidewalk, before_curb).all()
    both = shapely.union_all([road, sidewalk], grid_size=0.001)
    assert both.area == pytest.approx(road.area + sidewalk.area, abs=0.1)
    assert sum(len(part.interiors) for part in shapely.get_parts(both)) == len(sidewalk.geoms) - 1


def test_crosswalks_lie_on_the_road_from_curb_to_curb(blocks: RoadNetwork, surfaces: Surfaces) -> None:
    crosswalks = crosswalk_polygons(blocks.layout.crosswalks)
    assert len(crosswalks) == len(blocks.lanes_of(LaneKind.CROSSING)) > 50
    assert shapely.area(shapely.difference(crosswalks, surfaces.road)).max() < 1e-2
    ends = np.array([lane.centerline_m[[0, -1], :2] for lane in blocks.lanes_of(LaneKind.CROSSING)]).reshape(-1, 2)
    assert shapely.distance(shapely.points(ends), surfaces.sidewalk).max() < 0.3
    assert surfaces.crosswalk.area == pytest.approx(shapely.area(crosswalks).sum(), rel=1e-3)


@pytest.mark.parametrize("town", ["Town05", "Town10HD"])
def test_where_parking_lanes_end_the_sidewalk_reaches_the_crosswalk_and_carries_the_poles(town: str) -> None:
    network = load_network(MapSpec(name=town))
    surfaces = surfaces_of(network.layout)
    ends = np.array([lane.centerline_m[[0, -1], :2] for lane in network.lanes_of(LaneKind.CROSSING)]).reshape(-1, 2)
    assert shapely.distance(shapely.points(ends), surfaces.sidewalk).max() < 0.3
    poles = shapely.points([signal.pole_m[:2] for signal in network.signals])
    assert len(poles) > 50
    assert not shapely.intersects(surfaces.road, poles).any()


def test_window_equals_that_part_of_the_whole(blocks: RoadNetwork, surfaces: Surfaces) -> None:
    window = shapely.box(-140.3, -77.7, 31.1, 60.9)
    part = surfaces_of(blocks.layout, 0, window)
    for name in Surfaces.__slots__:
        whole = shapely.intersection(getattr(surfaces, name), window)
        other = shapely.symmetric_difference(getattr(part, name), whole)
        assert shapely.buffer(other, -0.002).is_empty, f"{name} differs by more than 4 mm"


def _as(kind: LaneKind, strip: Strip) -> Strip:
    return Strip(**{**{name: getattr(strip, name) for name in Strip.__slots__}, "kind": kind})


def test_narrow_medians_and_shoulders_are_not_filled_by_the_road() -> None:
    lanes = side_by_side(5, name="a", start_m=(0, 0), end_m=(50, 0), height=level_ground)
    kinds = (LaneKind.DRIVING, LaneKind.MEDIAN, LaneKind.DRIVING, LaneKind.SHOULDER, LaneKind.SIDEWALK)
    strips = [_as(kind, lane) for kind, lane in zip(kinds, lanes, strict=True)]
    for corner_radius_m in (0.0, 3.0):
        found = surfaces_of(Layout(tuple(strips), (), (), (), corner_radius_m=corner_radius_m))
        assert found.road.area == pytest.approx(2 * 50 * 3.5, abs=0.1)
        for part in (found.median, found.shoulder, found.sidewalk):
            assert part.area == pytest.approx(50 * 3.5, abs=0.1)


def test_paving_has_no_gap_where_a_lane_replaces_the_shoulder() -> None:
    lane = straight("lane", (-50, 0), (50, 0), level_ground)
    shoulder = _as(LaneKind.SHOULDER, straight("shoulder", (-50, -3.5), (0, -3.5), level_ground))
    new_lane = straight("new", (1, -3.5), (50, -3.5), level_ground)
    surfaces = surfaces_of(replace(layout_of_strips(lane, shoulder, new_lane), corner_radius_m=3.0))
    paved = shapely.union(surfaces.road, surfaces.shoulder)
    assert shapely.difference(shapely.box(-50, -5.25, 50, 1.75), paved).area < 0.2, "except for a notch at the edge"
    assert paved.area == pytest.approx(surfaces.road.area + surfaces.shoulder.area) == pytest.approx(700.0, abs=0.2)


def test_shoulders_continue_across_nodes() -> None:
    lane = straight("lane", (-50, 0), (50, 0), level_ground)
    node = replace(straight("node", (-1.5, 0), (1.5, 0), level_ground), junction="node")
    shoulders = [
        _as(LaneKind.SHOULDER, straight(name, (from_m, -3.5), (to_m, -3.5), level_ground))
        for name, from_m, to_m in (("a", -50, -1.5), ("b", 1.5, 50))
    ]
    surfaces = surfaces_of(replace(layout_of_strips(lane, node, *shoulders), corner_radius_m=3.0))
    assert surfaces.shoulder.area == pytest.approx(100 * 3.5, abs=1.5), "except for a notch at the edge"
    assert surfaces.road.area == pytest.approx(100 * 3.5, abs=0.01)


@pytest.mark.parametrize(("speed_mps", "is_road"), [(30.0, False), (14.0, True)])
def test_the_gore_between_a_motorway_and_its_ramp_is_not_road(speed_mps: float, is_road: bool) -> None:
    main = replace(straight("main", (-60, 0), (60, 0), level_ground), speed_mps=speed_mps)
    ramp = straight("ramp", (-60, -4.0), (60, -16.0), level_ground)
    shoulder = _as(LaneKind.SHOULDER, straight("shoulder", (-20, -3.5), (60, -3.5), level_ground))
    surfaces = surfaces_of(replace(layout_of_strips(main, ramp, shoulder), corner_radius_m=3.0))
    gore = shapely.box(-40, -3.0, -30, -2.0)
    assert surfaces.road.contains(gore) == is_road
    assert surfaces.shoulder.contains(gore) != is_road
    assert surfaces.road.area > 2 * 120 * 3.5 - 1.0


def test_levels_have_surfaces_of_their_own_that_meet_at_the_deck_ends() -> None:
    under = straight("under", (0, -100), (0, 100), level_ground)
    over = side_by_side(2, name="over", start_m=(-100, 0), end_m=(100, 0), height=lambda xy_m: np.full(len(xy_m), 6.0))
    layout = assign_levels(layout_of_strips(under, *over))
    ground, deck = (surfaces_of(layout, level).road for level in (0, 1))
    assert ground.contains(shapely.Point(0, 0))
    assert deck.contains(shapely.Point(0, 0))
    assert deck.area + ground.area == pytest.approx(200 * 3.5 + 2 * 200 * 3.5, abs=0.1)
    deck_ends = shapely.intersection(deck.boundary, ground.boundary)
    assert deck_ends.length == pytest.approx(2 * 7.0, abs=0.02)
    assert shapely.union(ground, deck).area == pytest.approx(200 * 3.5 + 2 * 200 * 3.5 - 3.5 * 7.0, abs=0.1)


def test_window_may_end_where_strips_end() -> None:
    kinds = (LaneKind.MEDIAN, LaneKind.DRIVING, LaneKind.SHOULDER, LaneKind.SIDEWALK)
    strips = [
        _as(kind, strip)
        for name, y_m, start_m, end_m in (("ends", 40.0, 0.0, 100.0), ("goes on", 0.0, 0.0, 200.0))
        for strip, kind in zip(
            side_by_side(4, name=name, start_m=(start_m, y_m), end_m=(end_m, y_m), height=level_ground),
            kinds,
            strict=True,
        )
    ]
    layout = replace(layout_of_strips(*strips), corner_radius_m=3.0)
    window = shapely.box(
        100.0 + 4.0 * layout.corner_radius_m, -30.0, 150.0, 60.0
    )  # surfaces are computed this far beyond its sides
    whole, part = surfaces_of(layout), surfaces_of(layout, 0, window)
    for name in ("road", "shoulder", "sidewalk", "median"):
        assert shapely.symmetric_difference(getattr(part, name), getattr(whole, name) & window).area < 1e-6
