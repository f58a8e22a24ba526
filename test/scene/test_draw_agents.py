"""Agents start where the configuration asks, clear of each other, and each is drawn by its name."""

from collections.abc import Callable
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
import yaml

from simbev_ros.config.load import load_scenario, parse_scenario
from simbev_ros.foundation.errors import InputError
from simbev_ros.maps.build import load_network
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.scene.blueprints import blueprint_named
from simbev_ros.scene.drawing.draw_scene import PlannedScene, draw_scene, start_positions
from simbev_ros.scene.drawing.start_clearance import StartClearance
from simbev_ros.scene.drawing.starts import StartPositions
from simbev_ros.scene.drawing.statistics import SceneStatistics, configured_value
from simbev_ros.scene.hazards.detours import Detours
from simbev_ros.schema.scene.agents import agent_views
from simbev_ros.schema.scene.map_spec import MapSpec
from simbev_ros.schema.scene.spec import SceneSpec, VehicleSpec, WaypointSpec

MAP = "Town05"
SENSORS = "rig: {sensors: [{type: imu, name: imu}]}"


@pytest.fixture(scope="module")
def network() -> RoadNetwork:
    return load_network(MapSpec(name=MAP))


@pytest.fixture(scope="module")
def starts(network: RoadNetwork) -> StartPositions:
    return start_positions(load_scenario("paper"), network)


@pytest.fixture
def draw(network: RoadNetwork, starts: StartPositions) -> Callable[..., SceneSpec]:
    def draw_one(*agents: str, number: int = 0, sections: str = "") -> SceneSpec:
        """The scene with these entries of ``agents``, whose traffic is sparse."""
        return draw_scene(parsed(*agents, sections=sections), planned(number), network, starts)

    return draw_one


def parsed(*agents: str, sections: str = "") -> Any:
    entries = "".join(f"  - {{{SENSORS}, {agent}}}\n" for agent in agents)
    text = f"scenes: [{{map: {MAP}, train: 1}}]\n{SENSORS}\ntraffic: {{vehicles: 20, pedestrians: 5}}\n{sections}\n"
    return parse_scenario(text + (f"agents:\n{entries}" if agents else ""), "my.yaml")


def planned(number: int) -> PlannedScene:
    return PlannedScene(number, MapSpec(name=MAP), "train")


def start_m(network: RoadNetwork, vehicle: VehicleSpec) -> np.ndarray:
    return network.pose_on_lane(vehicle.start.lane, vehicle.start.s_m)[0]


def distance_m(network: RoadNetwork, one: VehicleSpec, other: VehicleSpec) -> float:
    return float(np.linalg.norm(start_m(network, one)[:2] - start_m(network, other)[:2]))


def by_name(spec: SceneSpec) -> dict[str, VehicleSpec]:
    return {view.agent: view.vehicle for view in agent_views(spec) if view.vehicle is not None}


@pytest.mark.slow
def test_agents_follow_the_ego_and_precede_traffic(draw: Callable[..., SceneSpec]) -> None:
    spec = draw("name: bus, blueprint: vehicle.bus, driver: twist", "name: van, count: 2, blueprint: vehicle.van")
    assert [(agent.name, agent.vehicle, agent.driver) for agent in spec.agents] == [
        *(("ego", 0, "traffic"), ("bus", 1, "twist"), ("van_1", 2, "traffic"), ("van_2", 3, "traffic"))
    ]
    assert [vehicle.blueprint for vehicle in spec.vehicles[:4]] == [
        f"vehicle.{name}" for name in ("sedan", "bus", "van", "van")
    ]
    assert len(spec.drivers) == 1 + 3 + 20
    assert SceneSpec.model_validate_json(spec.model_dump_json()) == spec


def test_frames_and_labels_are_the_first_agents_unless_an_agent_has_its_own(draw: Callable[..., SceneSpec]) -> None:
    own = "name: car, blueprint: vehicle.van, frames: {base_link: rear_axle}, annotation: {box_radius_m: 30}"
    _, car, van = draw(own, "name: van", sections="frames: {odom: true}\nannotation: {box_radius_m: 70}").agents
    assert (car.frames.odom, car.annotation.box_radius_m) == (False, 30)
    assert car.base_link_x_m == -blueprint_named("vehicle.van").footprint.axle_m
    assert (van.frames.odom, van.annotation.box_radius_m, van.base_link_x_m) == (True, 70, 0)


@pytest.mark.parametrize("number", range(4))
def test_an_agent_near_another_starts_at_the_distance(
    draw: Callable[..., SceneSpec], network: RoadNetwork, number: int
) -> None:
    second = "name: second, near: {agent: first, distance_m: {uniform: [100, 200]}, tolerance_m: 15}"
    cars = by_name(draw("name: first, near: {distance_m: 60, tolerance_m: 10}", second, number=number))
    assert 50 <= distance_m(network, cars["first"], cars["ego"]) <= 70
    assert 85 <= distance_m(network, cars["second"], cars["first"]) <= 215


