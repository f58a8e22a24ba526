"""Lanelet2 maps give exact strips, a net of the same lanes, and their rules: on a crossing of four roads."""

import gzip
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import shapely
from lanelet2_sample import BOX_M, LANE_M, Crossing, LaneletSample, straight_lane
from pyproj import Transformer

from simbev_ros.foundation.errors import InputError
from simbev_ros.maps.builder import build_map
from simbev_ros.maps.lanelet2.importer import import_lanelet2
from simbev_ros.maps.opendrive.importer import import_opendrive
from simbev_ros.maps.parts import MapParts
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.layout import Layout, Paint, PaintColor, SignKind, Strip
from simbev_ros.maps.source import map_spec
from simbev_ros.maps.store import read_network
from simbev_ros.maps.sumo.net import SumoNet, read_sumo_net

ORIGIN_M = np.array([5000.0, 5000.0])


def ramp(x: float, y: float) -> float:
    """Height of the sample: the eastern arm rises by 5 %."""
    return 0.05 * max(0.0, x - 40.0)


def imported(folder: Path, sample: LaneletSample) -> tuple[MapParts, Layout, SumoNet]:
    path, work = folder / "sample.osm", folder / "work"
    path.write_text(sample.text(), encoding="utf-8")
    work.mkdir()
    parts = import_lanelet2(path, work)
    assert parts.layout is not None
    return parts, parts.layout, read_sumo_net(parts.net)


@pytest.fixture(scope="module")
def crossing() -> Crossing:
    crossing = Crossing(LaneletSample(), height=ramp)
    for arm in range(4):
        crossing.lights(arm)
        crossing.walkways(arm)
        crossing.crosswalk(arm)
    return crossing


@pytest.fixture(scope="module")
def built(crossing: Crossing, tmp_path_factory: pytest.TempPathFactory) -> tuple[MapParts, Layout, SumoNet]:
    return imported(tmp_path_factory.mktemp("crossing"), crossing.sample)


def inner_lane(net: SumoNet, edge: str) -> str:
    """Id of the lane of an edge that is nearest to oncoming traffic."""
    return max((lane for lane in net.lanes.values() if lane.edge == edge), key=lambda lane: lane.index).id


def strip_of(layout: Layout, lanelet: str) -> Strip:
    return next(strip for strip in layout.strips if strip.id == lanelet)


def outline(strip: Strip) -> shapely.Polygon:
    return shapely.Polygon(np.concatenate([strip.left_m[:, :2], strip.right_m[::-1, :2]]))


def test_strips_have_the_borders_and_heights_of_lanelets(
    crossing: Crossing, built: tuple[MapParts, Layout, SumoNet]
) -> None:
    strip = strip_of(built[1], crossing.outgoing[0][1])  # eastward, second lane from the middle
    assert strip.kind is LaneKind.DRIVING
    assert strip.left_m[[0, -1], :2] - ORIGIN_M == pytest.approx(np.array([[BOX_M, -LANE_M], [92.0, -LANE_M]]))
    assert strip.right_m[[0, -1], :2] - ORIGIN_M == pytest.approx(np.array([[BOX_M, -2 * LANE_M], [92.0, -2 * LANE_M]]))
    assert strip.left_m[[0, -1], 2] == pytest.approx([0.0, 0.05 * 52.0])
    assert strip.speed_mps == pytest.approx(50 / 3.6)


def test_strips_are_linked_to_their_neighbors_and_oncoming_lanes(
    crossing: Crossing, built: tuple[MapParts, Layout, SumoNet]
) -> None:
    inner, outer = (strip_of(built[1], name) for name in crossing.incoming[2])
    assert (inner.right, outer.left) == (outer.id, inner.id)
    assert inner.left == crossing.outgoing[2][0]
    assert strip_of(built[1], outer.right).kind is LaneKind.SIDEWALK
    assert set(inner.following) == {crossing.turns[2, 0, 0, 0], crossing.turns[2, 0, 1, 0]}
    assert not inner.junction
    assert strip_of(built[1], crossing.turns[2, 0, 1, 0]).junction


