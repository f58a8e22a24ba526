"""Lanes, paint, objects and signals read from OpenDRIVE files, compared with the values written into these files."""

import time
from pathlib import Path

import numpy as np
import pytest
import xodr_sample as sample

from simbev_ros.maps.findings import sentences_of
from simbev_ros.maps.opendrive.importer import import_opendrive
from simbev_ros.maps.parts import MapParts
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.layout import Line, Paint, PaintColor, SignKind
from simbev_ros.maps.roads.levels import assign_levels
from simbev_ros.maps.sumo.net import read_sumo_net

BOTH = sample.section(sample.lane(1), sample.lane(-1))


def import_sample(tmp_path: Path, *content: str, header: str = sample.FLAT_HEADER) -> MapParts:
    path, work = tmp_path / "sample.xodr", tmp_path / "work"
    path.write_text(sample.xodr(*content, header=header), encoding="utf-8")
    work.mkdir()
    return import_opendrive(path, work)


def mark(kind: str, at: float = 0.0, color: str = "standard", width: str = "") -> str:
    return f'<roadMark sOffset="{at}" type="{kind}" color="{color}" {width}/>'


def test_lane_types_become_kinds_and_unused_types_are_left_out(tmp_path: Path) -> None:
    kinds = {
        "entry": LaneKind.DRIVING,
        "bidirectional": LaneKind.DRIVING,
        "biking": LaneKind.BICYCLE,
        "parking": LaneKind.PARKING,
        "border": LaneKind.SHOULDER,
        "restricted": LaneKind.MEDIAN,
        "walking": LaneKind.SIDEWALK,
        "none": None,
        "curb": None,
        "noSuchType": None,
    }
    lanes = [sample.lane(-number, kind) for number, kind in enumerate(["driving", *kinds], 1)]
    strips = import_sample(tmp_path, sample.straight_road(sections=sample.section(*lanes))).layout.strips
    found = {strip.index: strip.kind for strip in strips}
    assert found == {-1: LaneKind.DRIVING} | {-n: kind for n, kind in enumerate(kinds.values(), 2) if kind is not None}


def test_left_lanes_run_against_s_and_right_ones_with_it(tmp_path: Path) -> None:
    strips = {s.index: s for s in import_sample(tmp_path, sample.straight_road(sections=BOTH)).layout.strips}
    assert strips[-1].center_m[0, 0] == 0.0
    assert strips[1].center_m[0, 0] == 100.0
    np.testing.assert_allclose(strips[1].left_m[:, 1], 0.0)
    np.testing.assert_allclose(strips[-1].left_m[:, 1], 0.0)
    assert (strips[1].left, strips[-1].left) == ("1/0/-1", "1/0/1")


def test_left_hand_traffic_reverses_lanes(tmp_path: Path) -> None:
    parts = import_sample(tmp_path, sample.straight_road(sections=BOTH, attributes='rule="LHT"'))
    strips = {strip.index: strip for strip in parts.layout.strips}
    assert strips[-1].center_m[0, 0] == 100.0
    assert strips[1].center_m[0, 0] == 0.0
    assert strips[1].right == "1/0/-1"
    np.testing.assert_allclose(strips[1].left_m[:, 1], 3.5)
    for lane in (lane for lane in read_sumo_net(parts.net).lanes.values() if lane.kind is LaneKind.DRIVING):
        eastward = lane.centerline_m[-1, 0] > lane.centerline_m[0, 0]
        np.testing.assert_allclose(lane.centerline_m[:, 1], 1.75 if eastward else -1.75, atol=0.01)


def test_paint_is_seen_from_inside_each_lane(tmp_path: Path) -> None:
    center = f'<center><lane id="0" type="none">{mark("solid broken", color="yellow")}</lane></center>'
    lanes = [
        sample.lane(1),
        sample.lane(-1, inner=sample.width(3.5) + mark("broken solid", width='width="0.2"')),
        sample.lane(-2, inner=sample.width(3.5) + mark("botts dots")),
    ]
    layout = import_sample(tmp_path, sample.straight_road(sections=sample.section(*lanes, center=center))).layout
    strips = {strip.index: strip for strip in layout.strips}
    assert strips[1].left_line == Line(Paint.SOLID_BROKEN, PaintColor.YELLOW)
    assert strips[-1].left_line == Line(Paint.BROKEN_SOLID, PaintColor.YELLOW)
    assert strips[-1].right_line == Line(Paint.BROKEN_SOLID, PaintColor.WHITE, 0.2)
    assert strips[-2].left_line == Line(Paint.SOLID_BROKEN, PaintColor.WHITE, 0.2)
    assert strips[-2].right_line == Line(Paint.BOTTS_DOTS)
    assert strips[1].right_line == Line(Paint.NONE)


