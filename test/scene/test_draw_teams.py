"""Teams of agents: their number, clusters, chains along the road, and roadside units at junctions near the ego."""

import heapq
from functools import cache

import numpy as np
import pytest

from simbev_ros.config.load import load_scenario, parse_scenario
from simbev_ros.config.scenario import Scenario
from simbev_ros.foundation.errors import InputError
from simbev_ros.maps.build import load_network
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.scene.drawing.draw_agents import DrawnAgents, draw_agents, drawn_arrangement, drawn_names
from simbev_ros.scene.drawing.draw_scene import PlannedScene, draw_scene, start_positions
from simbev_ros.scene.drawing.starts import StartPositions
from simbev_ros.schema.scene.map_spec import MapSpec

RIG = "rig: {sensors: [{type: imu, name: imu}]}"
CLUSTER = "count: {integer: [1, 7]}, arrangement: cluster, near: {distance_m: {uniform: [15, 45]}, tolerance_m: 15}"
CHAIN = CLUSTER.replace("cluster", "chain")
UNITS = "count: {integer: [0, 4]}, mast: {junction: {near: {distance_m: 50, tolerance_m: 50}}}"
LOW_M, HIGH_M = 0, 60
"""Limits of all distances that ``CHAIN`` and ``CLUSTER`` allow."""
JUNCTION_M = 80.0
"""Length of junctions, which the drawn paths count as 0."""


@cache
def map_named(name: str) -> tuple[RoadNetwork, StartPositions]:
    network = load_network(MapSpec(name=name))
    return network, start_positions(load_scenario("paper"), network)


def parsed(cars: str, units: str = "", ego: str = "", vans: str = "") -> Scenario:
    entries = f"  - {{name: ego, {RIG}{ego}}}\n  - {{name: car, {RIG}, {cars}}}\n"
    others = {"rsu": units, "van": vans}
    entries += "".join(f"  - {{name: {name}, {RIG}, {fields}}}\n" for name, fields in others.items() if fields)
    text = f"scenes: [{{map: Town05, train: 1}}]\ntraffic: {{vehicles: 20, pedestrians: 5}}\nagents:\n{entries}"
    return parse_scenario(text, "my.yaml")


def draw(scenario: Scenario, seed: int, name: str = "Town05") -> DrawnAgents:
    return draw_agents(scenario, seed, *map_named(name), 20.0)


def path_m(network: RoadNetwork, drawn: DrawnAgents, rear: int, front: int, limit_m: float = 300.0) -> float:
    """Length of the shortest path on driving lanes, lane changes included, from one vehicle's start to another's."""
    start, goal = drawn.vehicles[rear].start, drawn.vehicles[front].start
    edges: dict[str, list[str]] = {}
    for lane in network.lanes_of(LaneKind.DRIVING):
        edges.setdefault(lane.edge, []).append(lane.id)
    queue, done = [(-start.s_m, start.lane)], set[str]()
    while queue:
        at_m, lane_id = heapq.heappop(queue)
        lane = network.lanes[lane_id]
        if lane_id in done or at_m > limit_m:
            continue
        done.add(lane_id)
        if lane_id == goal.lane and at_m + goal.s_m >= 0:
            return at_m + goal.s_m
        ahead = [each for each in lane.successors if network.lanes[each].kind is LaneKind.DRIVING]
        for each in edges[lane.edge]:
            heapq.heappush(queue, (at_m, each))
        for each in ahead:
            heapq.heappush(queue, (at_m + lane.length_m, each))
    return np.inf


def distance_m(drawn: DrawnAgents, one: int, other: int) -> float:
    return float(np.linalg.norm(drawn.start_m[one, :2] - drawn.start_m[other, :2]))


def test_the_number_of_agents_and_their_arrangement_follow_the_distribution() -> None:
    scenario = parsed("count: {integer: [1, 7]}, arrangement: {choice: [cluster, chain]}", UNITS)
    cars, units = scenario.agents
    seeds = range(2800)
    counts = np.bincount([len(drawn_names(cars, seed)) for seed in seeds], minlength=9)
    assert not counts[[0, 8]].any() and np.all(abs(counts[1:8] - 400) < 4 * np.sqrt(400 * 6 / 7))
    unit_counts = np.bincount([len(drawn_names(units, seed)) for seed in seeds], minlength=6)
    assert not unit_counts[5] and np.all(abs(unit_counts[:5] - 560) < 4 * np.sqrt(560 * 4 / 5))
    chains = sum(drawn_arrangement(cars, seed) == "chain" for seed in seeds)
    assert abs(chains - 1400) < 4 * np.sqrt(700)
    for seed in range(8):
        names = [spec.name for spec in draw(scenario, seed).specs]
        assert names == ["ego", *drawn_names(cars, seed), *drawn_names(units, seed)]


@pytest.mark.parametrize("name", ["Town05", "Town01"])
def test_a_cluster_surrounds_the_ego(name: str) -> None:
    scenario = parsed(CLUSTER)
    for seed in range(12):
        drawn = draw(scenario, seed, name)
        assert all(LOW_M <= distance_m(drawn, 0, car) <= HIGH_M for car in range(1, len(drawn.vehicles)))


