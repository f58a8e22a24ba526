"""Crossfall by rule on hand-written nets; expected heights are computed from 2 % and the distance from the crown."""

from pathlib import Path

import numpy as np
import pytest

from simbev_ros.maps.roads.elevation import Elevation
from simbev_ros.maps.roads.layout import Layout, Strip
from simbev_ros.maps.roads.levels import assign_levels
from simbev_ros.maps.sumo.layout import layout_of
from simbev_ros.maps.sumo.net import read_sumo_net

_FALL = 0.02
_STREET = """<net version="1.20">
  <edge id=":J_0" function="internal"><lane id=":J_0_0" index="0" speed="9" length="20" shape="200,-1.75 220,-1.75"/>
  </edge>
  <edge id=":J_1" function="internal"><lane id=":J_1_0" index="0" speed="9" length="20" shape="220,1.75 200,1.75"/>
  </edge>
  <edge id="AJ" from="A" to="J">
    <lane id="AJ_0" index="0" type="sidewalk" allow="pedestrian" speed="14" length="200" width="2" shape="0,-6 200,-6"/>
    <lane id="AJ_1" index="1" allow="bicycle" speed="14" length="200" width="1.5" shape="0,-4.25 200,-4.25"/>
    <lane id="AJ_2" index="2" speed="14" length="200" width="3.5" shape="0,-1.75 200,-1.75"/>
  </edge>
  <edge id="JA" from="J" to="A">
    <lane id="JA_0" index="0" speed="14" length="200" width="3.5" shape="200,1.75 0,1.75"/>
  </edge>
  <edge id="JC" from="J" to="C">
    <lane id="JC_0" index="0" speed="14" length="200" width="3.5" shape="220,-1.75 420,-1.75"/>
  </edge>
  <edge id="CJ" from="C" to="J">
    <lane id="CJ_0" index="0" speed="14" length="200" width="3.5" shape="420,1.75 220,1.75"/>
  </edge>
  {third}
  <connection from="AJ" to="JC" fromLane="2" toLane="0" via=":J_0_0" dir="s" state="M"/>
  <connection from=":J_0" to="JC" fromLane="0" toLane="0" dir="s" state="M"/>
  <connection from="CJ" to="JA" fromLane="0" toLane="0" via=":J_1_0" dir="s" state="M"/>
  <connection from=":J_1" to="JA" fromLane="0" toLane="0" dir="s" state="M"/>
</net>"""
_THIRD = """<edge id="DJ" from="D" to="J">
    <lane id="DJ_0" index="0" speed="8" length="50" width="3" shape="210,-60 210,-10"/></edge>"""
_MOTORWAY = """<net version="1.20" {side}>
  <edge id="AB" from="A" to="B">
    <lane id="AB_0" index="0" type="shoulder" disallow="all" speed="30" length="600" width="2.5" shape="0,{a} 600,{a}"/>
    <lane id="AB_1" index="1" speed="30" length="600" width="4" shape="0,{b} 600,{b}"/>
    <lane id="AB_2" index="2" speed="30" length="600" width="4" shape="0,{c} 600,{c}"/>
    <lane id="AB_3" index="3" type="median" disallow="all" speed="30" length="600" width="2" shape="0,{d} 600,{d}"/>
  </edge>
</net>"""


def _layout(folder: Path, net: str) -> Layout:
    path = folder / "t.net.xml"
    path.write_text(net)
    return layout_of(read_sumo_net(path))


def _strips(layout: Layout) -> dict[str, Strip]:
    return {strip.id: strip for strip in layout.strips}


def _height_m(layout: Layout, x: float, *y: float) -> np.ndarray:
    return Elevation(layout).height_m(np.array([(x, each) for each in y]))


def test_a_street_falls_from_its_crown_to_both_curbs_and_sidewalks_are_level_there(tmp_path: Path) -> None:
    layout = _layout(tmp_path, _STREET.format(third=_THIRD))
    offsets_m = 1.0, 1.75, 3.0, -1.75, -3.0, -4.25
    assert _height_m(layout, 100.0, *offsets_m) == pytest.approx(-_FALL * np.abs(offsets_m), abs=0.005)
    assert _height_m(layout, 102.0, *offsets_m) == pytest.approx(-_FALL * np.abs(offsets_m), abs=0.005), (
        "between samples too"
    )
    assert _height_m(layout, 100.0, 0.0) == pytest.approx(0.0, abs=1e-9)
    walk = _strips(layout)["AJ_0"]
    middle = np.abs(walk.left_m[:, 0] - 100.0) < 80.0
    assert walk.left_m[middle, 2] == pytest.approx(-_FALL * 5.0)
    assert walk.right_m[:, 2] == pytest.approx(walk.left_m[:, 2])


