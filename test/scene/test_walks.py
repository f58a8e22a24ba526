"""Random walks continue over adjacent sidewalks and crossings."""

from functools import cache
from itertools import pairwise

import pytest
from made_up_roads import made_up_sidewalk as sidewalk
from made_up_roads import network_of

from simbev_ros.foundation.random import stream
from simbev_ros.maps.build import load_network
from simbev_ros.maps.network import Lane, RoadNetwork
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.scene.streets.walks import WalkGraph
from simbev_ros.schema.scene.map_spec import MapSpec


@cache
def blocks() -> RoadNetwork:
    return load_network(MapSpec(name="Blocks"))


def network(*lanes: Lane) -> RoadNetwork:
    return network_of(blocks(), *lanes)


def test_walks_continue_on_adjacent_edges_and_do_not_turn_back_on_a_sidewalk() -> None:
    graph = WalkGraph(blocks())
    adjacent = {(a.edge, blocks().lanes[b].edge) for a in blocks().lanes.values() for b in a.successors}
    adjacent |= {(b, a) for a, b in adjacent}
    for index, start in enumerate(graph.sidewalks):
        walk = graph.draw_walk(start.edge, 1500.0, stream(2, f"test.{index}"))
        assert all(pair in adjacent for pair in pairwise(walk))
        assert all(a != c for a, b, c in zip(walk, walk[1:], walk[2:], strict=False) if not b.startswith(":"))
        assert not walk[-1].startswith(":")


def test_walks_start_in_both_directions() -> None:
    graph = WalkGraph(blocks())
    seconds = {graph.draw_walk(graph.sidewalks[0].edge, 200.0, stream(seed, "test"))[1] for seed in range(20)}
    assert len(seconds) == 2


def test_a_walk_ends_where_nothing_can_be_reached() -> None:
    assert WalkGraph(network(sidewalk("A_0"))).draw_walk("A", 1000.0, stream(1, "test")) == ("A",)


def test_the_length_of_connected_sidewalks_is_their_sum() -> None:
    graph = WalkGraph(
        network(
            sidewalk("A_0", ":c_0"),
            sidewalk(":c_0", "B_0", kind=LaneKind.CROSSING),
            sidewalk("B_0", length_m=60.0),
            sidewalk("C_0", length_m=70.0),
            sidewalk("D_0", classes=frozenset({"bicycle"})),
        )
    )
    assert graph.component_length_m() == pytest.approx({"A": 160.0, "B": 160.0, "C": 70.0})


def test_walks_do_not_use_lanes_of_vehicles_inside_junctions() -> None:
    inside = sidewalk(":J_0_0", "B_0", junction="J")
    around = sidewalk(":J_w0_0", "B_0", kind=LaneKind.WALKING_AREA, junction="J")
    apart = WalkGraph(network(sidewalk("A_0", ":J_0_0"), inside, sidewalk("B_0")))
    assert apart.component_length_m() == {"A": 100.0, "B": 100.0}
    joined = WalkGraph(network(sidewalk("A_0", ":J_0_0", ":J_w0_0"), inside, around, sidewalk("B_0")))
    assert joined.component_length_m() == {"A": 200.0, "B": 200.0}


def test_walks_lead_into_dead_ends_only_where_nothing_else_can_be_reached() -> None:
    def junction(*edges: str) -> Lane:
        return sidewalk(":j_0", *(f"{edge}_0" for edge in edges), length_m=5.0, kind=LaneKind.WALKING_AREA)

    ring = [sidewalk("B_0", ":k_0"), sidewalk("C_0", ":k_0"), sidewalk(":k_0", kind=LaneKind.WALKING_AREA)]
    graph = WalkGraph(network(sidewalk("A_0"), junction("A", "B", "C"), *ring, sidewalk("D_0")))
    for seed in range(20):
        assert graph.draw_walk("A", 50.0, stream(seed, "test"))[1] == ":j"
        assert "A" not in graph.draw_walk("B", 1000.0, stream(seed, "test"))
    graph = WalkGraph(network(sidewalk("A_0"), junction("A", "B"), sidewalk("B_0")))
    assert graph.draw_walk("A", 1000.0, stream(1, "test")) == ("A", ":j", "B")