def test_paint_is_that_of_the_bounds(crossing: Crossing, built: tuple[MapParts, Layout, SumoNet]) -> None:
    inner, outer = (strip_of(built[1], name) for name in crossing.incoming[2])
    assert (inner.left_line.paint, inner.left_line.color) == (Paint.SOLID_SOLID, PaintColor.YELLOW)
    assert inner.right_line.paint is outer.left_line.paint is Paint.BROKEN
    assert outer.right_line.paint is Paint.NONE
    assert strip_of(built[1], crossing.turns[2, 0, 1, 0]).left_line.paint is Paint.NONE


def test_the_net_has_the_lanes_of_the_layout(built: tuple[MapParts, Layout, SumoNet]) -> None:
    _, layout, net = built
    for kind in (LaneKind.DRIVING, LaneKind.SIDEWALK):
        area = shapely.union_all([outline(strip) for strip in layout.strips_of(kind)]).buffer(0.05)
        lanes = [lane for lane in net.lanes.values() if lane.kind is kind]
        assert lanes
        for lane in lanes:
            assert area.covers(shapely.LineString(lane.centerline_m[:, :2])), lane.id
    heights_m = [lane.centerline_m[:, 2].max() for lane in net.lanes.values() if lane.kind is LaneKind.DRIVING]
    assert max(heights_m) == pytest.approx(0.05 * 52.0, abs=0.01)


def test_every_turn_is_a_movement_of_one_junction_with_lights(built: tuple[MapParts, Layout, SumoNet]) -> None:
    _, _, net = built
    (junction,) = net.junctions.values()
    assert junction.signalised
    turns = [link.direction for link in net.links]
    assert sorted(turns) == sorted("s" * 6 + "l" * 4 + "r" * 4)


def test_lights_hang_where_the_file_puts_them_and_face_their_traffic(
    crossing: Crossing, built: tuple[MapParts, Layout, SumoNet]
) -> None:
    _, layout, net = built
    assert len(layout.signal_places) == 4
    from_west = next(place for place in layout.signal_places if abs(abs(place.yaw_rad) - np.pi) < 0.01)
    assert from_west.head_m - [*ORIGIN_M, 0.0] == pytest.approx([BOX_M + 2.0, -1.6, 5.4], abs=1e-6)
    controlled = {link.lane for link in net.links}
    assert len(from_west.lanes) == 2
    assert controlled.issuperset(from_west.lanes)
    road = shapely.union_all([outline(strip) for strip in layout.strips_of(LaneKind.DRIVING)])
    assert all(not road.contains(shapely.Point(place.foot_m[:2])) for place in layout.signal_places)


def test_stop_lines_and_crosswalks_lie_where_the_file_has_them(built: tuple[MapParts, Layout, SumoNet]) -> None:
    _, layout, net = built
    assert len(layout.stop_lines) == len(layout.crosswalks) == 4
    east = max(layout.stop_lines, key=lambda line: line.ends_m[0, 0])
    right_m, left_m = east.ends_m[:, :2] - ORIGIN_M
    assert [*right_m, *left_m] == pytest.approx([12.5, 6.8, 12.5, 0.2])
    assert not east.yields
    west = min(layout.crosswalks, key=lambda crosswalk: crosswalk.outline_m[:, 0].min())
    low_m, high_m = west.outline_m[:, :2].min(axis=0) - ORIGIN_M, west.outline_m[:, :2].max(axis=0) - ORIGIN_M
    assert (low_m.tolist(), high_m.tolist()) == ([-18.0, -7.0], [-14.0, 7.0])
    assert abs(west.axis[1]) == pytest.approx(1.0)
    assert sum(lane.kind is LaneKind.CROSSING for lane in net.lanes.values()) == 4


def test_the_opendrive_file_describes_the_same_roads_on_earth(
    built: tuple[MapParts, Layout, SumoNet], tmp_path: Path
) -> None:
    parts, layout, _ = built
    again = import_opendrive(parts.opendrive, tmp_path)
    assert again.layout is not None
    areas = [
        shapely.union_all([outline(strip) for strip in each.strips_of(LaneKind.DRIVING)])
        for each in (layout, again.layout)
    ]
    assert areas[0].intersection(areas[1]).area > 0.93 * areas[0].union(areas[1]).area
    point_m = (5050.0, 4990.0, 0.0)
    assert again.datum.geodetic_from_map(point_m)[:2] == pytest.approx(
        parts.datum.geodetic_from_map(point_m)[:2], abs=1e-7
    )


