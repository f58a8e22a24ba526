from itertools import pairwise
from xml.etree import ElementTree

import pytest
from world_scenes import blocks, lane, network

from simbev_ros.errors import SimulationError
from simbev_ros.maps.lane_kind import LaneKind
from simbev_ros.random import stream
from simbev_ros.world.routes import StreetGraph, WalkGraph


@pytest.fixture(scope="module")
def net():
    return ElementTree.parse(blocks().net_path).getroot()


def toy_net(**attributes):
    lanes = "".join(f'<lane id="{name}" {value}/>' for name, value in attributes.items())
    return ElementTree.fromstring(f"<net>{lanes}</net>")


def test_routes_follow_connections_of_the_net(net):
    connected = {(element.attrib["from"], element.attrib["to"]) for element in net.iter("connection")}
    graph = StreetGraph(blocks(), net, "passenger")
    for index, start in enumerate(blocks().waypoints(24.0).lane[::7]):
        route = graph.route(start, 3000.0, stream(1, f"test.{index}"))
        assert all(pair in connected for pair in pairwise(route))
        first = (route[0], start.rsplit("_", 1)[1], route[1])
        fields = ("from", "fromLane", "to")
        assert any(tuple(element.attrib[name] for name in fields) == first for element in net.iter("connection"))


def test_routes_are_long_enough(net):
    start = blocks().waypoints(24.0).lane[0]
    route = StreetGraph(blocks(), net, "bus").route(start, 2500.0, stream(1, "test"))
    length_of = {each.edge: each.length_m for each in blocks().lanes.values() if each.kind is LaneKind.DRIVING}
    assert 2500.0 <= sum(length_of[edge] for edge in route[1:]) < 3000.0


def test_a_route_takes_a_dead_end_only_where_there_is_nothing_else():
    around = network(lane("A_0", ("B_0", "D_0")), lane("B_0", ("A_0",)), lane("D_0"))
    graph = StreetGraph(around, toy_net(A_0="", B_0="", D_0=""), "passenger")
    assert set(graph.route("A_0", 5000.0, stream(1, "test"))) == {"A", "B"}
    assert graph.route("D_0", 5000.0, stream(1, "test")) == ("D",)


def test_a_route_keeps_to_lanes_that_its_class_may_use():
    fork = network(lane("A_0", ("B_0", "C_0")), lane("B_0", ("A_0",)), lane("C_0", ("A_0",)))
    net = toy_net(A_0="", B_0='allow="bus emergency"', C_0='disallow="pedestrian"')
    assert set(StreetGraph(fork, net, "passenger").route("A_0", 5000.0, stream(1, "test"))) == {"A", "C"}
    assert set(StreetGraph(fork, net, "bus").route("A_0", 5000.0, stream(1, "test"))) == {"A", "B", "C"}
    with pytest.raises(SimulationError, match="class passenger cannot start on lane B_0"):
        StreetGraph(fork, net, "passenger").route("B_0", 100.0, stream(1, "test"))


def test_walks_go_on_over_what_touches_and_do_not_turn_back_on_a_sidewalk():
    graph = WalkGraph(blocks())
    touching = {(a.edge, blocks().lanes[b].edge) for a in blocks().lanes.values() for b in a.successors}
    touching |= {(b, a) for a, b in touching}
    for index, start in enumerate(each for each in blocks().lanes.values() if each.kind is LaneKind.SIDEWALK):
        walk = graph.walk(start.edge, 1500.0, stream(2, f"test.{index}"))
        assert all(pair in touching for pair in pairwise(walk))
        assert all(a != c for a, b, c in zip(walk, walk[1:], walk[2:], strict=False) if not b.startswith(":"))
        assert not walk[-1].startswith(":")


def test_walks_set_out_in_both_directions():
    start = next(each.edge for each in blocks().lanes.values() if each.kind is LaneKind.SIDEWALK)
    seconds = {WalkGraph(blocks()).walk(start, 200.0, stream(seed, "test"))[1] for seed in range(20)}
    assert len(seconds) == 2


def test_a_walk_ends_where_nothing_can_be_reached():
    alone = network(lane("A_0", kind=LaneKind.SIDEWALK))
    assert WalkGraph(alone).walk("A", 1000.0, stream(1, "test")) == ("A",)
