import numpy as np
import pytest
from road_strips import level_ground, straight

from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.roads.lane_index import LineIndex
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.polylines import Polylines


def test_nearest_lane_agrees_with_brute_force(blocks: RoadNetwork) -> None:
    xy_m = np.random.default_rng(3).uniform(-260, 260, (200, 2))
    lanes = blocks.lanes_of(LaneKind.DRIVING)
    samples = [
        np.array([blocks.pose_on_lane(lane.id, s_m)[0][:2] for s_m in np.linspace(0, lane.length_m, 40)])
        for lane in lanes
    ]
    nearest_m = np.min([np.linalg.norm(sample[None] - xy_m[:, None], axis=2).min(axis=1) for sample in samples], axis=0)
    nearest = blocks.nearest_lane(xy_m)
    found_m = np.linalg.norm(nearest.position_m[:, :2] - xy_m, axis=1)
    assert (found_m <= nearest_m + 1e-9).all()
    assert found_m == pytest.approx(nearest_m, abs=2.5), "brute force samples every few meters"


def test_nearest_position_reproduces_the_pose_of_a_waypoint(blocks: RoadNetwork) -> None:
    waypoints = blocks.waypoints(24.0)
    for points_m in (waypoints.position_m[:, :2], waypoints.position_m):
        nearest = blocks.nearest_lane(points_m, waypoints.yaw_rad)
        assert nearest.lane == waypoints.lane
        assert nearest.s_m == pytest.approx(waypoints.s_m, abs=1e-6)
        assert np.abs(np.angle(np.exp(1j * (nearest.yaw_rad - waypoints.yaw_rad)))).max() < 1e-6


def test_height_and_heading_select_among_crossing_lanes() -> None:
    roads = [
        straight("under", (0, -50), (0, 50), level_ground),
        straight("over", (-50, 0), (50, 0), lambda xy_m: np.full(len(xy_m), 6.0)),
        straight("back", (50, 1), (-50, 1), lambda xy_m: np.full(len(xy_m), 6.0)),
    ]
    index = LineIndex(Polylines.from_lines([road.center_m for road in roads]))
    position_m = np.array([[0.4, 0.1, 0.2], [0.1, 0.4, 5.8], [0.1, 0.4, 5.8]])
    assert index.nearest(position_m[:, :2]).row.tolist() == [1, 0, 0], "in plan only"
    assert index.nearest(position_m).row.tolist() == [0, 1, 1]
    assert index.nearest(position_m, np.array([np.pi / 2, 0.0, np.pi])).row.tolist() == [0, 1, 2]