def two_lanes(sample: LaneletSample, subtype: str, **tags: str) -> tuple[str, str]:
    """Ids of the right and the left one of two lanelets that share a line."""
    lines = [
        sample.line([(0.0, y), (80.0, y)], subtype=kind, **(tags if y == 3.5 else {}))
        for y, kind in ((0.0, "solid"), (3.5, subtype), (7.0, "solid"))
    ]
    return sample.lanelet(lines[1], lines[0]), sample.lanelet(lines[2], lines[1])


@pytest.mark.parametrize(
    ("subtype", "tags", "to_left", "to_right"),
    [
        ("dashed", {}, True, True),
        ("solid", {}, False, False),
        ("solid_dashed", {}, True, False),  # dashed for the traffic on the right
        ("dashed_solid", {}, False, True),
        ("solid", {"lane_change": "yes"}, True, True),
        ("dashed", {"lane_change:left": "no", "lane_change:right": "yes"}, False, True),
    ],
)
def test_lane_changes_follow_the_paint_and_the_tags_of_bounds(
    tmp_path: Path, subtype: str, tags: dict[str, str], to_left: bool, to_right: bool
) -> None:
    sample = LaneletSample()
    two_lanes(sample, subtype, **tags)
    parts, _, _ = imported(tmp_path, sample)
    # In Japan, where the sample lies, lanes are counted from the left.
    left, right = (line for line in parts.net.read_text().splitlines() if 'type="driving"' in line)
    assert ("changeLeft" not in right) is to_left
    assert ("changeRight" not in left) is to_right


def test_consecutive_lanelets_become_one_edge_unless_a_rule_holds_traffic_up(tmp_path: Path) -> None:
    sample = LaneletSample()
    first, second, third, _ = straight_lane(sample, [0.0, 40.0, 80.0, 120.0, 160.0], 0.0, 3.5)
    stop_line = sample.line([(118.0, 0.2), (118.0, 3.3)], "stop_line", "")
    sign = sample.line([(119.0, -2.0, 2.0), (119.0, -1.4, 2.0)], "traffic_sign", "de206")
    sample.add_rule(third, sample.rule("traffic_sign", ("way", "refers", sign), ("way", "ref_line", stop_line)))
    _, layout, net = imported(tmp_path, sample)
    lengths_m = sorted(
        lane.length_m for lane in net.lanes.values() if lane.kind is LaneKind.DRIVING and not lane.junction
    )
    assert lengths_m == pytest.approx([40.0, 120.0], abs=0.1)
    (stop,) = layout.signs
    assert (stop.kind, stop.lanes) == (SignKind.STOP, (f"{first}_1",)), "beside a footway on the verge"
    assert stop.foot_m[:2] - ORIGIN_M == pytest.approx([119.0, -1.7])
    assert abs(stop.yaw_rad) == pytest.approx(np.pi)
    assert strip_of(layout, second).following == (third,)


def test_pedestrians_cross_a_road_between_junctions_on_its_crosswalk(tmp_path: Path) -> None:
    sample = LaneletSample()
    xs = [0.0, 100.0, 200.0, 300.0]
    straight_lane(sample, xs, 0.0, 3.5)
    straight_lane(sample, xs, 7.0, 3.5)
    for x0, x1 in pairwise(xs):
        for near, far in ((0.0, -2.0), (7.0, 9.0)):
            lines = [sample.line([(x0, y), (x1, y)]) for y in (near, far)]
            sample.lanelet(*lines, subtype="walkway")
    sample.lanelet(*(sample.line([(x, 0.0), (x, 7.0)]) for x in (101.0, 104.0)), subtype="crosswalk")
    _, _, net = imported(tmp_path, sample)
    lengths_m = sorted(
        lane.length_m for lane in net.lanes.values() if lane.kind is LaneKind.DRIVING and not lane.junction
    )
    assert lengths_m == pytest.approx([100.0, 100.0, 200.0, 200.0], abs=0.1)
    (crossing,) = (lane for lane in net.lanes.values() if lane.kind is LaneKind.CROSSING)
    assert np.abs(crossing.centerline_m[:, 0] - ORIGIN_M[0] - 102.5).max() < 0.01


