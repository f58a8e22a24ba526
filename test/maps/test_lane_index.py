from dataclasses import replace

import numpy as np
import pytest

from simbev_ros.maps.lane_index import LaneIndex, height_m
from simbev_ros.maps.lane_kind import LaneKind
from simbev_ros.maps.network import RoadNetwork


def test_nearest_lane_agrees_with_brute_force(blocks: RoadNetwork) -> None:
    xy_m = np.random.default_rng(3).uniform(-260, 260, (200, 2))
    lanes = blocks.lanes_of(LaneKind.DRIVING)
    samples = [
        np.array([blocks.pose_on_lane(lane.id, s_m)[0][:2] for s_m in np.linspace(0, lane.length_m, 40)])
        for lane in lanes
    ]
    nearest_m = np.min([np.linalg.norm(sample[None] - xy_m[:, None], axis=2).min(axis=1) for sample in samples], axis=0)
    places = LaneIndex(lanes).nearest(xy_m)
    found_m = np.linalg.norm(places.position_m[:, :2] - xy_m, axis=1)
    assert (found_m <= nearest_m + 1e-9).all()
    assert found_m == pytest.approx(nearest_m, abs=2.5), "brute force samples every few metres"


def test_nearest_place_repeats_the_pose_that_it_came_from(blocks: RoadNetwork) -> None:
    waypoints = blocks.waypoints(24.0)
    places = LaneIndex(blocks.lanes_of(LaneKind.DRIVING)).nearest(waypoints.position_m[:, :2])
    assert places.lane == waypoints.lane
    assert places.s_m == pytest.approx(waypoints.s_m, abs=1e-6)
    assert np.abs(np.angle(np.exp(1j * (places.yaw_rad - waypoints.yaw_rad)))).max() < 0.1


def test_height_is_that_of_the_nearest_lane(blocks: RoadNetwork) -> None:
    xy_m = np.array([[10.0, 20.0], [-100.0, 60.0]])
    assert height_m(blocks, xy_m).tolist() == [0.0, 0.0]
    sloped = {
        lane.id: replace(lane, centerline_m=lane.centerline_m * [1, 1, 0] + 0.1 * lane.centerline_m[:, :1] * [0, 0, 1])
        for lane in blocks.lanes.values()
    }
    on_lanes_m = blocks.waypoints(24.0).position_m[:, :2]
    assert height_m(replace(blocks, lanes=sloped), on_lanes_m) == pytest.approx(0.1 * on_lanes_m[:, 0], abs=1e-6)