def test_strips_are_cut_where_paint_changes_but_not_where_it_is_repeated(tmp_path: Path) -> None:
    marks = mark("solid") + mark("solid", 20.0) + mark("broken", 50.0)
    layout = import_sample(
        tmp_path, sample.straight_road(sections=sample.section(sample.lane(-1, inner=sample.width(3.0) + marks)))
    ).layout
    assert [(s.s_start_m, s.right_line.paint) for s in layout.strips] == [(0.0, Paint.SOLID), (50.0, Paint.BROKEN)]


def test_a_paint_change_at_the_start_applies_from_the_start(tmp_path: Path) -> None:
    marks = mark("solid") + mark("broken", 0.01)
    lane = sample.lane(-1, inner=sample.width(3.0) + marks)
    (strip,) = import_sample(tmp_path, sample.straight_road(sections=sample.section(lane))).layout.strips
    assert strip.right_line.paint is Paint.BROKEN


def test_speed_limits_come_from_the_lane_else_the_road_else_its_type(tmp_path: Path) -> None:
    more = '<type s="0" type="town"><speed max="30" unit="mph"/></type><type s="60" type="motorway"/>'
    slow = sample.lane(-2, inner=sample.width(3.0) + '<speed sOffset="10" max="20" unit="km/h"/>')
    layout = import_sample(
        tmp_path, sample.straight_road(more=more, sections=sample.section(sample.lane(-1), slow))
    ).layout
    found = {(strip.index, strip.s_start_m): strip.speed_mps for strip in layout.strips}
    assert found[-1, 0.0] == pytest.approx(13.4112)
    assert found[-1, 60.0] == pytest.approx(120 / 3.6)
    assert found[-2, 0.0] == pytest.approx(13.4112)
    assert found[-2, 10.0] == pytest.approx(20 / 3.6)


def test_a_one_sided_section_divides_only_its_side(tmp_path: Path) -> None:
    sections = [
        sample.section(sample.lane(1), sample.lane(-1)),
        sample.section(sample.lane(-1), s=40.0, attributes='singleSide="true"'),
    ]
    layout = import_sample(tmp_path, sample.straight_road(sections=sections)).layout
    ends = {strip.lane: sorted(strip.left_m[[0, -1], 0].tolist()) for strip in layout.strips}
    assert ends == {"1/0/1": [0.0, 100.0], "1/0/-1": [0.0, 40.0], "1/1/-1": [40.0, 100.0]}


def test_lanes_are_linked_along_roads_and_past_lanes_without_width(tmp_path: Path) -> None:
    link = '<successor elementType="road" elementId="2" contactPoint="end"/>'
    back = '<successor elementType="road" elementId="1" contactPoint="end"/>'
    sections = [
        sample.section(sample.lane(-1, inner="<link><successor id='-1'/></link>")),
        sample.section(sample.lane(-1, inner=sample.width(0.0) + sample.linked(-1, -2)), s=30.0),
        sample.section(sample.lane(-1), sample.lane(-2, inner="<link><successor id='1'/></link>"), s=30.5),
    ]
    turned = sample.road(
        sample.geometry(sample.LINE, 50.0, x=150.0, hdg=np.pi),
        50.0,
        sample.section(sample.lane(1, inner="<link><successor id='-2'/></link>")),
        number="2",
        links=back,
    )
    layout = import_sample(tmp_path, sample.straight_road(sections=sections, links=link), turned).layout
    following = {strip.lane: strip.following for strip in layout.strips}
    assert following["1/0/-1"] == ("1/2/-2",)
    assert following["1/2/-2"] == ("2/0/1",)
    assert following["2/0/1"] == ()