def yielding_crossing() -> Crossing:
    """A crossing at which the northern and the southern arm give way."""
    crossing = Crossing(LaneletSample())
    members = [("relation", "yield", crossing.incoming[arm][0]) for arm in (1, 3)]
    members += [("relation", "right_of_way", name) for arm in (0, 2) for name in crossing.incoming[arm]]
    members += [("way", "ref_line", crossing.stop_line(arm)) for arm in (1, 3)]
    rule = crossing.sample.rule("right_of_way", *members)
    for arm in range(4):
        for name in crossing.incoming[arm]:
            crossing.sample.add_rule(name, rule)
    return crossing


def test_right_of_way_is_that_of_the_regulatory_element(tmp_path: Path) -> None:
    crossing = yielding_crossing()
    _, layout, net = imported(tmp_path, crossing.sample)
    straight = {arm: net.right_of_way[inner_lane(net, crossing.incoming[arm][0])] for arm in range(4)}
    assert all("M" in straight[arm] for arm in (0, 2))
    assert all(set(straight[arm]) == {"m"} for arm in (1, 3))
    assert [line.yields for line in layout.stop_lines] == [True, True]


def test_all_way_stops_get_stop_lines_where_the_file_has_none(tmp_path: Path) -> None:
    crossing = Crossing(LaneletSample())
    incoming = [name for names in crossing.incoming.values() for name in names]
    rule = crossing.sample.rule("all_way_stop", *(("relation", "yield", name) for name in incoming))
    for name in incoming:
        crossing.sample.add_rule(name, rule)
    _, layout, net = imported(tmp_path, crossing.sample)
    assert all("w" in net.right_of_way[inner_lane(net, names[0])] for names in crossing.incoming.values())
    assert len(layout.stop_lines) == 4
    east = max(layout.stop_lines, key=lambda line: line.ends_m[0, 0])
    assert east.ends_m[:, :2] - ORIGIN_M == pytest.approx(np.array([[BOX_M + 0.5, 6.75], [BOX_M + 0.5, 0.25]]))


def test_speed_limits_come_from_signs_tags_and_defaults(tmp_path: Path) -> None:
    sample = LaneletSample()
    names = straight_lane(sample, [0.0, 50.0], 0.0, 3.5) + straight_lane(
        sample, [50.0, 100.0], 0.0, 3.5, speed_limit="30 mph"
    )
    names += straight_lane(sample, [100.0, 150.0], 0.0, 3.5) + straight_lane(
        sample, [150.0, 200.0], 0.0, 3.5, location="nonurban"
    )
    sign = sample.line([(101.0, -2.0, 2.0), (101.0, -1.4, 2.0)], "traffic_sign", "de274-70")
    sample.add_rule(names[2], sample.rule("speed_limit", ("way", "refers", sign)))
    _, layout, _ = imported(tmp_path, sample)
    speeds_mps = [strip_of(layout, name).speed_mps for name in names]
    assert speeds_mps == pytest.approx([50 / 3.6, 30 * 0.44704, 70 / 3.6, 100 / 3.6], abs=1e-4)
    (limit,) = layout.signs
    assert (limit.kind, limit.speed_mps, limit.lanes) == (
        SignKind.SPEED_LIMIT,
        pytest.approx(70 / 3.6),
        (f"{names[2]}_0",),
    )


def test_roads_at_two_levels_do_not_meet(tmp_path: Path) -> None:
    sample = LaneletSample()
    below = straight_lane(sample, [-100.0, 100.0], 0.0, 3.5)
    bridge = sample.lanelet(
        sample.line([(0.0, -80.0, 6.0), (0.0, 80.0, 6.0)]), sample.line([(4.0, -80.0, 6.0), (4.0, 80.0, 6.0)])
    )
    sample.line([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0)])
    _, layout, net = imported(tmp_path, sample)
    assert not any(strip.junction for strip in layout.strips)
    assert strip_of(layout, bridge).left_m[:, 2] == pytest.approx(6.0)
    assert strip_of(layout, below[0]).left_m[:, 2] == pytest.approx(0.0)
    assert not net.links


def left_handed(sample: LaneletSample) -> None:
    for y, direction in ((0.0, 1), (-3.5, -1)):  # eastward on the left, seen eastward
        lines = [sample.line([(0.0, y + dy), (90.0, y + dy)], subtype="solid") for dy in (0.0, 3.5)]
        sample.lanelet(*(lines[::-1] if direction > 0 else lines))


