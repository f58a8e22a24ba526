"""Masts of roadside units stand where the configuration asks, off the roads or above them, and are drawn by name."""

from collections.abc import Callable, Iterator

import numpy as np
import pytest
import shapely

from simbev_ros.config.load import load_scenario, parse_scenario
from simbev_ros.config.sensor import Sensor
from simbev_ros.foundation.errors import InputError
from simbev_ros.maps.build import load_network
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.roads.lane_kind import ROAD_KINDS, LaneKind
from simbev_ros.maps.roads.surface import strip_polygons
from simbev_ros.scene.drawing.draw_scene import PlannedScene, draw_scene, start_positions
from simbev_ros.scene.drawing.starts import StartPositions
from simbev_ros.scene.drawing.statistics import SceneStatistics, configured_value
from simbev_ros.schema.scene.agent_spec import StationSpec
from simbev_ros.schema.scene.agents import agent_views
from simbev_ros.schema.scene.map_spec import MapSpec
from simbev_ros.schema.scene.spec import SceneSpec

MAPS = ("Town05", "Town04")
TEXT = """scenes: [{map: Town05, train: 1}]
rig: {sensors: [{type: imu, name: imu}]}
traffic: {vehicles: 10, pedestrians: 5, spawn_radius_m: 200}
"""
RIG = "rig: {sensors: [{type: lidar, name: lidar, pose: {z_m: 1}}, {type: imu, name: imu}]}"
Draw = Callable[..., SceneSpec]


@pytest.fixture(scope="module")
def maps() -> dict[str, tuple[RoadNetwork, StartPositions]]:
    """Roads and starts of a town with bridges and signals, and of one with a motorway and junctions without signals."""
    networks = {name: load_network(MapSpec(name=name)) for name in MAPS}
    return {name: (each, start_positions(load_scenario("paper"), each)) for name, each in networks.items()}


@pytest.fixture
def draw(maps: dict[str, tuple[RoadNetwork, StartPositions]]) -> Draw:
    def draw_one(*agents: str, town: str = "Town05", number: int = 0) -> SceneSpec:
        scenario = parse_scenario(text_of(*agents), "my.yaml")
        return draw_scene(scenario, PlannedScene(number, MapSpec(name=town), "train"), *maps[town])

    return draw_one


def text_of(*agents: str) -> str:
    """A configuration whose agents begin in line 5."""
    entries = "".join(f"  - {{{RIG}, {agent}}}\n" for agent in agents)
    return TEXT + (f"agents:\n{entries}" if agents else "")


def pose_of(station: StationSpec) -> str:
    return f"{{x_m: {station.x_m}, y_m: {station.y_m}}}"


def stations_of(spec: SceneSpec) -> Iterator[tuple[str, StationSpec]]:
    for view in agent_views(spec):
        if view.station is not None:
            yield view.agent, view.station


def only_station(spec: SceneSpec) -> StationSpec:
    ((_, station),) = stations_of(spec)
    return station


def foot_m(station: StationSpec) -> np.ndarray:
    return np.array([station.x_m, station.y_m, station.z_m])


def is_on(network: RoadNetwork, station: StationSpec, *kinds: LaneKind) -> bool:
    """Whether a foot is on a lane of these kinds whose center line is about as high nearby."""
    strips = network.layout.strips_of(*kinds)
    point = shapely.Point(station.x_m, station.y_m)
    for strip, area in zip(strips, strip_polygons(strips), strict=True):
        if area.intersects(point):
            nearest = np.linalg.norm(strip.center_m[:, :2] - foot_m(station)[:2], axis=1).argmin()
            if abs(strip.center_m[nearest, 2] - station.z_m) < 2.0:
                return True
    return False


@pytest.mark.slow
def test_a_mast_beside_signals_is_before_one_of_their_poles_and_faces_the_junction(
    draw: Draw, maps: dict[str, tuple[RoadNetwork, StartPositions]]
) -> None:
    network, _ = maps["Town05"]
    poles_m = np.array([signal.pole_m for signal in network.signals])
    for number in range(5):
        station = only_station(draw("name: rsu, mast: {junction: {signalised: true}}", number=number))
        ahead = np.array([np.cos(station.yaw_rad), np.sin(station.yaw_rad)])
        pole_m = foot_m(station) - 0.5 * np.array([*ahead, 0.0])  # behind the foot, as sensors hang before the pole
        signals = np.flatnonzero(np.linalg.norm(poles_m - pole_m, axis=1) < 0.01)
        assert len(signals)
        (junction,) = {
            network.lanes[following].junction
            for signal in signals
            for following in network.lanes[network.signals[signal].lane].successors
        }
        to_center_m = network.junctions[junction].center_m[:2] - foot_m(station)[:2]
        assert ahead @ to_center_m > 0.8 * np.linalg.norm(to_center_m)
        assert not is_on(network, station, *ROAD_KINDS)