def test_cyclic_links_between_lanes_without_width_terminate(tmp_path: Path) -> None:
    loop = [
        sample.section(sample.lane(1), sample.lane(-1, inner=sample.width(0.0) + sample.linked(-1, -1)), s=s)
        for s in (0.0, 50.0)
    ]
    links = "".join(
        f'<{name} elementType="road" elementId="1" contactPoint="{end}"/>'
        for name, end in (("predecessor", "end"), ("successor", "start"))
    )
    parts = import_sample(tmp_path, sample.straight_road(sections=loop, links=links))
    assert {strip.index for strip in parts.layout.strips} == {1}
    assert any("without width" in note for note in sentences_of("sample.xodr", parts.findings))


def test_declared_bridges_are_structures(tmp_path: Path) -> None:
    more = '<objects><bridge s="30" length="20" type="concrete"/></objects>'
    strips = import_sample(tmp_path, sample.straight_road(more=more)).layout.strips
    assert [(strip.s_start_m, strip.structure) for strip in strips] == [(0.0, False), (30.0, True), (50.0, False)]


def test_crosswalks_come_from_corners_or_from_length_and_width(tmp_path: Path) -> None:
    corners = [(20, -4), (20, 4), (23, 4), (23, -4)]
    road_corners = "".join(f'<cornerRoad s="{s}" t="{t}" dz="0" height="0"/>' for s, t in corners)
    objects = (
        f'<object type="crosswalk" id="1" s="21" t="0"><outlines><outline>{road_corners}</outline></outlines></object>'
        '<object type="crosswalk" id="2" s="60" t="0" hdg="1.5707963267948966" length="8" width="3"/>'
    )
    layout = import_sample(tmp_path, sample.straight_road(sections=BOTH, more=f"<objects>{objects}</objects>")).layout
    by_corners, by_size = layout.crosswalks
    np.testing.assert_allclose(by_corners.outline_m[:, :2], corners, atol=1e-9)
    np.testing.assert_allclose(by_size.outline_m[:, :2].min(axis=0), [58.5, -4.0], atol=1e-9)
    np.testing.assert_allclose(by_size.outline_m[:, :2].max(axis=0), [61.5, 4.0], atol=1e-9)
    for crosswalk in layout.crosswalks:
        np.testing.assert_allclose(crosswalk.axis, [0.0, 1.0], atol=1e-9)


def test_stop_lines_run_from_right_to_left_of_their_traffic(tmp_path: Path) -> None:
    more = (
        '<objects><object id="1" name="StopLine" type="-1" s="90" t="-1.75" hdg="1.5707963" length="3" width="0"/>'
        '<object id="2" name="StopLine" type="-1" s="10" t="1.75" hdg="1.5707963" length="3" width="0"/></objects>'
        '<signals><signal id="3" type="294" subtype="-1" s="80" t="-4" orientation="+" dynamic="no"/></signals>'
    )
    lines = import_sample(tmp_path, sample.straight_road(sections=BOTH, more=more)).layout.stop_lines
    ends_m = [line.ends_m[:, :2] for line in lines]
    np.testing.assert_allclose(ends_m[0], [[90.0, -3.25], [90.0, -0.25]], atol=1e-6)
    np.testing.assert_allclose(ends_m[1], [[10.0, 3.25], [10.0, 0.25]], atol=1e-6)
    np.testing.assert_allclose(ends_m[2], [[80.0, -3.5], [80.0, 0.0]], atol=1e-6)


def signal(number: int, kind: str, s: float, t: float, orientation: str, more: str = "", inner: str = "") -> str:
    return (
        f'<signal id="{number}" type="{kind}" s="{s}" t="{t}" orientation="{orientation}" dynamic="no" {more}>'
        f"{inner}</signal>"
    )


