"""Routes follow the network, keep to lanes their class may use, and are long enough."""

from dataclasses import replace
from functools import cache
from itertools import pairwise
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from made_up_roads import made_up_lane, network_of

from simbev_ros.foundation.errors import SimulationError
from simbev_ros.foundation.random import stream
from simbev_ros.maps.build import load_network
from simbev_ros.maps.network import Lane, RoadNetwork
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.vehicle_class import open_to
from simbev_ros.scene.streets.streets import Streets
from simbev_ros.schema.scene.map_spec import MapSpec


@cache
def blocks() -> RoadNetwork:
    return load_network(MapSpec(name="Blocks"))


def lane(name: str, *successors: str, allow: str = "", **changes: Any) -> Lane:
    return made_up_lane(name, *successors, classes=open_to(allow, ""), **changes)


def network(*lanes: Lane) -> RoadNetwork:
    return network_of(blocks(), *lanes)


def usable_lanes(roads: RoadNetwork, distance_m: float, sumo_class: str = "passenger", s_m: float = 0.0) -> set[str]:
    """Lanes on which a vehicle can start at ``s_m``."""
    streets = Streets(roads)
    rows = np.arange(len(streets.lanes))
    usable = streets.for_class(sumo_class).usable_starts(rows, np.full(len(rows), s_m), distance_m)
    return {each.id for each, is_usable in zip(streets.lanes, usable, strict=True) if is_usable}


def test_routes_follow_connections_of_the_network() -> None:
    net = ElementTree.parse(blocks().net_path).getroot()
    connected = {(element.attrib["from"], element.attrib["to"]) for element in net.iter("connection")}
    graph = Streets(blocks()).for_class("passenger")
    for index, start in enumerate(blocks().waypoints(24.0).lane[::7]):
        route = graph.draw_route(start, 3000.0, stream(1, f"test.{index}"))
        assert all(pair in connected for pair in pairwise(route))
        first = (route[0], start.rsplit("_", 1)[1], route[1])
        fields = ("from", "fromLane", "to")
        assert any(tuple(element.attrib[name] for name in fields) == first for element in net.iter("connection"))


def test_routes_are_long_enough() -> None:
    start = blocks().waypoints(24.0).lane[0]
    route = Streets(blocks()).for_class("bus").draw_route(start, 2500.0, stream(1, "test"))
    length_of = {each.edge: each.length_m for each in blocks().lanes.values() if each.kind is LaneKind.DRIVING}
    assert 2500.0 <= sum(length_of[edge] for edge in route[1:]) < 3000.0


def test_a_route_takes_a_path_with_a_dead_end_only_if_it_is_long_enough_or_the_only_one() -> None:
    graph = Streets(network(lane("A_0", "B_0", "D_0"), lane("B_0", "A_0"), lane("D_0", "E_0"), lane("E_0"))).for_class(
        "passenger"
    )
    assert set(graph.draw_route("A_0", 5000.0, stream(1, "test"))[:-2]) == {"A", "B"}
    assert graph.draw_route("D_0", 5000.0, stream(1, "test")) == ("D", "E")
    seconds = {graph.draw_route("A_0", 150.0, stream(seed, "test"))[1] for seed in range(20)}
    assert seconds == {"B", "D"}


def test_streets_joined_by_a_junction_are_connected_through_all_its_lanes() -> None:
    graph = Streets(
        network(lane("A_0", ":j_0"), lane(":j_0", ":j_1", junction="j"), lane(":j_1", "B_0", junction="j"), lane("B_0"))
    ).for_class("passenger")
    assert graph.draw_route("A_0", 50.0, stream(1, "test")) == ("A", "B")


def test_a_route_keeps_to_lanes_that_its_class_may_use() -> None:
    fork = network(
        lane("A_0", "B_0", ":j_0"),
        lane("B_0", "A_0", allow="bus emergency"),
        lane(":j_0", "C_0", junction="j"),
        lane("C_0", "A_0"),
    )
    streets = Streets(fork)
    assert set(streets.for_class("passenger").draw_route("A_0", 5000.0, stream(1, "test"))) == {"A", "C"}
    assert set(streets.for_class("bus").draw_route("A_0", 5000.0, stream(1, "test"))) == {"A", "B", "C"}
    with pytest.raises(SimulationError, match="class passenger cannot start on lane B_0"):
        streets.for_class("passenger").draw_route("B_0", 100.0, stream(1, "test"))
    with pytest.raises(SimulationError, match="class bus cannot start on lane :j_0"):
        streets.for_class("bus").draw_route(":j_0", 100.0, stream(1, "test"))
    assert usable_lanes(fork, 150.0) == {"A_0", "C_0"}
    assert usable_lanes(fork, 150.0, "bus") == {"A_0", "B_0", "C_0"}