def test_left_hand_traffic_is_recognized_by_the_side_of_oncoming_lanelets(tmp_path: Path) -> None:
    sample = LaneletSample()
    left_handed(sample)
    _, layout, net = imported(tmp_path, sample)
    assert net.left_hand
    first, second = layout.strips
    assert (first.right, second.right) == (second.id, first.id)
    assert (first.left, second.left) == ("", "")


def add_area(sample: LaneletSample, corners: Sequence[tuple[float, float]], subtype: str, **tags: str) -> None:
    ring = sample.line([*corners, corners[0]], "line_thin", "solid")
    sample.relation({"type": "multipolygon", "subtype": subtype, **tags}, ("way", "outer", ring))


def test_areas_become_parking_places_buildings_and_parks(tmp_path: Path) -> None:
    sample = LaneletSample()
    straight_lane(sample, [0.0, 100.0], 0.0, 3.5)
    add_area(sample, [(10.0, -6.0), (40.0, -6.0), (40.0, 0.0), (10.0, 0.0)], "parking")
    add_area(sample, [(10.0, 20.0), (30.0, 20.0), (30.0, 32.0), (10.0, 32.0)], "building", height="12.5")
    add_area(sample, [(50.0, 20.0), (90.0, 20.0), (70.0, 60.0)], "vegetation")
    parts, layout, _ = imported(tmp_path, sample)
    (parking,) = layout.strips_of(LaneKind.PARKING)
    assert outline(parking).area == pytest.approx(180.0)
    assert parts.features.buildings is not None
    (building,) = parts.features.buildings
    assert (building.outline.area, building.height_m) == (pytest.approx(240.0), 12.5)
    assert parts.features.zones[-1].area.area == pytest.approx(800.0)


def test_files_ending_in_osm_are_recognized_by_their_lanelets(tmp_path: Path) -> None:
    path = tmp_path / "crossing.osm.gz"
    path.write_bytes(gzip.compress(yielding_crossing().sample.text().encode()))
    folder = tmp_path / "built"
    folder.mkdir()
    build_map(map_spec(str(path)), folder)
    network = read_network(folder, seed=0)
    assert len(network.layout.strips_of(LaneKind.DRIVING)) == 26
    to_earth = Transformer.from_crs("EPSG:32654", "EPSG:4326", always_xy=True)
    longitude, latitude = to_earth.transform(305e3, 3905e3)
    assert network.datum.geodetic_from_map((5000.0, 5000.0, 0.0))[:2] == pytest.approx((latitude, longitude), abs=1e-9)


def test_bounds_do_not_choose_parts_of_lanelets(tmp_path: Path) -> None:
    path = tmp_path / "crossing.osm"
    path.write_text(yielding_crossing().sample.text(), encoding="utf-8")
    with pytest.raises(InputError, match=r"bounds: only OpenStreetMap files .*crossing\.osm has lanelets"):
        build_map(map_spec(str(path), bounds=(138.0, 35.0, 139.0, 36.0)), tmp_path)


def _road_in_axes_of(sign: float, kind: str = "") -> LaneletSample:
    """Two lanes eastward and one westward, 100 m long, with center lines and a stop line; ``sign``: of north."""
    sample = LaneletSample()

    def line(xs: Sequence[float], y: float) -> str:
        return sample.line([(x, sign * y) for x in xs], kind, "")

    east, west = (0.0, 100.0), (100.0, 0.0)
    for xs, left, right in ((east, 0.0, -3.5), (east, -3.5, -7.0), (west, 0.0, 3.5)):
        center = sample.line([(x, sign * (left + right) / 2.0) for x in xs], "", "")
        members = (("way", role, ref) for role, ref in (("left", line(xs, left)), ("right", line(xs, right))))
        sample.relation({"type": "lanelet", "subtype": "road"}, *members, ("way", "centerline", center))
    sample.line([(99.0, sign * y) for y in (-0.5, -6.5)], "stop_line", "")
    return sample