def test_junctions_and_dead_ends_are_level_and_crossfall_fades_smoothly_towards_them(tmp_path: Path) -> None:
    layout = _layout(tmp_path, _STREET.format(third=_THIRD))
    strips = _strips(layout)
    assert not any(strips[":J_0_0"].right_m[:, 2])
    assert not strips[":J_0_0"].continues
    for strip in layout.strips:
        assert not any(side_m[end, 2] for side_m in (strip.left_m, strip.right_m) for end in (0, -1))
    edge_m = strips["CJ_0"].right_m[::-1]  # starting at the junction; on a narrow carriageway it fades over 15 m
    part = np.clip((edge_m[:, 0] - 220.0) / 15.0, 0.0, 1.0) * (edge_m[:, 0] < 300.0)
    near = edge_m[:, 0] < 300.0
    assert near.sum() > 5
    assert edge_m[near, 2] == pytest.approx(-_FALL * 3.5 * (part**2 * (3.0 - 2.0 * part))[near])
    x = np.arange(215.0, 260.0, 0.25)
    height_m = Elevation(layout).height_m(np.column_stack([x, np.full(len(x), 3.0)]))
    assert np.abs(np.diff(height_m)).max() < 0.25 * 0.009


def test_lanes_of_an_edge_and_of_both_directions_meet_without_a_step(tmp_path: Path) -> None:
    strips = _strips(_layout(tmp_path, _STREET.format(third=_THIRD)))
    assert strips["AJ_1"].left_m == pytest.approx(strips["AJ_2"].right_m)
    assert strips["AJ_0"].left_m == pytest.approx(strips["AJ_1"].right_m)
    assert not strips["AJ_2"].left_m[:, 2].any()
    assert not strips["JA_0"].left_m[:, 2].any()


def test_crossfall_continues_through_nodes_where_the_road_continues(tmp_path: Path) -> None:
    layout = _layout(tmp_path, _STREET.format(third=""))
    strips = _strips(layout)
    assert strips[":J_0_0"].continues
    for lane in (":J_0_0", ":J_1_0"):
        assert strips[lane].right_m[:, 2] == pytest.approx(-_FALL * 3.5)
        assert not strips[lane].left_m[:, 2].any()
    x = np.arange(150.0, 270.0, 0.5)
    height_m = Elevation(layout).height_m(np.column_stack([x, np.full(len(x), 1.75)]))
    assert height_m == pytest.approx(-_FALL * 1.75, abs=0.004)


@pytest.mark.parametrize(("side", "sign"), [("", -1.0), ('lefthand="true"', 1.0)])
def test_a_one_way_road_falls_to_its_outer_side_and_its_median_is_level(tmp_path: Path, side: str, sign: float) -> None:
    centers = {"a": sign * 9.25, "b": sign * 6.0, "c": sign * 2.0, "d": -sign * 1.0}
    layout = _layout(tmp_path, _MOTORWAY.format(side=side, **centers))
    at_m = np.array([1.0, 4.0, 7.0, 10.0])
    assert _height_m(layout, 300.0, *(sign * at_m)) == pytest.approx(-_FALL * at_m, abs=0.004)
    assert _height_m(layout, 300.0, -sign * 1.0) == pytest.approx(0.0, abs=0.002)
    outer = _strips(layout)["AB_0"]
    foot_m = outer.left_m if sign > 0.0 else outer.right_m
    falling = foot_m[foot_m[:, 0] < 300.0]
    assert falling[-1, 2] == pytest.approx(-_FALL * 10.5)
    assert falling[:, 2].min() > -_FALL * 10.5 - 1e-9
    slope = np.diff(foot_m[:, 2]) / np.diff(foot_m[:, 0])
    assert 0.004 < np.abs(slope).max() < 0.0075, "wide carriageways turn slowly"


def test_levels_cut_strips_without_changing_their_heights(tmp_path: Path) -> None:
    net = _STREET.format(third=_THIRD).replace(
        '<edge id="JC" from="J" to="C">', '<edge id="JC" from="J" to="C"><param key="structure" value="bridge"/>'
    )
    layout = _layout(tmp_path, net)
    cut = assign_levels(layout)
    assert len(cut.levels) == 2
    deck = next(strip for strip in cut.strips if strip.level == 1 and strip.lane == "JC_0")
    middle = np.abs(deck.right_m[:, 0] - 320.0) < 70.0
    assert deck.right_m[middle, 2] == pytest.approx(-_FALL * 3.5)
    offsets_m = -1.75, -3.0
    assert Elevation(cut).height_m(np.array([(320.0, y) for y in offsets_m]), 1) == pytest.approx(
        _FALL * np.array(offsets_m), abs=0.005
    )


def test_paths_of_pedestrians_around_a_junction_are_not_followed(tmp_path: Path) -> None:
    around = """<edge id=":J_w0" function="walkingarea">
      <lane id=":J_w0_0" index="0" allow="pedestrian" speed="1" length="1" width="2" shape="200,-8 204,-8 204,-5"/>
    </edge>
    <edge id=":J_c0" function="crossing">
      <lane id=":J_c0_0" index="0" allow="pedestrian" speed="1" length="9" width="3" shape="204,-6 204,6"/></edge>
    <connection from="AJ" to=":J_w0" fromLane="2" toLane="0" dir="s" state="M"/>
    <connection from=":J_w0" to=":J_c0" fromLane="0" toLane="0" dir="s" state="M"/>
    <connection from=":J_c0" to=":J_w0" fromLane="0" toLane="0" dir="s" state="M"/>"""
    path = tmp_path / "ring.net.xml"
    path.write_text(_STREET.format(third=around))
    strips = {strip.id: strip for strip in layout_of(read_sumo_net(path)).strips}
    assert strips["AJ_2"].right_m[-1, 2] == pytest.approx(-_FALL * 3.5), (
        "the street continues as if they were not there"
    )
