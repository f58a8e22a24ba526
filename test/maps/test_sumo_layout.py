from pathlib import Path

import numpy as np
import pytest

from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.layout import Layout, Paint, PaintColor, SignKind, Strip
from simbev_ros.maps.signs import place_signs
from simbev_ros.maps.sumo.layout import layout_of
from simbev_ros.maps.sumo.net import SumoNet, read_sumo_net
from simbev_ros.maps.sumo.right_of_way import minor_approaches

_NET = """<net version="1.20">
  <edge id=":J_0" function="internal"><lane id=":J_0_0" index="0" speed="9" length="10" shape="100,-1.75 110,-1.75"/>
  </edge>
  <edge id="AJ" from="A" to="J">
    <param key="structure" value="bridge"/>
    <lane id="AJ_0" index="0" type="sidewalk" allow="pedestrian" speed="14" length="100" width="2" shape="0,-8 100,-8"/>
    <lane id="AJ_1" index="1" type="parking" disallow="all" speed="14" length="100" width="2" shape="0,-6 100,-6"/>
    <lane id="AJ_2" index="2" speed="14" length="100" width="3.5" shape="0,-5.25 100,-5.25"/>
    <lane id="AJ_3" index="3" speed="14" length="100" width="3.5" shape="0,-1.75 100,-1.75"/>
  </edge>
  <edge id="JA" from="J" to="A">
    <lane id="JA_0" index="0" speed="14" length="97" width="3.5" shape="98,1.75 1,1.75"/>
  </edge>
  <edge id="JC" from="J" to="C">
    <lane id="JC_0" index="0" type="shoulder" disallow="all" speed="30" length="300" width="2" shape="110,-5 410,-5"/>
    <lane id="JC_1" index="1" speed="30" length="300" width="4" shape="110,-2 410,-2"/>
    <lane id="JC_2" index="2" type="median" disallow="all" speed="30" length="300" width="2" shape="110,1 410,1"/>
  </edge>
  <edge id="DJ" from="D" to="J">
    <lane id="DJ_0" index="0" speed="8" length="50" width="3" shape="105,-60 105,-10"/></edge>
  <junction id="A" type="priority" x="0" y="0"/>
  <junction id="J" type="priority" x="105" y="0"/>
  <junction id="C" type="dead_end" x="410" y="0"/>
  <junction id="D" type="dead_end" x="105" y="-60"/>
  <connection from="AJ" to="JC" fromLane="3" toLane="1" via=":J_0_0" dir="s" state="M"/>
  <connection from=":J_0" to="JC" fromLane="0" toLane="1" dir="s" state="M"/>
  <connection from="AJ" to="JA" fromLane="3" toLane="0" dir="t" state="m"/>
  <connection from="DJ" to="JC" fromLane="0" toLane="1" dir="r" state="{state}"/>
</net>"""


def _net(folder: Path, state: str = "m") -> SumoNet:
    path = folder / "t.net.xml"
    path.write_text(_NET.replace("{state}", state))
    return read_sumo_net(path)


@pytest.fixture
def layout(tmp_path: Path) -> Layout:
    return layout_of(_net(tmp_path))


def _strips(layout: Layout) -> dict[str, Strip]:
    return {strip.id: strip for strip in layout.strips}


def test_strips_are_lanes_with_their_borders_kinds_and_neighbours(layout: Layout) -> None:
    strips = _strips(layout)
    kinds = [strips[f"AJ_{lane}"].kind for lane in range(4)]
    assert kinds == [LaneKind.SIDEWALK, LaneKind.PARKING, LaneKind.DRIVING, LaneKind.DRIVING]
    assert [strips[f"AJ_{lane}"].index for lane in range(4)] == [-4, -3, -2, -1]
    left = strips["AJ_3"]
    assert left.left_m[:, 1] == pytest.approx(0.0)
    assert left.right_m[:, 1] == pytest.approx(-3.5)
    assert (left.left, left.right, left.following) == ("JA_0", "AJ_2", (":J_0_0", "JA_0"))
    assert strips["JA_0"].left == "AJ_3", "the other direction is beside it although its ends are not at the same place"
    assert (strips["JC_1"].left, strips["JC_2"].left, strips["AJ_0"].right) == ("JC_2", "", "")
    assert [strip.id for strip in layout.strips if strip.structure] == ["AJ_0", "AJ_1", "AJ_2", "AJ_3"]
    assert strips[":J_0_0"].junction == "J"


def test_paint_follows_from_what_lies_on_both_sides(layout: Layout) -> None:
    strips = _strips(layout)
    lines = {name: (strip.left_line.paint, strip.right_line.paint) for name, strip in strips.items()}
    assert lines["AJ_1"] == (Paint.SOLID, Paint.CURB), "parking begins at a solid line"
    assert lines["AJ_2"] == (Paint.BROKEN, Paint.SOLID)
    assert lines["AJ_3"] == (Paint.SOLID_SOLID, Paint.BROKEN)
    assert lines["JA_0"] == (Paint.SOLID_SOLID, Paint.SOLID), "no curb on its right"
    assert lines["JC_1"] == (Paint.SOLID, Paint.SOLID)
    assert lines["DJ_0"] == (Paint.NONE, Paint.NONE), "too quiet for paint"
    assert lines[":J_0_0"] == (Paint.NONE, Paint.NONE)
    assert strips["AJ_3"].left_line.color is strips["JC_1"].left_line.color is PaintColor.YELLOW
    assert strips["JC_1"].right_line.color is strips["AJ_3"].right_line.color is PaintColor.WHITE


@pytest.mark.parametrize(
    ("state", "sign", "yields"), [("m", SignKind.YIELD, True), ("s", SignKind.STOP, False), ("M", None, None)]
)
def test_minor_approach_has_a_line_and_a_sign(
    tmp_path: Path, state: str, sign: SignKind | None, yields: bool | None
) -> None:
    net = _net(tmp_path, state)
    layout = layout_of(net)
    assert minor_approaches(net) == ({"DJ": sign} if sign else {}), "turning round on AJ does not make it minor"
    assert [line.yields for line in layout.stop_lines] == ([] if yields is None else [yields])
    if sign is None:
        return
    assert layout.stop_lines[0].ends_m == pytest.approx(np.array([[106.25, -10.5, 0], [103.75, -10.5, 0]]), abs=1e-3)
    found = [each for each in place_signs(net, layout) if each.kind is sign]
    assert len(found) == 1
    assert found[0].foot_m == pytest.approx([105 + 1.5 + 0.7, -11.0, 0.0])
    assert found[0].yaw_rad == pytest.approx(-np.pi / 2), "towards those who come"
    assert found[0].lanes == ("DJ_0",)


def test_speed_limits_stand_where_they_begin_and_off_the_road(tmp_path: Path) -> None:
    net = _net(tmp_path)
    signs = {each.lanes[0]: each for each in place_signs(net, layout_of(net)) if each.kind is SignKind.SPEED_LIMIT}
    assert {lane: sign.speed_mps for lane, sign in signs.items()} == {"AJ_2": 14.0, "JC_1": 30.0, "DJ_0": 8.0}
    assert signs["JC_1"].foot_m == pytest.approx([122.0, -6.7, 0.0]), "right of the shoulder, 12 m after the junction"
    assert signs["AJ_2"].foot_m[1] == pytest.approx(-7.7), "on the sidewalk, right of the parking lane"