def test_a_map_in_left_handed_coordinates_is_mirrored(tmp_path: Path) -> None:
    for folder, sign in (("right", 1.0), ("left", -1.0)):
        (tmp_path / folder).mkdir()
        parts, layout, _ = imported(tmp_path / folder, _road_in_axes_of(sign))
        center_m = np.array([strip.center_m[[0, -1], :2] for strip in layout.strips])
        middle_m = (ORIGIN_M[0], sign * ORIGIN_M[1])
        expected_m = [[(0.0, -1.75), (100.0, -1.75)], [(0.0, -5.25), (100.0, -5.25)], [(100.0, 1.75), (0.0, 1.75)]]
        assert center_m - middle_m == pytest.approx(np.array(expected_m), abs=1e-3)
        assert layout.stop_lines[0].ends_m[:, 0] == pytest.approx([ORIGIN_M[0] + 99.0] * 2, abs=0.01)
        noted = any("left-handed" in finding.rule for finding in parts.findings)
        assert noted == (sign < 0.0)


def test_lanes_without_any_type_of_bounds_are_painted_and_vehicles_change_them(tmp_path: Path) -> None:
    parts, layout, _ = imported(tmp_path, _road_in_axes_of(1.0))
    lanes = [line for line in parts.net.read_text().splitlines() if 'type="driving"' in line]
    assert ["changeLeft" in line for line in lanes] == [False, True, True], lanes  # from the outermost lane of an edge
    paints = [(strip.left_line.paint, strip.right_line.paint) for strip in layout.strips]
    assert paints == [(Paint.SOLID, Paint.BROKEN), (Paint.BROKEN, Paint.SOLID), (Paint.SOLID, Paint.SOLID)]
    assert [strip.left_line.color for strip in layout.strips] == [
        *(PaintColor.YELLOW, PaintColor.WHITE, PaintColor.YELLOW)
    ]


def test_lanes_keep_their_borders_where_some_bound_has_a_type(tmp_path: Path) -> None:
    _, layout, _ = imported(tmp_path, _road_in_axes_of(1.0, kind="virtual"))
    assert {strip.left_line.paint for strip in layout.strips} == {Paint.NONE}


@pytest.mark.parametrize(
    ("stated", "kmh", "noted"), [("3", 3.0, False), ("0.2 km/h", 50.0, True), ("fast", 50.0, True)]
)
def test_a_speed_limit_is_used_or_said_to_be_ignored(tmp_path: Path, stated: str, kmh: float, noted: bool) -> None:
    sample = LaneletSample()
    straight_lane(sample, [0.0, 100.0], -2.0, 2.0, speed_limit=stated)
    parts, layout, net = imported(tmp_path, sample)
    driven = [lane for lane in net.lanes.values() if lane.kind is LaneKind.DRIVING]
    assert {round(lane.speed_mps * 3.6, 1) for lane in driven} == {kmh}
    assert layout.strips[0].speed_mps == pytest.approx(kmh / 3.6)
    assert any("speed limit that cannot be read" in finding.rule for finding in parts.findings) == noted


def test_a_junction_that_the_edge_of_the_map_cuts_keeps_its_traffic_and_lights(tmp_path: Path) -> None:
    sample = LaneletSample()
    straight_lane(sample, [-100.0, -6.0], -1.75, 1.75)
    (through,) = straight_lane(sample, [-6.0, 6.0], -1.75, 1.75)
    across = sample.lanelet(
        sample.line([(-1.75, 10.0), (-1.75, -10.0)]), sample.line([(1.75, 10.0), (1.75, -10.0)]), subtype="road"
    )
    for number, name in enumerate((through, across)):
        light = sample.line([(8.0, 8.0 + number, 5.0), (8.0, 8.4 + number, 5.0)], "traffic_light", "")
        sample.add_rule(name, sample.rule("traffic_light", ("way", "refers", light)))
    parts, layout, net = imported(tmp_path, sample)
    assert len(layout.signal_places) == 2
    waiting = [lane for place in layout.signal_places for lane in place.lanes]
    assert {net.lanes[lane].length_m > 50.0 for lane in waiting} == {True, False}
    assert {link.lane for link in net.links} == set(waiting)
    for lane in waiting:
        (inside,) = net.lanes[lane].successors
        (beyond,) = net.lanes[inside].successors
        whole_m = np.concatenate([net.lanes[each].centerline_m[:, :2] for each in (inside, beyond)]) - ORIGIN_M
        assert np.abs(whole_m).min(axis=1).max() < 0.1, "on the line of the file"
    assert sum("at the edge of the map" in finding.rule for finding in parts.findings) == 2