@pytest.mark.parametrize("number", range(4))
def test_an_agent_without_pose_and_neighbor_starts_within_the_radius_of_traffic(
    draw: Callable[..., SceneSpec], network: RoadNetwork, number: int
) -> None:
    ego, *others = by_name(draw("name: car, count: 6", number=number)).values()
    assert max(distance_m(network, ego, other) for other in others) <= 400


@pytest.mark.parametrize("number", range(3))
def test_bodies_of_agents_and_traffic_are_apart(
    draw: Callable[..., SceneSpec], network: RoadNetwork, number: int
) -> None:
    spec = draw(
        "name: bus, count: 3, blueprint: vehicle.bus, near: {distance_m: 30}", "name: car, count: 3", number=number
    )
    clearance = StartClearance(network)
    for vehicle in spec.drivers:
        assert clearance.is_free(blueprint_named(vehicle.blueprint), vehicle.start)
        clearance.occupy(vehicle)
    for one, other in combinations(spec.vehicles[:7], 2):
        assert one.start.lane != other.start.lane or abs(one.start.s_m - other.start.s_m) > 20


def test_an_agent_is_drawn_by_its_name_whichever_others_there_are(draw: Callable[..., SceneSpec]) -> None:
    car, van = "name: car, near: {distance_m: 40}", "name: van, near: {distance_m: 200}"
    alone, both, reverse = (by_name(draw(*agents, number=3)) for agents in ((car,), (car, van), (van, car)))
    assert both["car"] == alone["car"]
    assert reverse == both and [*reverse] == ["ego", "van", "car"]
    assert len({vehicle.speed_factor for vehicle in both.values()}) == 3


def test_other_agents_change_neither_the_ego_nor_the_weather(draw: Callable[..., SceneSpec]) -> None:
    one, two = draw(number=5), draw("name: car", number=5)
    assert (one.vehicles[0], one.weather, one.green_time_s) == (two.vehicles[0], two.weather, two.green_time_s)
    assert one.agents == two.agents[:1]


def test_the_same_seed_draws_the_same_agents_and_another_seed_others(draw: Callable[..., SceneSpec]) -> None:
    agent = "name: car, count: {integer: [0, 5]}"
    specs = [draw(agent, number=number) for number in range(12)]
    assert draw(agent, number=4) == specs[4]
    assert {len(spec.agents) for spec in specs} > {1, 6}


def test_agents_keep_their_doors_closed_and_may_be_reckless(draw: Callable[..., SceneSpec]) -> None:
    spec = draw("name: calm, reckless_probability: 0", "name: wild, reckless_probability: 1")
    assert [vehicle.reckless for vehicle in spec.vehicles[1:3]] == [False, True]
    assert [vehicle.door_probability for vehicle in spec.vehicles[:4]] == [0, 0, 0, 0.1]


def poses(network: RoadNetwork, *rows: int) -> str:
    position_m = network.waypoints(24.0).position_m
    return "[" + ", ".join(f"{{x_m: {position_m[row, 0]}, y_m: {position_m[row, 1]}}}" for row in rows) + "]"


@pytest.mark.slow
def test_agents_with_the_same_poses_take_different_ones(draw: Callable[..., SceneSpec], network: RoadNetwork) -> None:
    spawn = f"spawn: {poses(network, 3, 30)}"
    for number in range(6):
        cars = by_name(draw(f"name: car, {spawn}", number=number, sections=f"ego: {{{spawn}}}"))
        assert cars["car"].start != cars["ego"].start
        assert {round(distance_m(network, car, cars["ego"])) for car in cars.values()} > {0}


def test_traffic_and_pedestrians_surround_all_agents(network: RoadNetwork, starts: StartPositions) -> None:
    waypoints_m = network.waypoints(24.0).position_m
    spots = [waypoints_m[0], max(waypoints_m, key=lambda each_m: float(np.linalg.norm(each_m - waypoints_m[0])))]
    ego, car = (f"spawn: [{{x_m: {x_m}, y_m: {y_m}}}]" for x_m, y_m, _ in spots)
    scenario = parsed(f"name: car, {car}", sections=f"ego: {{{ego}}}")
    traffic = scenario.traffic.model_copy(update={"vehicles": 60.0, "pedestrians": 60.0, "spawn_radius_m": 150.0})
    spec = draw_scene(scenario.model_copy(update={"traffic": traffic}), planned(0), network, starts)
    for actors in (spec.drivers[2:], spec.pedestrians):
        actors_m = np.array([start_m(network, actor) for actor in actors])  # type: ignore[arg-type]
        distances_m = np.linalg.norm(actors_m[:, None, :2] - np.array(spots)[None, :, :2], axis=2)
        assert np.all(distances_m.min(axis=1) < 155)
        assert set(distances_m.argmin(axis=1)) == {0, 1}


