"""The ego starts at the configured pose, on a lane that it may use, and no other vehicle starts there."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from simbev_ros.config.agents import Ego
from simbev_ros.config.load import load_scenario
from simbev_ros.config.places import SpawnPose
from simbev_ros.config.scenario import Scenario
from simbev_ros.config.traffic import Traffic
from simbev_ros.foundation.errors import InputError
from simbev_ros.maps.build import load_network
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.scene.blueprints import blueprint_named
from simbev_ros.scene.drawing.draw_scene import PlannedScene, draw_scene
from simbev_ros.scene.streets.streets import streets_of
from simbev_ros.scene.streets.vehicle_route import draw_vehicle_route
from simbev_ros.schema.scene.map_spec import MapSpec
from simbev_ros.schema.scene.spec import SceneSpec, VehicleSpec

PLANNED = PlannedScene(3, MapSpec(name="Blocks"), "train")


@pytest.fixture(scope="module")
def network() -> RoadNetwork:
    return load_network(PLANNED.map)


def drawn(network: RoadNetwork, *poses: SpawnPose, number: int = 3, vehicles: float = 8) -> SceneSpec:
    return drawn_ego(network, Ego(spawn=poses), number, vehicles)


def drawn_ego(network: RoadNetwork, ego: Ego, number: int = 3, vehicles: float = 8) -> SceneSpec:
    scenario: Scenario = load_scenario("paper").model_copy(
        update={"ego": ego, "traffic": Traffic(vehicles=vehicles, pedestrians=0)}
    )
    return draw_scene(scenario, PLANNED._replace(number=number), network)


def center_m(network: RoadNetwork, ego: VehicleSpec, length_m: float) -> np.ndarray:
    return network.pose_on_lane(ego.start.lane, ego.start.s_m - length_m / 2.0)[0]


def pose_at(network: RoadNetwork, number: int, offset_m: float = 0.0) -> SpawnPose:
    waypoints = network.waypoints(24.0)
    yaw = waypoints.yaw_rad[number]
    position_m = waypoints.position_m[number, :2] + offset_m * np.array([-np.sin(yaw), np.cos(yaw)])
    return SpawnPose(x_m=position_m[0], y_m=position_m[1], yaw_deg=float(np.degrees(yaw)))


@pytest.mark.parametrize("number", [0, 40, 77])
def test_the_ego_stands_with_its_center_at_the_pose(network: RoadNetwork, number: int) -> None:
    spec = drawn(network, pose_at(network, number, offset_m=0.8))
    ego = spec.vehicles[0]
    assert ego.start.lane == network.waypoints(24.0).lane[number]
    center_found_m = center_m(network, ego, blueprint_named(ego.blueprint).size_m[0])
    assert center_found_m[:2] == pytest.approx(network.waypoints(24.0).position_m[number, :2], abs=0.01)


def test_the_yaw_chooses_the_direction(network: RoadNetwork) -> None:
    ahead = pose_at(network, 12)
    back = ahead.model_copy(update={"yaw_deg": (ahead.yaw_deg or 0.0) - 180.0})
    yaws = []
    for pose in (ahead, back):
        start = drawn(network, pose).vehicles[0].start
        yaws.append(network.pose_on_lane(start.lane, start.s_m)[1])
    assert np.cos(yaws[0] - yaws[1]) == pytest.approx(-1.0, abs=0.01)


def test_one_of_the_poses_is_drawn_for_each_scene_without_changing_the_weather(network: RoadNetwork) -> None:
    poses = [pose_at(network, number) for number in (3, 30, 60)]
    specs = [drawn(network, *poses, number=number) for number in range(12)]
    assert len({spec.vehicles[0].start.lane for spec in specs}) == 3
    assert drawn(network, *poses, number=3) == specs[3]
    assert specs[3].weather == drawn(network, number=3).weather


def test_each_map_has_its_own_poses_and_on_the_others_the_ego_starts_anywhere(network: RoadNetwork) -> None:
    pose, far = pose_at(network, 12), SpawnPose(x_m=-5000, y_m=0)
    assert drawn_ego(network, Ego(spawn={"Blocks": (pose,), "Town01": (far,)})) == drawn(network, pose)
    assert drawn_ego(network, Ego(spawn={"Town01": (far,)})) == drawn(network)
    with pytest.raises(InputError, match=r"ego\.spawn\.Blocks\[1\]: \(-5000, 0\) is"):
        drawn_ego(network, Ego(spawn={"Blocks": (pose, far)}))


def test_the_ego_has_its_color_and_nothing_else_changes(network: RoadNetwork) -> None:
    spec, usual = drawn_ego(network, Ego(color=0x00FF80)), drawn(network)
    painted = usual.vehicles[0].model_copy(update={"color": 0x00FF80})
    assert spec == usual.model_copy(update={"vehicles": (painted, *usual.vehicles[1:])})


def test_the_ego_has_its_desired_speed_and_nothing_else_changes(network: RoadNetwork) -> None:
    spec, usual = drawn_ego(network, Ego(speed_factor=0.5)), drawn(network)
    slow = usual.vehicles[0].model_copy(update={"speed_factor": 0.5})
    assert spec == usual.model_copy(update={"vehicles": (slow, *usual.vehicles[1:])})


def test_the_ego_passes_the_places_of_its_route_in_order(network: RoadNetwork) -> None:
    places = [pose_at(network, number) for number in (40, 90, 15)]
    spec = drawn_ego(network, Ego(spawn=(pose_at(network, 12),), route=places), vehicles=0)
    edges, via = draw_vehicle_route(spec, network, 0).edges, spec.vehicles[0].via
    assert len(via) == 3
    at = 0
    for edge in via:
        at = edges.index(edge, at)
    after = streets_of(network).for_class("passenger")
    assert all(after.shortest_path(*pair) == (pair[1],) for pair in pairwise(edges))
    assert spec == drawn_ego(network, Ego(spawn=(pose_at(network, 12),), route={"Blocks": places}), vehicles=0)
    with pytest.raises(InputError, match=r"ego\.route\[1\]: .* is \d+\.\d m from the nearest lane"):
        drawn_ego(network, Ego(route=(places[0], SpawnPose(x_m=-5000, y_m=0))))


def test_no_other_vehicle_starts_in_the_ego(network: RoadNetwork) -> None:
    for number in range(6):
        ego, *others = drawn(network, pose_at(network, 12), number=number, vehicles=90).vehicles
        gaps_m = [other.start.s_m - ego.start.s_m for other in others if other.start.lane == ego.start.lane]
        assert all(abs(gap_m) > 20.0 for gap_m in gaps_m)


def test_a_pose_far_from_every_lane_is_refused_by_its_number(network: RoadNetwork) -> None:
    far = SpawnPose(x_m=-5000, y_m=0)
    message = r"ego\.spawn\[1\]: \(-5000, 0\) is \d+\.\d m from the nearest lane that vehicle\.sedan may start on"
    with pytest.raises(InputError, match=message + r" in map Blocks; at most 5 m is allowed"):
        drawn(network, pose_at(network, 0), far)


def test_the_height_counts(network: RoadNetwork) -> None:
    above = pose_at(network, 0).model_copy(update={"z_m": 6.0})
    with pytest.raises(InputError, match=r"ego\.spawn\[0\]: .*is 6\.0 m from"):
        drawn(network, above)


def test_lanes_closed_to_the_ego_are_skipped(network: RoadNetwork) -> None:
    pose = pose_at(network, 12)
    closed = network.lanes[drawn(network, pose).vehicles[0].start.lane]
    changed = {**network.lanes, closed.id: replace(closed, classes=frozenset({"bus"}))}
    assert drawn(replace(network, lanes=changed), pose).vehicles[0].start.lane != closed.id