def test_signs_face_the_traffic_that_they_apply_to(tmp_path: Path) -> None:
    signals = (
        signal(1, "206", 98.0, -5.0, "+")
        + signal(2, "205", 2.0, 5.0, "-")
        + signal(3, "274", 50.0, -5.0, "+", 'value="70" unit="km/h"')
        + signal(4, "274", 60.0, 5.0, "-", 'subtype="56"')
        + signal(5, "283", 60.0, 5.0, "-")
    )
    parts = import_sample(tmp_path, sample.straight_road(sections=BOTH, more=f"<signals>{signals}</signals>"))
    stop, gives_way, fast, slow = parts.layout.signs
    assert [sign.kind for sign in parts.layout.signs] == [
        SignKind.STOP,
        SignKind.YIELD,
        SignKind.SPEED_LIMIT,
        SignKind.SPEED_LIMIT,
    ]
    np.testing.assert_allclose(stop.foot_m, [98.0, -5.0, 0.0])
    assert abs(stop.yaw_rad) == pytest.approx(np.pi)
    assert gives_way.yaw_rad == pytest.approx(0.0)
    assert (fast.speed_mps, slow.speed_mps) == (pytest.approx(70 / 3.6), pytest.approx(60 / 3.6))
    lanes = read_sumo_net(parts.net).lanes
    for sign, y_m in ((stop, -1.75), (gives_way, 1.75), (fast, -1.75), (slow, 1.75)):
        (lane,) = sign.lanes
        np.testing.assert_allclose(lanes[lane].centerline_m[:, 1], y_m, atol=0.01)


def test_orientations_that_contradict_validity_are_inverted(tmp_path: Path) -> None:
    valid = '<validity fromLane="-1" toLane="-1"/>'
    signals = signal(1, "206", 98.0, -5.0, "-", inner=valid) + signal(2, "274", 50.0, -5.0, "-", 'value="30"')
    parts = import_sample(tmp_path, sample.straight_road(sections=BOTH, more=f"<signals>{signals}</signals>"))
    assert [abs(sign.yaw_rad) for sign in parts.layout.signs] == pytest.approx([np.pi, np.pi])
    assert parts.layout.signs[0].lanes == parts.layout.signs[1].lanes
    assert any("orientations" in note for note in sentences_of("sample.xodr", parts.findings))


def test_a_sign_on_the_carriageway_moves_beside_the_road(tmp_path: Path) -> None:
    more = f"<signals>{signal(1, '206', 95.0, -1.75, '+')}</signals>"
    (sign,) = import_sample(tmp_path, sample.straight_road(sections=BOTH, more=more)).layout.signs
    np.testing.assert_allclose(sign.foot_m, [95.0, -4.1, 0.0])


def test_fast_roads_without_sidewalks_are_surrounded_by_farmland(tmp_path: Path) -> None:
    more = '<type s="0" type="motorway"/>'
    features = import_sample(tmp_path, sample.straight_road(length=600.0, more=more)).features
    assert [zone.surroundings.use for zone in features.zones] == ["farmland"]
    assert features.surroundings.use == "residential"


def with_objects(objects: str) -> str:
    return sample.straight_road(sections=BOTH).replace("</lanes>", f"</lanes><objects>{objects}</objects>")


def test_tunnels_cut_lanes_and_get_levels_of_their_own(tmp_path: Path) -> None:
    rows = ("s='30' length='20'", "s='45' length='15'", "s='90' length='-5'", "s='x' length='5'")
    objects = "".join(f"<tunnel {row}/>" for row in rows) + '<bridge s="70" length="10"/>'
    parts = import_sample(tmp_path, with_objects(objects))
    assert any(
        "a tunnel that cannot be read is left out" in note for note in sentences_of("sample.xodr", parts.findings)
    )
    assert parts.layout is not None
    layout = assign_levels(parts.layout)
    inside = [strip for strip in layout.strips if strip.tunnel]
    assert [sorted(strip.left_m[[0, -1], 0].round(6).tolist()) for strip in inside] == [[30.0, 60.0]] * 2
    assert layout.tunnel_levels == range(2, 3), "above the ground and the bridge"
    assert {strip.level for strip in inside} == {2}
    assert {strip.level for strip in layout.strips if not strip.tunnel} == {0, 1}


@pytest.mark.slow
def test_a_hundred_thousand_tunnels_on_a_road_are_read_in_seconds(tmp_path: Path) -> None:
    tunnels = "".join(f'<tunnel s="{k / 1000}" length="0.0004"/>' for k in range(100_000))
    start_s = time.process_time()
    parts = import_sample(tmp_path, with_objects(tunnels))
    assert parts.layout is not None and parts.layout.strips
    assert time.process_time() - start_s < 10.0