def test_hazards_keep_off_all_agents(draw: Callable[..., SceneSpec], network: RoadNetwork) -> None:
    for number in range(4):
        spec = draw("name: car, count: 5", number=number, sections="hazards: {count: 8}")
        assert spec.hazards
        grounds = [shapely.Polygon(hazard.outline_m) for hazard in spec.hazards]
        for agent in spec.vehicles[:6]:
            assert min(ground.distance(shapely.Point(start_m(network, agent)[:2])) for ground in grounds) >= 39.9


def test_the_roads_of_all_agents_stay_open(network: RoadNetwork, starts: StartPositions) -> None:
    near = np.ones(len(starts.vehicles), bool)
    edges = sorted({lane.edge for lane in starts.vehicles.lanes})
    ego = vehicle_on(starts, edges[0])
    alone = Detours(network, [ego], starts.vehicles, near)
    closed = next(edge for edge in edges[1:] if alone.closure_for(frozenset({edge})))
    both = Detours(network, [ego, vehicle_on(starts, closed)], starts.vehicles, near)
    assert both.closure_for(frozenset({closed})) is None


def vehicle_on(starts: StartPositions, edge: str) -> VehicleSpec:
    lane = next(lane for lane in starts.vehicles.lanes if lane.edge == edge)
    start = WaypointSpec(lane=lane.id, s_m=lane.length_m / 2)
    return VehicleSpec(blueprint="vehicle.sedan", color=0, start=start, speed_factor=1, min_gap_m=2)


def test_statistics_keep_agents_apart_from_traffic(draw: Callable[..., SceneSpec]) -> None:
    scenario = parsed("name: car, count: 2, reckless_probability: 0.25")
    statistics = SceneStatistics()
    statistics.add(draw("name: car, count: 2, reckless_probability: 0.25"))
    assert statistics.numbers["agents"].mean == 3 and statistics.numbers["vehicles"].mean == 20
    assert statistics.numbers["agents.speed_factor"].count == 2 and statistics.numbers["ego.speed_factor"].count == 1
    assert statistics.kinds["agents.blueprint"] == {"vehicle.sedan": 2}
    assert configured_value("agents.reckless", scenario) == "yes with probability 0.25"
    assert configured_value("agents.speed_factor", scenario) == "uniform 0.8, 1.4"
    differing = parsed("name: car, reckless_probability: 0.25", "name: van")
    assert configured_value("agents.reckless", differing) == ""


@pytest.mark.parametrize(
    ("agent", "message"),
    [
        (
            "blueprint: vehicle.tank",
            r"my.yaml:6: agents\[0\].blueprint: no vehicle 'vehicle.tank'; allowed: .*bus",
        ),
        (
            "spawn: [{x_m: -9000, y_m: 0}]",
            r"my.yaml:6: agents\[0\].spawn\[0\]: \(-9000, 0\) is .* m from the nearest lane that vehicle.sedan may",
        ),
        (
            "count: 31, near: {distance_m: 5, tolerance_m: 20}",
            r"my.yaml:6: agents\[0\].near: no free start 0 to 25 m from ego for vehicle.sedan in map Town05",
        ),
    ],
)
def test_an_agent_that_cannot_be_drawn_is_refused_by_its_line(
    draw: Callable[..., SceneSpec], agent: str, message: str
) -> None:
    with pytest.raises(InputError, match=message):
        draw(f"name: car, {agent}")


def test_more_agents_than_starts_around_the_first_one_are_refused(network: RoadNetwork, starts: StartPositions) -> None:
    scenario = parsed("name: car, count: 31")
    traffic = scenario.traffic.model_copy(update={"spawn_radius_m": 30.0})
    message = r"my.yaml:6: agents\[0\]: no free start within 30 m \(traffic.spawn_radius_m\) of ego for vehicle.sedan"
    with pytest.raises(InputError, match=message):
        draw_scene(scenario.model_copy(update={"traffic": traffic}), planned(0), network, starts)


def test_an_agent_at_the_pose_of_the_ego_is_refused(draw: Callable[..., SceneSpec], network: RoadNetwork) -> None:
    spawn = f"spawn: {poses(network, 3)}"
    message = r"my.yaml:7: agents\[0\].spawn: agents listed earlier leave no room for vehicle.sedan at any pose"
    with pytest.raises(InputError, match=message):
        draw(f"name: car, {spawn}", sections=f"ego: {{{spawn}}}\nseed: 1")


def test_a_list_of_one_agent_draws_the_bytes_of_the_short_form(tmp_path: Path) -> None:
    demo = load_scenario("demo")
    data = yaml.safe_load(demo.as_yaml())
    first = {"name": data["rig"]["agent"], "rig": data.pop("rig"), "annotation": data.pop("annotation")}
    listed = parse_scenario(yaml.safe_dump(data | {"agents": [first | data.pop("ego")]}), "listed")
    scene = PlannedScene(2, MapSpec(name="Blocks"), "val")
    network = load_network(scene.map)
    specs = [draw_scene(scenario, scene, network).model_dump_json() for scenario in (demo, listed)]
    assert specs[0] == specs[1]
