"""Routes follow the net, keep to what a class may use, and last as long as they must."""

from dataclasses import replace
from functools import cache
from itertools import pairwise
from xml.etree import ElementTree

import numpy as np
import pytest

from simbev_ros.errors import SimulationError
from simbev_ros.maps.build import load_network
from simbev_ros.maps.network import Lane, RoadNetwork
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.spec import MapSpec
from simbev_ros.maps.vehicle_class import open_to
from simbev_ros.random import stream
from simbev_ros.scene.streets.street_graph import Streets


@cache
def blocks() -> RoadNetwork:
    return load_network(MapSpec(name="Blocks"))


def lane(name: str, *successors: str, length_m: float = 100.0, junction: str = "", allow: str = "") -> Lane:
    line_m = np.array([[0.0, 0.0, 0.0], [length_m, 0.0, 0.0]])
    edge, index = name.rsplit("_", 1)
    classes = open_to(allow, "")
    return Lane(name, edge, int(index), LaneKind.DRIVING, line_m, 3.5, 13.9, junction, successors, classes=classes)


def network(*lanes: Lane) -> RoadNetwork:
    return replace(blocks(), lanes={each.id: each for each in lanes})


def fit(roads: RoadNetwork, way_m: float, sumo_class: str = "passenger", s_m: float = 0.0) -> set[str]:
    """Lanes on which a vehicle can start at ``s_m``."""
    streets = Streets(roads)
    rows = np.arange(len(streets.lanes))
    good = streets.for_class(sumo_class).fit(rows, np.full(len(rows), s_m), way_m)
    return {each.id for each, is_good in zip(streets.lanes, good, strict=True) if is_good}


def test_routes_follow_connections_of_the_net() -> None:
    net = ElementTree.parse(blocks().net_path).getroot()
    connected = {(element.attrib["from"], element.attrib["to"]) for element in net.iter("connection")}
    graph = Streets(blocks()).for_class("passenger")
    for index, start in enumerate(blocks().waypoints(24.0).lane[::7]):
        route = graph.route(start, 3000.0, stream(1, f"test.{index}"))
        assert all(pair in connected for pair in pairwise(route))
        first = (route[0], start.rsplit("_", 1)[1], route[1])
        fields = ("from", "fromLane", "to")
        assert any(tuple(element.attrib[name] for name in fields) == first for element in net.iter("connection"))


def test_routes_are_long_enough() -> None:
    start = blocks().waypoints(24.0).lane[0]
    route = Streets(blocks()).for_class("bus").route(start, 2500.0, stream(1, "test"))
    length_of = {each.edge: each.length_m for each in blocks().lanes.values() if each.kind is LaneKind.DRIVING}
    assert 2500.0 <= sum(length_of[edge] for edge in route[1:]) < 3000.0


def test_a_route_takes_a_way_that_ends_only_if_it_is_long_enough_or_there_is_nothing_else() -> None:
    graph = Streets(network(lane("A_0", "B_0", "D_0"), lane("B_0", "A_0"), lane("D_0", "E_0"), lane("E_0"))).for_class(
        "passenger"
    )
    assert set(graph.route("A_0", 5000.0, stream(1, "test"))[:-2]) == {"A", "B"}
    assert graph.route("D_0", 5000.0, stream(1, "test")) == ("D", "E")
    seconds = {graph.route("A_0", 150.0, stream(seed, "test"))[1] for seed in range(20)}
    assert seconds == {"B", "D"}


def test_streets_that_only_a_junction_joins_follow_each_other_through_all_its_lanes() -> None:
    graph = Streets(
        network(lane("A_0", ":j_0"), lane(":j_0", ":j_1", junction="j"), lane(":j_1", "B_0", junction="j"), lane("B_0"))
    ).for_class("passenger")
    assert graph.route("A_0", 50.0, stream(1, "test")) == ("A", "B")


def test_a_route_keeps_to_lanes_that_its_class_may_use() -> None:
    fork = network(
        lane("A_0", "B_0", ":j_0"),
        lane("B_0", "A_0", allow="bus emergency"),
        lane(":j_0", "C_0", junction="j"),
        lane("C_0", "A_0"),
    )
    streets = Streets(fork)
    assert set(streets.for_class("passenger").route("A_0", 5000.0, stream(1, "test"))) == {"A", "C"}
    assert set(streets.for_class("bus").route("A_0", 5000.0, stream(1, "test"))) == {"A", "B", "C"}
    with pytest.raises(SimulationError, match="class passenger cannot start on lane B_0"):
        streets.for_class("passenger").route("B_0", 100.0, stream(1, "test"))
    with pytest.raises(SimulationError, match="class bus cannot start on lane :j_0"):
        streets.for_class("bus").route(":j_0", 100.0, stream(1, "test"))
    assert fit(fork, 150.0) == {"A_0", "C_0"}
    assert fit(fork, 150.0, "bus") == {"A_0", "B_0", "C_0"}


def test_vehicles_start_where_the_way_ahead_is_long_enough() -> None:
    road = network(lane("A_0", "B_0", "F_0"), lane("B_0", "C_0"), lane("C_0"), lane("F_0", length_m=30.0))
    assert fit(road, 250.0) == {"A_0"}
    assert fit(road, 150.0) == {"A_0", "B_0"}
    assert fit(road, 150.0, s_m=60.0) == {"A_0"}


def test_islands_are_avoided_unless_there_is_nothing_else() -> None:
    ring = (lane("A_0", "B_0"), lane("B_0", "C_0"), lane("C_0", "A_0"))
    island = (lane("X_0", "Y_0", length_m=40.0), lane("Y_0", "X_0", length_m=40.0))
    assert fit(network(*ring, *island), 200.0) == {"A_0", "B_0", "C_0"}
    assert fit(network(*ring, *island), 5000.0) == {"A_0", "B_0", "C_0"}, "nothing is that long"
    assert fit(network(*island), 5000.0) == {"X_0", "Y_0"}
    assert fit(network(lane("A_0", length_m=100.0), lane("-A_0", length_m=99.0)), 500.0) == {"A_0", "-A_0"}


def test_the_way_ahead_is_the_longest_one_of_a_random_net() -> None:
    rng = np.random.default_rng(4)
    names = [f"E{k}_0" for k in range(30)]
    lengths_m = rng.uniform(20.0, 200.0, len(names))
    followers = [sorted({int(j) for j in rng.integers(k + 1, 31, 3)} - {30}) for k in range(30)]
    lanes = [
        lane(name, *(names[j] for j in after), length_m=float(length))
        for name, after, length in zip(names, followers, lengths_m, strict=True)
    ]

    @cache
    def longest_m(k: int) -> float:
        return float(lengths_m[k]) + max((longest_m(j) for j in followers[k]), default=0.0)

    for way_m in (150.0, 400.0, 800.0):
        assert fit(network(*lanes), way_m) == {names[k] for k in range(30) if longest_m(k) >= way_m}


def test_nobody_is_led_onto_closed_edges_or_those_that_lead_only_there() -> None:
    roads = network(
        lane("A_0", "B_0", "C_0", "P_0"), lane("B_0", "A_0"), lane("C_0", "A_0"), lane("P_0", "B_0"), lane("D_0", "P_0")
    )
    graph = Streets(roads).for_class("passenger")
    assert graph.cut_off({"B"}) == {"B", "P", "D"}
    assert set(graph.avoiding({"B"}).route("A_0", 5000.0, stream(1, "test"))) == {"A", "C"}
    assert graph.avoiding({"B"}).leads_on("B_0") and not graph.avoiding({"B"}).leads_on("P_0")
