from pathlib import Path

import numpy as np
import pytest
import sumolib

from simbev_ros.foundation.errors import SimulationError
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.levels import assign_levels
from simbev_ros.maps.sumo.layout import layout_of
from simbev_ros.maps.sumo.net import read_sumo_net

_NET = """<net version="1.20">
  <edge id=":B_0" function="internal"><lane id=":B_0_0" index="0" speed="5" length="8" shape="50,0,2 58,0,2.5"/></edge>
  <edge id=":B_c0" function="crossing">
    <lane id=":B_c0_0" index="0" allow="pedestrian" speed="1" length="7" width="4" shape="52,-4 52,4"/></edge>
  <edge id=":B_w0" function="walkingarea">
    <lane id=":B_w0_0" index="0" allow="pedestrian" speed="1" length="1" width="2" shape="50,4 54,4 54,6"/></edge>
  <edge id="AB" from="A" to="B">
    <lane id="AB_0" index="0" allow="pedestrian" speed="14" length="50" width="2.5" shape="0,-4 50,-4"/>
    <lane id="AB_1" index="1" allow="bicycle" speed="14" length="50" width="1.5" shape="0,-2 50,-2"/>
    <lane id="AB_2" index="2" disallow="all" speed="14" length="50" shape="0,-1 50,-1"/>
    <lane id="AB_3" index="3" allow="bus taxi" speed="14" length="50" width="3" shape="0,0,0 30,0,1 30,0.001,1 50,0,2"/>
  </edge>
  <edge id="BC" from="B" to="C">
    <lane id="BC_0" index="0" disallow="pedestrian" speed="9" length="9" shape="58,0 67,0"/></edge>
  <junction id="B" type="traffic_light" x="54" y="0" z="2" incLanes="AB_3" intLanes=":B_0_0" shape="50,-2 58,-2 58,2"/>
  <junction id=":B_0_0" type="internal" x="51" y="0" incLanes="" intLanes=""/>
  <connection from="AB" to="BC" fromLane="3" toLane="0" via=":B_0_0" tl="T" linkIndex="4" dir="s" state="O"/>
  <connection from=":B_0" to="BC" fromLane="0" toLane="0" dir="s" state="M"/>
</net>"""


def test_kinds_links_and_elevation_are_read(tmp_path: Path) -> None:
    path = tmp_path / "small.net.xml"
    path.write_text(_NET)
    net = read_sumo_net(path)
    assert {lane.id: lane.kind.value for lane in net.lanes.values()} == {
        ":B_0_0": "driving",
        ":B_c0_0": "crossing",
        ":B_w0_0": "walking_area",
        "AB_0": "sidewalk",
        "AB_1": "bicycle",
        "AB_2": "shoulder",
        "AB_3": "driving",
        "BC_0": "driving",
    }
    assert net.lanes["AB_3"].successors == (":B_0_0",)
    assert net.lanes[":B_0_0"].successors == ("BC_0",)
    assert net.lanes[":B_0_0"].junction == net.lanes[":B_w0_0"].junction == "B"
    assert net.lanes["AB_3"].centerline_m.tolist() == [[0, 0, 0], [30, 0, 1], [50, 0, 2]], (
        "the repeated point is removed"
    )
    assert net.lanes["AB_2"].width_m == 3.2
    assert list(net.junctions) == ["B"]
    assert net.junctions["B"].signalised
    assert [(link.lane, link.programme, link.link, link.direction) for link in net.links] == [("AB_3", "T", 4, "s")]


def test_file_that_is_not_a_net_is_refused_by_name(tmp_path: Path) -> None:
    path = tmp_path / "broken.net.xml"
    path.write_text("<net")
    with pytest.raises(SimulationError, match=r"broken\.net\.xml"):
        read_sumo_net(path)


def test_sumos_own_reader_finds_the_same_lanes(blocks: RoadNetwork) -> None:
    reference = sumolib.net.readNet(str(blocks.net_path), withInternal=True)
    lanes = {lane.getID(): lane for edge in reference.getEdges() for lane in edge.getLanes()}
    assert set(lanes) == set(blocks.lanes)
    for lane in blocks.lanes_of(LaneKind.DRIVING):
        assert lane.width_m == lanes[lane.id].getWidth()
        assert lane.length_m * lane.sumo_s_per_m == pytest.approx(lanes[lane.id].getLength(), abs=1e-6)
        assert lane.sumo_s_per_m == pytest.approx(1.0, abs=0.02)
        followers = {link.getViaLaneID() or link.getToLane().getID() for link in lanes[lane.id].getOutgoing()}
        assert set(lane.successors) == followers
    assert all(np.isfinite(lane.centerline_m).all() for lane in blocks.lanes.values())


def test_a_walking_area_without_area_is_a_strip_along_its_line(tmp_path: Path) -> None:
    path = tmp_path / "small.net.xml"
    path.write_text(_NET.replace("50,4 54,4 54,6", "50,4 54,4"))
    layout = assign_levels(layout_of(read_sumo_net(path)), ())
    strip = next(strip for strip in layout.strips if strip.id == ":B_w0_0")
    assert strip.outline_m is None
    np.testing.assert_allclose(strip.left_m[:, 1] - strip.right_m[:, 1], 2.0)
