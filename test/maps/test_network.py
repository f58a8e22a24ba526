from collections import Counter

import numpy as np
import pytest
from analytic_maps import stack
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from simbev_ros.maps.hd_map import lane_record
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.level_members import LevelGraph


def test_waypoints_lie_on_their_lanes_24_m_apart(blocks: RoadNetwork) -> None:
    waypoints = blocks.waypoints(24.0)
    counts = Counter(waypoints.lane)
    for position_m, lane_id, s_m in zip(waypoints.position_m, waypoints.lane, waypoints.s_m, strict=True):
        line_m = blocks.lanes[lane_id].centerline_m
        steps_m = np.diff(line_m, axis=0)
        along = np.clip(((position_m - line_m[:-1]) * steps_m).sum(1) / (steps_m**2).sum(1), 0, 1)
        assert np.linalg.norm(line_m[:-1] + along[:, None] * steps_m - position_m, axis=1).min() < 1e-6
        assert (s_m - 12.0) % 24.0 < 1e-9
    for lane in blocks.lanes_of(LaneKind.DRIVING):
        assert counts[lane.id] == (0 if lane.junction else round(lane.length_m / 24.0 + 1e-9))


def test_every_driving_lane_can_be_reached_from_every_other(blocks: RoadNetwork) -> None:
    lanes = blocks.lanes_of(LaneKind.DRIVING)
    row = {lane.id: index for index, lane in enumerate(lanes)}
    links = np.array([(row[lane.id], row[successor]) for lane in lanes for successor in lane.successors])
    graph = coo_matrix((np.ones(len(links)), links.T), shape=(len(lanes), len(lanes)))
    assert connected_components(graph, connection="strong")[0] == 1


def test_each_lane_ends_where_its_successors_start(blocks: RoadNetwork) -> None:
    gaps_m = [
        np.linalg.norm(lane.centerline_m[-1] - blocks.lanes[successor].centerline_m[0])
        for lane in blocks.lanes_of(LaneKind.DRIVING)
        for successor in lane.successors
    ]
    assert max(gaps_m) < 0.01


def test_streets_have_one_or_two_lanes_each_way_and_sidewalks_on_both_sides(blocks: RoadNetwork) -> None:
    kinds: dict[str, Counter[LaneKind]] = {}
    for lane in blocks.lanes.values():
        if not lane.junction:
            kinds.setdefault(lane.edge, Counter())[lane.kind] += 1
    assert {count[LaneKind.DRIVING] for count in kinds.values()} == {1, 2}
    assert {count[LaneKind.SIDEWALK] for count in kinds.values()} == {1}
    opposite = {strip.road: strip.left for strip in blocks.layout.strips if strip.index == -1 and not strip.junction}
    assert opposite.keys() == kinds.keys()
    assert all(blocks.lanes[lane].edge in kinds for lane in opposite.values()), "every street leads both ways"


@pytest.fixture(scope="module")
def three_roads() -> RoadNetwork:
    """A viaduct 12 m high along x, a bridge 6 m high along y and an oblique street at 0 m, all through one point."""
    return stack()


POSITIONS_M = {"viaduct": (256.0, 254.0, 12.0), "bridge": (254.0, 256.0, 6.0), "street": (257.0, 255.0, 0.0)}


def test_waypoints_are_at_the_height_of_their_road(three_roads: RoadNetwork) -> None:
    waypoints = three_roads.waypoints(10.0)
    near = np.linalg.norm(waypoints.position_m[:, :2] - 256.0, axis=1) < 40.0
    road = np.array([lane.split(".")[0] for lane in waypoints.lane])
    found_m = {name: set(waypoints.position_m[near & (road == name), 2].round(6).tolist()) for name in POSITIONS_M}
    assert found_m == {"viaduct": {12.0}, "bridge": {6.0}, "street": {0.0}}


@pytest.mark.parametrize("road", POSITIONS_M)
def test_height_selects_among_stacked_roads(three_roads: RoadNetwork, road: str) -> None:
    position_m = np.array(POSITIONS_M[road])
    off_m = np.array([0.3, 0.2, 0.4])
    assert three_roads.nearest_lane(position_m[None] + off_m).lane[0].startswith(road)
    record = lane_record(three_roads, position_m + off_m, 0.1)
    assert record["road_id"] == road
    assert record["transform"]["location"][2] == pytest.approx(position_m[2], abs=0.01)


@pytest.mark.parametrize("road", POSITIONS_M)
def test_only_the_road_itself_is_on_its_level_where_roads_are_stacked(three_roads: RoadNetwork, road: str) -> None:
    members = LevelGraph(three_roads.layout).members(np.array(POSITIONS_M[road]))
    assert members is not None
    assert members.holds(np.array([*POSITIONS_M.values()])).tolist() == [name == road for name in POSITIONS_M]