def test_vehicles_start_where_the_path_ahead_is_long_enough() -> None:
    road = network(lane("A_0", "B_0", "F_0"), lane("B_0", "C_0"), lane("C_0"), lane("F_0", length_m=30.0))
    assert usable_lanes(road, 250.0) == {"A_0"}
    assert usable_lanes(road, 150.0) == {"A_0", "B_0"}
    assert usable_lanes(road, 150.0, s_m=60.0) == {"A_0"}


def test_islands_are_avoided_unless_there_is_nothing_else() -> None:
    ring = (lane("A_0", "B_0"), lane("B_0", "C_0"), lane("C_0", "A_0"))
    island = (lane("X_0", "Y_0", length_m=40.0), lane("Y_0", "X_0", length_m=40.0))
    assert usable_lanes(network(*ring, *island), 200.0) == {"A_0", "B_0", "C_0"}
    assert usable_lanes(network(*ring, *island), 5000.0) == {"A_0", "B_0", "C_0"}, "nothing is that long"
    assert usable_lanes(network(*island), 5000.0) == {"X_0", "Y_0"}
    assert usable_lanes(network(lane("A_0", length_m=100.0), lane("-A_0", length_m=99.0)), 500.0) == {"A_0", "-A_0"}


def test_the_path_ahead_is_the_longest_one_of_a_random_network() -> None:
    rng = np.random.default_rng(4)
    names = [f"E{k}_0" for k in range(30)]
    lengths_m = rng.uniform(20.0, 200.0, len(names))
    successors = [sorted({int(j) for j in rng.integers(k + 1, 31, 3)} - {30}) for k in range(30)]
    lanes = [
        lane(name, *(names[j] for j in after), length_m=float(length))
        for name, after, length in zip(names, successors, lengths_m, strict=True)
    ]

    @cache
    def longest_m(k: int) -> float:
        return float(lengths_m[k]) + max((longest_m(j) for j in successors[k]), default=0.0)

    for distance_m in (150.0, 400.0, 800.0):
        assert usable_lanes(network(*lanes), distance_m) == {names[k] for k in range(30) if longest_m(k) >= distance_m}


def test_no_route_enters_closed_edges_or_those_that_lead_only_there() -> None:
    roads = network(
        lane("A_0", "B_0", "C_0", "P_0"), lane("B_0", "A_0"), lane("C_0", "A_0"), lane("P_0", "B_0"), lane("D_0", "P_0")
    )
    graph = Streets(roads).for_class("passenger")
    assert graph.cut_off_edges({"B"}) == {"B", "P", "D"}
    assert set(graph.without_edges({"B"}).draw_route("A_0", 5000.0, stream(1, "test"))) == {"A", "C"}
    assert graph.without_edges({"B"}).has_successor("B_0") and not graph.without_edges({"B"}).has_successor("P_0")


def street(name: str, from_m: tuple[float, float], to_m: tuple[float, float], *successors: str) -> Lane:
    """A straight lane between two positions."""
    return lane(name, *successors, line_m=[[*from_m, 0.0], [*to_m, 0.0]])


def test_no_route_turns_back_onto_its_road_where_another_one_follows() -> None:
    square = [
        street("E_0", (0, 0), (100, 0), "N_0", "-E_0"),
        street("N_0", (105, 5), (105, 100), "W_0"),
        street("W_0", (100, 105), (0, 105), "S_0"),
        street("S_0", (-5, 100), (-5, 5), "E_0"),
        street("-E_0", (100, 4), (0, 4), "E_0"),
    ]
    graph = Streets(network(*square)).for_class("passenger")
    for index in range(8):
        assert "-E" not in graph.draw_route("E_0", 900.0, stream(1, f"test.{index}"))


def test_a_route_turns_back_where_only_that_leads_on() -> None:
    there, back = street("E_0", (0, 0), (100, 0), "-E_0"), street("-E_0", (100, 4), (0, 4), "E_0")
    graph = Streets(network(there, back)).for_class("passenger")
    assert graph.draw_route("E_0", 250.0, stream(1, "test")) == ("E", "-E", "E", "-E")