@pytest.mark.parametrize("name", ["Town05", "Town01", "Town04"])
def test_each_vehicle_of_a_chain_is_ahead_of_its_first_or_behind_its_last_along_the_road(name: str) -> None:
    network, scenario, grown = map_named(name)[0], parsed(CHAIN), {"ahead": 0, "behind": 0}
    for seed in range(16):
        drawn = draw(scenario, seed, name)
        rear = front = 0
        for car in range(1, len(drawn.vehicles)):
            follows = {"ahead": (front, car), "behind": (car, rear)}
            paths_m = {end: path_m(network, drawn, *pair) for end, pair in follows.items()}
            fits = {
                end: LOW_M <= distance_m(drawn, *follows[end]) <= HIGH_M and paths_m[end] <= 1.3 * HIGH_M + JUNCTION_M
                for end in follows
            }
            assert any(fits.values()), (seed, car, paths_m)
            end = min((end for end in fits if fits[end]), key=paths_m.__getitem__)
            grown[end] += 1
            rear, front = (rear, car) if end == "ahead" else (car, front)
        assert path_m(network, drawn, rear, front, 1000.0) < np.inf
    assert min(grown.values()) > 5


def test_a_chain_is_longer_than_a_cluster() -> None:
    spans_m = {}
    for cars in (CLUSTER, CHAIN):
        teams = [draw(parsed(cars.replace("{integer: [1, 7]}", "7")), seed, "Town01") for seed in range(8)]
        spans_m[cars] = [max(distance_m(team, 0, car) for car in range(1, 8)) for team in teams]
    assert max(spans_m[CLUSTER]) <= HIGH_M < np.median(spans_m[CHAIN])


def test_a_chain_begins_with_the_agent_that_it_is_near() -> None:
    vans = "count: 2, arrangement: chain, near: {agent: car_1, distance_m: 10, tolerance_m: 50}"
    network = map_named("Town05")[0]
    for seed in range(6):
        drawn = draw(parsed("count: 1", vans=vans), seed)
        assert min(path_m(network, drawn, 1, 2), path_m(network, drawn, 2, 1)) < 1.3 * HIGH_M + JUNCTION_M


@pytest.mark.parametrize("name", ["Town05", "Town04"])
def test_roadside_units_stand_at_junctions_near_the_ego_and_apart(name: str) -> None:
    starts = map_named(name)[1]
    centers_m = np.array([crossing.center_m for crossing in starts.masts.crossings])
    units = 0
    for seed in range(24):
        drawn = draw(parsed(CLUSTER, UNITS), seed, name)
        feet_m = drawn.position_m[[spec.station is not None for spec in drawn.specs]]
        units += len(feet_m)
        near_m = centers_m[np.linalg.norm(centers_m[:, :2] - drawn.start_m[0, :2], axis=1) <= 100.0]
        for index, foot_m in enumerate(feet_m):
            assert np.linalg.norm(near_m[:, :2] - foot_m[:2], axis=1).min() < 50.0
            assert not starts.masts.is_on_lane(foot_m)
            assert np.all(np.linalg.norm(feet_m[:index, :2] - foot_m[:2], axis=1) >= 5.0)
    assert units > 20


def test_the_ego_starts_elsewhere_if_its_team_finds_no_room() -> None:
    alone, team = parsed("count: 0"), parsed(CLUSTER, UNITS.replace("{integer: [0, 4]}", "1"))
    moved = []
    for seed in range(24):
        pair = draw(alone, seed, "Town04"), draw(team, seed, "Town04")
        moved.append(pair[0].vehicles[0].start != pair[1].vehicles[0].start)
        same = [drawn.vehicles[0].model_copy(update={"start": None}) for drawn in pair]
        assert same[0] == same[1]
        assert draw(team, seed, "Town04").specs == pair[1].specs
    assert 0 < sum(moved) < len(moved)


def test_a_team_without_room_anywhere_is_refused_by_its_line() -> None:
    scenario = parsed("count: 20, arrangement: chain, near: {distance_m: 5, tolerance_m: 1}")
    message = (
        r"my.yaml:5: agents\[1\].near: no free start 4 to 6 m from either end of the chain for vehicle.sedan "
        r"in map Town05, nor around 99 other starts of ego$"
    )
    with pytest.raises(InputError, match=message):
        draw(scenario, 0)


def test_an_ego_with_start_poses_does_not_move() -> None:
    x_m, y_m, _ = map_named("Town05")[0].waypoints(24.0).position_m[3]
    scenario = parsed("count: 20, near: {distance_m: 5, tolerance_m: 1}", ego=f", spawn: [{{x_m: {x_m}, y_m: {y_m}}}]")
    with pytest.raises(InputError, match=r"from ego for vehicle.sedan in map Town05$"):
        draw(scenario, 0)


def test_scenes_of_the_shipped_teams_differ_in_agents_and_lidars() -> None:
    scenario = load_scenario("teams")
    scenes = [
        draw_scene(scenario, PlannedScene(number, MapSpec(name="Town01"), "train"), *map_named("Town01"))
        for number in range(6)
    ]
    cars = [[agent for agent in scene.agents if agent.station is None] for scene in scenes]
    assert all(2 <= len(each) <= 8 for each in cars) and len({len(each) for each in cars}) > 2
    presets = {agent.rig.sensors[0].preset for scene in scenes for agent in scene.agents}
    assert len(presets) > 3
    assert all(scene.v2x is not None and len(scene.v2x.agents) == len(scene.agents) for scene in scenes)