def test_a_mast_at_a_junction_without_signals_is_beside_its_roads(
    draw: Draw, maps: dict[str, tuple[RoadNetwork, StartPositions]]
) -> None:
    network, _ = maps["Town04"]
    roads = shapely.union_all(strip_polygons(network.layout.strips_of(*ROAD_KINDS)))
    inside = [lane for lane in network.lanes.values() if lane.junction and lane.kind is LaneKind.DRIVING]
    lines = shapely.union_all([shapely.LineString(lane.centerline_m[:, :2]) for lane in inside])
    for number in range(5):
        agent = "name: rsu, mast: {junction: {signalised: false, near: {distance_m: 300, tolerance_m: 300}}}"
        station = only_station(draw(agent, town="Town04", number=number))
        point = shapely.Point(station.x_m, station.y_m)
        assert not is_on(network, station, *ROAD_KINDS)
        assert roads.distance(point) < 3.0 and lines.distance(point) < 8.0
        levels = network.elevation.levels
        heights_m = [network.elevation.height_m(foot_m(station)[None, :2], level)[0] for level in levels]
        assert min(abs(np.array(heights_m) - station.z_m)) < 1e-6


def test_a_mast_above_a_road_is_under_the_sky_and_looks_in_driving_direction(
    draw: Draw, maps: dict[str, tuple[RoadNetwork, StartPositions]]
) -> None:
    network, starts = maps["Town05"]
    assert 0.9 < starts.is_under_sky.mean() < 1.0, "some lanes of Town05 run below others"
    strips = network.layout.strips_of(LaneKind.DRIVING)
    areas = strip_polygons(strips)
    spec = draw("name: eye, count: 12, mast: {above_road: {near: {distance_m: 150, tolerance_m: 150}}, height_m: 30}")
    for _, station in stations_of(spec):
        lane = network.nearest_lane(foot_m(station)[None], np.array([station.yaw_rad]))
        assert np.linalg.norm(lane.position_m[0] - foot_m(station)) < 0.1
        assert abs(np.angle(np.exp(1j * (lane.yaw_rad[0] - station.yaw_rad)))) < 0.1
        for row in np.flatnonzero(shapely.contains_xy(areas, station.x_m, station.y_m)):
            assert strips[row].center_m[:, 2].min() < station.z_m + 2.5


def test_masts_are_within_the_asked_distance_and_apart(draw: Draw) -> None:
    spec = draw(
        "name: rsu, count: 4, mast: {junction: {near: {distance_m: {uniform: [100, 150]}, tolerance_m: 60}}}",
        "name: eye, count: 4, mast: {above_road: {near: {agent: rsu_2, distance_m: 20, tolerance_m: 10}}}",
        "name: van, near: {agent: eye_1, distance_m: 30, tolerance_m: 25}",
    )
    feet_m = {name: foot_m(station)[:2] for name, station in stations_of(spec)}
    assert list(feet_m) == [f"{name}_{k}" for name in ("rsu", "eye") for k in range(1, 5)]
    for k in range(1, 5):
        assert 10 <= np.linalg.norm(feet_m[f"eye_{k}"] - feet_m["rsu_2"]) <= 30
    feet = np.array(list(feet_m.values()))
    distance_m = np.linalg.norm(feet[:, None] - feet, axis=2)[~np.eye(len(feet), dtype=bool)]
    assert distance_m.min() >= 5.0
    assert [agent.vehicle for agent in spec.agents] == [0] + [None] * 8 + [1]


def test_a_pose_is_kept_and_its_foot_is_on_the_ground(draw: Draw) -> None:
    at_pole = only_station(draw("name: rsu, mast: {junction: {signalised: true}}"))
    pose = pose_of(at_pole).removesuffix("}")
    station = only_station(draw(f"name: rsu, mast: {{poses: [{pose}, yaw_deg: 90}}]}}"))
    assert (station.x_m, station.y_m, station.yaw_rad) == (at_pole.x_m, at_pole.y_m, np.pi / 2)
    assert station.z_m == pytest.approx(at_pole.z_m, abs=0.05)
    assert only_station(draw(f"name: rsu, mast: {{poses: [{pose}, z_m: 3.5}}]}}")).z_m == 3.5
    assert only_station(draw(f"name: rsu, mast: {{poses: {{Town05: [{pose}, z_m: 3.5}}]}}}}")).z_m == 3.5


def test_units_of_one_entry_have_poses_of_their_own(draw: Draw) -> None:
    poles = draw("name: rsu, count: 4, mast: {junction: {signalised: true}}")
    poses = [pose_of(station) for _, station in stations_of(poles)]
    drawn = set()
    for number in range(6):
        spec = draw(f"name: rsu, count: 3, mast: {{poses: [{', '.join(poses)}]}}", number=number)
        drawn.add(tuple(pose_of(station) for _, station in stations_of(spec)))
    assert all(len(set(each) & set(poses)) == 3 for each in drawn) and len(drawn) > 1
    with pytest.raises(InputError, match=r"my.yaml:5: agents\[0\].mast.poses: two of them are equal"):
        draw(f"name: rsu, count: 2, mast: {{poses: [{poses[0]}, {poses[0]}]}}")


