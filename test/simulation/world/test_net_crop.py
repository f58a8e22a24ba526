"""A cropped network keeps its streets and junctions, and a simulation on it runs exactly as on the whole network."""

import re
from xml.etree import ElementTree

import numpy as np
import pytest
from world_scenes import blocks, run, scene

from simbev_ros.scene.streets.streets import Streets
from simbev_ros.simulation.world import simulation
from simbev_ros.simulation.world.demand import demand_of
from simbev_ros.simulation.world.sumo.net_crop import CroppedNet, crop_net


def whole_net() -> str:
    return blocks().net_path.read_text(encoding="utf-8")


def by_id(root: ElementTree.Element, tag: str) -> dict[str, bytes]:
    return {each.attrib["id"]: ElementTree.tostring(each).strip() for each in root.iter(tag)}


def test_kept_edges_and_the_junctions_at_their_ends_are_unchanged() -> None:
    streets = Streets(blocks())
    start = next(lane for lane in streets.lanes if not lane.junction)
    route = streets.for_class("passenger").draw_route(start.id, 300.0, np.random.default_rng(1))
    cropped = crop_net(whole_net(), route)
    before, after = ElementTree.fromstring(whole_net()), ElementTree.fromstring(cropped.xml)
    edges, kept = by_id(before, "edge"), by_id(after, "edge")
    assert set(route) < kept.keys() == cropped.edges
    assert len(kept) < len(edges) / 2
    assert all(edges[name] == text for name, text in kept.items())
    ends = {
        end
        for edge in after.iter("edge")
        if edge.attrib["id"] in route
        for end in (edge.attrib["from"], edge.attrib["to"])
    }
    junctions, kept_junctions = by_id(before, "junction"), by_id(after, "junction")
    assert all(kept_junctions[name] == junctions[name] for name in ends)
    borders = [each for each in after.iter("junction") if each.attrib["type"] == "dead_end"]
    assert borders and not ends.intersection(each.attrib["id"] for each in borders)
    for border in borders:
        assert {lane.rsplit("_", 1)[0] for lane in border.attrib["incLanes"].split()} <= cropped.edges
    known = {lane.attrib["id"] for lane in after.iter("lane")}
    for connection in after.iter("connection"):
        assert {connection.attrib["from"], connection.attrib["to"]} <= cropped.edges
        assert connection.attrib.get("via", next(iter(known))) in known
    assert cropped.lights == {each.attrib["id"] for each in after.iter("tlLogic")}


def test_a_scene_on_the_cropped_net_equals_the_scene_on_the_whole_net(monkeypatch: pytest.MonkeyPatch) -> None:
    spec = scene(vehicles=12, pedestrians=12, ticks=80)
    assert len(crop_net(whole_net(), demand_of(spec, blocks()).edges).xml) < len(whole_net())
    cropped = run(spec)

    def uncropped(net: str, used: object) -> CroppedNet:
        return CroppedNet(
            net, set(re.findall(r'<edge id="([^"]+)"', net)), set(re.findall(r'<tlLogic id="([^"]+)"', net))
        )

    monkeypatch.setattr(simulation, "crop_net", uncropped)
    for state, complete in zip(cropped, run(spec), strict=True):
        assert np.array_equal(state.actors["id"], complete.actors["id"])
        for name in ("x", "y", "z", "yaw", "vx", "vy"):
            np.testing.assert_allclose(state.actors[name], complete.actors[name], atol=1e-6)
        assert np.array_equal(state.signals, complete.signals)


def test_elements_without_children_and_tags_in_comments_are_handled() -> None:
    net = (
        '<?xml version="1.0"?>\n<!-- <type-files value="a"/> -->\n<net>\n<location netOffset="0,0"/>\n'
        '<edge id=":J_0" function="internal"><lane id=":J_0_0" shape="0,0 1,1"/></edge>\n'
        '<edge id="A" from="I" to="J"><lane id="A_0" shape="0,0 1,1"/></edge>\n'
        '<edge id="B" from="J" to="K"><lane id="B_0" shape="0,0 1,1"/></edge>\n'
        '<edge id="C" from="K" to="L"><lane id="C_0" shape="0,0 1,1"/></edge>\n'
        '<junction id="J" type="right" incLanes="A_0" intLanes=":J_0_0"><request index="0"/></junction>\n'
        '<junction id="K" x="3" y="4" type="right" incLanes="B_0 X_0" intLanes=":K_0_0"><request/></junction>\n'
        '<junction id="I" type="dead_end" incLanes="" intLanes=""/>\n'
        '<junction id="L" type="dead_end" incLanes="C_0"/>\n'
        '<connection from="A" to="B" fromLane="0" toLane="0" via=":J_0_0" dir="s" state="M"/>\n'
        '<connection from=":J_0" to="B" fromLane="0" toLane="0" dir="s" state="M"/>\n'
        '<connection from="B" to="C" fromLane="0" toLane="0" dir="s" state="M"/>\n</net>'
    )
    root = ElementTree.fromstring(crop_net(net, ["A"]).xml)
    assert list(by_id(root, "edge")) == [":J_0", "A", "B"]
    junctions = {each.attrib["id"]: each for each in root.iter("junction")}
    assert junctions.keys() == {"I", "J", "K"}
    assert junctions["K"].attrib == {
        "id": "K",
        "x": "3",
        "y": "4",
        "type": "dead_end",
        "incLanes": "B_0",
        "intLanes": "",
    }
    assert len(root.findall("connection")) == 2
