"""Crossings where the file has none: one for each arm of a junction, however many roads the arm consists of."""

import numpy as np
import pytest

from simbev_ros.maps.lane_graph.crossings import planned_crossings
from simbev_ros.maps.lane_graph.traffic import Traffic, TrafficEdge, TrafficLane
from simbev_ros.maps.roads.lane_kind import LaneKind


def edge(name: str, road: str, heading_deg: float, to_node: bool, aside_m: float = 0.0) -> TrafficEdge:
    """One direction of an arm that leads away from the node at this heading, beside the arm's middle."""
    ahead = np.array([np.cos(np.radians(heading_deg)), np.sin(np.radians(heading_deg)), 0.0])
    line_m = np.array([10.0, 60.0])[:, None] * ahead + aside_m * np.array([-ahead[1], ahead[0], 0.0])
    line_m = line_m[::-1] if to_node else line_m
    lanes = tuple(TrafficLane((), kind, line_m, 3.0, 8.0) for kind in (LaneKind.SIDEWALK, LaneKind.DRIVING))
    ends = (f"end of {road}", "node") if to_node else ("node", f"end of {road}")
    return TrafficEdge(name, road, *ends, lanes, line_m)


@pytest.mark.parametrize(
    ("median_m", "crossed"),
    [(0.4, {"north in and north out", "east", "south"}), (4.0, {"north in", "north out", "east", "south"})],
)
def test_people_cross_a_street_whose_directions_are_two_roads_without_a_stop_in_its_middle(median_m, crossed) -> None:
    edges = [edge(road, road, heading_deg, True) for road, heading_deg in (("east", 0.0), ("south", -90.0))]
    edges += [
        edge("north in", "1", 90.0, True, median_m / 2.0),
        edge("north out", "2", 90.0, False, -median_m / 2.0),
    ]
    crossings = planned_crossings((), Traffic(tuple(edges), ()), {"node"}, left_hand=False)
    assert {" and ".join(each.edges) for each in crossings} == crossed
    assert {each.node for each in crossings} == {"node"}


def test_a_street_that_leads_on_has_no_crossing_even_where_its_directions_are_roads_of_their_own() -> None:
    edges = [
        edge(f"{heading_deg} {to_node}", f"{heading_deg} {to_node}", heading_deg, to_node)
        for heading_deg in (0.0, 180.0)
        for to_node in (True, False)
    ]
    assert planned_crossings((), Traffic(tuple(edges), ()), {"node"}, left_hand=False) == ()