def test_the_mast_raises_all_sensors_of_its_unit_alone(draw: Draw) -> None:
    assert Sensor.model_fields["pose"].default.ego_from_sensor is not None  # which the pose keeps
    spec = draw("name: rsu, mast: {junction: {}, height_m: 7.5}", "name: car")
    ego, rsu, car = spec.agents
    assert [sensor.pose.z_m for sensor in rsu.rig.sensors] == [8.5, 7.5]
    assert rsu.rig.sensors[0].pose.ego_from_sensor[2, 3] == 8.5
    assert [sensor.pose.z_m for sensor in car.rig.sensors] == [1.0, 0.0]
    assert rsu.rig.agent == "rsu" and (rsu.frames, rsu.annotation) == (ego.frames, ego.annotation)


def test_a_unit_is_drawn_by_its_name_and_changes_no_vehicle_of_another_agent(draw: Draw) -> None:
    rsu, car = "name: rsu, mast: {junction: {}}", "name: car, near: {}"
    both, turned, alone = draw(rsu, car), draw(car, rsu), draw(car)
    assert only_station(both) == only_station(turned)
    assert both.vehicles[:2] == turned.vehicles[:2] == alone.vehicles[:2]
    other = draw(rsu.replace("rsu", "mast"))
    assert only_station(other) != only_station(both)
    assert SceneSpec.model_validate_json(both.model_dump_json()) == both


def test_traffic_starts_around_masts_too(maps: dict[str, tuple[RoadNetwork, StartPositions]], draw: Draw) -> None:
    network, _ = maps["Town05"]
    start = draw().vehicles[0].start
    ego_m, _ = network.pose_on_lane(start.lane, start.s_m)
    poles_m = np.array([signal.pole_m for signal in network.signals])
    far_m = poles_m[np.linalg.norm(poles_m[:, :2] - ego_m[:2], axis=1).argmax()]
    assert np.linalg.norm(far_m - ego_m) > 400
    spec = draw(f"name: rsu, mast: {{poses: [{{x_m: {far_m[0]}, y_m: {far_m[1]}, z_m: {far_m[2]}}}]}}")
    starts_m = np.array([network.pose_on_lane(each.start.lane, each.start.s_m)[0] for each in spec.drivers])
    assert np.any(np.linalg.norm(starts_m - far_m, axis=1) < 200)


def test_statistics_count_roadside_units_apart_from_vehicles(draw: Draw) -> None:
    statistics = SceneStatistics()
    agents = "name: rsu, count: 3, mast: {junction: {}}", "name: car, reckless_probability: 0.25"
    statistics.add(draw(*agents))
    means = {name: statistics.numbers[name].mean for name in ("agents", "roadside_units", "vehicles")}
    assert means == {"agents": 5, "roadside_units": 3, "vehicles": 10}
    assert statistics.kinds["agents.blueprint"] == {"vehicle.sedan": 1}
    scenario = parse_scenario(text_of(*agents), "x")
    assert configured_value("agents.reckless", scenario) == "yes with probability 0.25"


@pytest.mark.parametrize(
    ("mast", "message"),
    [
        (
            "poses: [{x_m: 20000, y_m: 0}]",
            r"poses\[0\]: \(20000, 0\) is .* m from the nearest road of map Town05; at most 110 m is allowed",
        ),
        (
            "poses: {Town05: [{x_m: 20000, y_m: 0}]}",
            r"poses\.Town05\[0\]: \(20000, 0\) is .* m from the nearest road of map Town05",
        ),
        ("poses: [{LANE}]", r"poses\[0\]: \(.*\) is on a driving lane of map Town05"),
        (
            "junction: {signalised: false}",
            r"junction: no free position next to an unsignalized junction within 200 m \(traffic.spawn_radius_m\)",
        ),
        (
            "junction: {near: {distance_m: 1000, tolerance_m: 0.001}}",
            r"junction: no free position next to a junction 1000 to 1000 m from ego in map Town05",
        ),
        (
            "above_road: {near: {distance_m: 1000, tolerance_m: 0.001}}",
            r"above_road: no free point above a driving lane 1000 to 1000 m from ego in map Town05",
        ),
    ],
)
def test_a_mast_without_a_place_is_refused_by_its_line(
    draw: Draw, maps: dict[str, tuple[RoadNetwork, StartPositions]], mast: str, message: str
) -> None:
    network, _ = maps["Town05"]
    lane = next(lane for lane in network.lanes_of(LaneKind.DRIVING) if not lane.junction and lane.length_m > 20)
    x_m, y_m, _ = lane.centerline_m.mean(axis=0)
    with pytest.raises(InputError, match=rf"my.yaml:5: agents\[0\].mast.{message}"):
        draw(f"name: rsu, mast: {{{mast.replace('LANE', f'x_m: {x_m}, y_m: {y_m}')}}}")