def test_on_a_map_that_only_turns_lead_back_into_they_are_driven() -> None:
    there = street("E_0", (0, 0), (100, 0), "-E_0", "out_0")
    roads = network(there, street("-E_0", (100, 4), (0, 4), "E_0"), street("out_0", (100, 0), (150, 0)))
    assert usable_lanes(roads, 1000.0) == {"E_0", "-E_0"}


def test_on_a_small_map_vehicles_start_where_streets_lead_on_and_on() -> None:
    ring = [lane("A_0", "B_0"), lane("B_0", "A_0", "out_0"), lane("out_0")]
    assert usable_lanes(network(*ring), 250.0) == {"A_0", "B_0"}
    assert usable_lanes(network(*ring), 5000.0) == {"A_0", "B_0"}


def test_no_route_enters_a_short_loop_without_a_way_back_where_a_longer_one_follows() -> None:
    ring = [street(f"{name}_0", (0, 0), (400, 0), f"{after}_0") for name, after in zip("ABCD", "BCDA", strict=True)]
    ring[0] = replace(ring[0], successors=("B_0", "X_0"))
    trap = [street("X_0", (0, 0), (0, 50), "Y_0"), street("Y_0", (0, 50), (0, 0), "X_0")]
    graph = Streets(network(*ring, *trap)).for_class("passenger")
    assert all("X" not in graph.draw_route("A_0", 9000.0, stream(1, f"test.{index}")) for index in range(8))
    assert graph.loop_lanes_m() == pytest.approx(1600.0)


def test_a_map_is_closed_if_cars_get_from_everywhere_to_everywhere() -> None:
    ring = [lane("A_0", "B_0"), lane("B_0", "A_0")]
    assert Streets(network(*ring)).is_closed
    assert not Streets(network(ring[0], lane("B_0", "A_0", "out_0"), lane("out_0"))).is_closed
    there, back = street("E_0", (0, 0), (100, 0), "-E_0"), street("-E_0", (100, 4), (0, 4), "E_0")
    assert not Streets(network(there, back)).is_closed


def test_the_ends_of_roads_where_only_a_turn_follows_are_known() -> None:
    there, back = street("E_0", (0, 0), (100, 0), "-E_0"), street("-E_0", (100, 4), (0, 4), "W_0")
    on = [street("W_0", (-5, 4), (-100, 4), "N_0"), street("N_0", (-100, 24), (0, 40), "E_0")]
    assert Streets(network(there, back, *on)).for_class("passenger").turns_at_ends() == {"E": "-E"}


def test_vehicles_do_not_turn_at_the_end_of_a_road_so_short_that_the_others_would_wait_in_the_junction() -> None:
    stub = [street("E_0", (0, 0), (20, 0), "-E_0"), street("-E_0", (20, 4), (0, 4), "A_0")]
    ring = [street("A_0", (-10, 0), (-400, 0), "B_0"), street("B_0", (-400, 50), (0, 50), "A_0", "E_0")]
    graph = Streets(network(*ring, *stub)).for_class("passenger")
    assert graph.is_dead_end("E")
    assert all("E" not in graph.draw_route("A_0", 9000.0, stream(1, f"test.{index}")) for index in range(8))


def test_a_closure_that_leaves_no_loop_on_a_map_cut_out_of_a_city_is_known() -> None:
    ring = [lane("A_0", "B_0", "out_0"), lane("B_0", "A_0"), lane("out_0")]
    twin = [lane("P_0", "Q_0"), lane("Q_0", "P_0"), lane("R_0", "S_0"), lane("S_0", "R_0", "P_0")]
    graph = Streets(network(*ring, *twin)).for_class("passenger")
    assert graph.keeps_loops({"out"}) and not graph.keeps_loops({"A", "B"})


def test_a_detour_needs_no_lane_change() -> None:
    """Lane 0 leads right and lane 1 straight on; a vehicle that cannot change lanes must follow its own."""
    lanes = [lane("A_0", "R_0"), lane("A_1", "S_0"), lane("R_0", "A_0"), lane("S_0", "A_1")]
    graph = Streets(network(*lanes)).for_class("passenger")
    for index in range(8):
        route = graph.draw_route_without_lane_changes("A_0", 500.0, 0.0, stream(1, f"test.{index}"))
        assert route == ("A", "R", "A", "R", "A", "R")
