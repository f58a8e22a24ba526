from collections import Counter

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.roads.lane_kind import LaneKind


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


def test_from_every_driving_lane_every_other_can_be_reached(blocks: RoadNetwork) -> None:
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
