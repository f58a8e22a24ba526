"""Drawn scenes are complete, repeatable, and follow the paper's rules."""

import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from simbev_ros.config.load import load_scenario
from simbev_ros.config.scenario import Scenario
from simbev_ros.config.traffic import Traffic
from simbev_ros.config.weather import WeatherConfig
from simbev_ros.foundation.errors import InputError
from simbev_ros.maps.build import load_network
from simbev_ros.maps.network import Lane, RoadNetwork
from simbev_ros.maps.roads.lane_kind import WALKABLE_KINDS, LaneKind
from simbev_ros.scene.blueprints import load_blueprints
from simbev_ros.scene.drawing.draw_scene import PlannedScene, draw_scene, planned_scenes
from simbev_ros.scene.drawing.draw_weather import draw_weather
from simbev_ros.schema.scene.map_spec import MapSpec
from simbev_ros.schema.scene.spec import PedestrianSpec, SceneSpec

PLANNED = PlannedScene(3, MapSpec(name="Blocks"), "train")


@pytest.fixture(scope="module")
def network() -> RoadNetwork:
    return load_network(PLANNED.map)


def scenario(**changes: object) -> Scenario:
    return load_scenario("paper").model_copy(update=changes)


def test_same_seed_draws_the_same_scene_and_another_number_another(network: RoadNetwork) -> None:
    first = draw_scene(scenario(), PLANNED, network)
    assert draw_scene(scenario(), PLANNED, network) == first
    other = draw_scene(scenario(), PLANNED._replace(number=4), network)
    assert (other.weather, other.vehicles, other.green_time_s) != (first.weather, first.vehicles, first.green_time_s)


def test_spec_survives_json(network: RoadNetwork) -> None:
    spec = draw_scene(scenario(), PLANNED, network)
    assert SceneSpec.model_validate_json(spec.model_dump_json()) == spec


def test_one_more_vehicle_leaves_the_others_unchanged(network: RoadNetwork) -> None:
    few = draw_scene(scenario(traffic=Traffic(vehicles=10, pedestrians=5)), PLANNED, network)
    more = draw_scene(scenario(traffic=Traffic(vehicles=11, pedestrians=6)), PLANNED, network)
    assert more.vehicles[: len(few.vehicles)] == few.vehicles
    assert more.pedestrians[:5] == few.pedestrians
    assert more.weather == few.weather


def test_vehicles_start_on_different_waypoints_within_the_radius(network: RoadNetwork) -> None:
    spec = draw_scene(scenario(traffic=Traffic(vehicles=40, pedestrians=0, spawn_radius_m=200)), PLANNED, network)
    starts = [(vehicle.start.lane, vehicle.start.s_m) for vehicle in spec.vehicles]
    assert len(set(starts)) == 41
    positions = np.array([network.pose_on_lane(*start)[0] for start in starts])
    assert np.linalg.norm(positions - positions[0], axis=1).max() <= 200


def test_of_more_vehicles_than_free_positions_those_with_room_are_drawn(
    network: RoadNetwork, caplog: pytest.LogCaptureFixture
) -> None:
    traffic = Traffic(vehicles=500, pedestrians=0, spawn_radius_m=100)
    spec = draw_scene(scenario(traffic=traffic), PLANNED, network)
    (message,) = caplog.messages
    found = re.match(r"Blocks: room for (\d+) of 500 vehicles on lanes within spawn_radius_m 100 of the ego", message)
    assert found and 5 < int(found[1]) < len(spec.vehicles) < 100


def test_unknown_ego_blueprint_lists_the_vehicles(network: RoadNetwork) -> None:
    ego = scenario().ego.model_copy(update={"blueprint": "vehicle.tank"})
    with pytest.raises(InputError, match=r"ego.blueprint: no vehicle 'vehicle.tank'; allowed: .*vehicle.hatchback"):
        draw_scene(scenario(ego=ego), PLANNED, network)


def with_lanes(network: RoadNetwork, change: Callable[[Lane], Lane | None]) -> RoadNetwork:
    changed = {name: change(lane) for name, lane in network.lanes.items()}
    return replace(network, lanes={name: lane for name, lane in changed.items() if lane is not None})


def test_no_vehicle_starts_on_a_lane_that_is_closed_to_its_class(network: RoadNetwork) -> None:
    def bus_lanes(lane: Lane) -> Lane:
        right = network.lanes.get(f"{lane.edge}_{lane.index - 1}")
        is_rightmost = lane.kind is LaneKind.DRIVING and (right is None or right.kind is not LaneKind.DRIVING)
        is_bus_lane = is_rightmost and not lane.junction
        return replace(lane, classes=frozenset({"bus", "emergency"})) if is_bus_lane else lane

    changed = with_lanes(network, bus_lanes)
    closed = [lane for lane in changed.lanes.values() if lane.classes == {"bus", "emergency"}]
    assert 0.2 < len(closed) / len(changed.lanes_of(LaneKind.DRIVING)) < 0.8
    classes = {blueprint.name: blueprint.sumo_class for blueprint in load_blueprints()}
    on_bus_lanes = set()
    for number in range(8):
        spec = draw_scene(scenario(), PLANNED._replace(number=number), changed)
        for vehicle in spec.vehicles:
            assert classes[vehicle.blueprint] in changed.lanes[vehicle.start.lane].classes
            if changed.lanes[vehicle.start.lane] in closed:
                on_bus_lanes.add(classes[vehicle.blueprint])
    assert on_bus_lanes == {"bus", "emergency"}


def test_traffic_starts_on_driving_lanes_only(network: RoadNetwork) -> None:
    kinds = (LaneKind.PARKING, LaneKind.SHOULDER, LaneKind.MEDIAN, LaneKind.BICYCLE)

    def other_kind(lane: Lane) -> Lane:
        index = sum(map(ord, lane.edge))
        return replace(lane, kind=kinds[index % 4]) if lane.kind is LaneKind.DRIVING and index % 5 == 0 else lane

    changed = with_lanes(network, other_kind)
    spec = draw_scene(scenario(), PLANNED, changed)
    assert {changed.lanes[vehicle.start.lane].kind for vehicle in spec.vehicles} == {LaneKind.DRIVING}


def test_an_ego_without_a_lane_to_drive_on_is_refused(network: RoadNetwork) -> None:
    changed = with_lanes(network, lambda lane: replace(lane, classes=frozenset({"bus", "pedestrian"})))
    with pytest.raises(InputError, match=r"ego.blueprint: vehicle.sedan has no lane to drive on in map Blocks"):
        draw_scene(scenario(), PLANNED, changed)


def test_a_map_without_sidewalks_has_no_pedestrians_and_logs_a_warning(
    network: RoadNetwork, caplog: pytest.LogCaptureFixture
) -> None:
    bare = with_lanes(network, lambda lane: None if lane.kind in WALKABLE_KINDS else lane)
    spec = draw_scene(scenario(traffic=Traffic(vehicles=5, pedestrians=60)), PLANNED, bare)
    assert (len(spec.vehicles), len(spec.pedestrians)) == (6, 0)
    assert caplog.messages == ["Blocks: room for 0 of 60 pedestrians on sidewalks within spawn_radius_m 400 of the ego"]


def test_pedestrians_start_near_the_ego_on_connected_sidewalks_that_are_long_enough(network: RoadNetwork) -> None:
    lone = next(lane for lane in network.lanes.values() if lane.kind is LaneKind.SIDEWALK)
    island = replace(lone, id="island_0", edge="island", successors=(), centerline_m=lone.centerline_m[:2])
    added = replace(network, lanes={**network.lanes, island.id: island})
    spec = draw_scene(scenario(traffic=Traffic(vehicles=0, pedestrians=600, spawn_radius_m=150)), PLANNED, added)
    positions_m = np.array([added.pose_on_lane(each.start.lane, each.start.s_m)[0] for each in spec.pedestrians])
    ego_m = added.pose_on_lane(spec.vehicles[0].start.lane, spec.vehicles[0].start.s_m)[0]
    assert np.linalg.norm(positions_m - ego_m, axis=1).max() <= 150.0
    assert len(spec.pedestrians) > 100
    assert "island_0" not in {each.start.lane for each in spec.pedestrians}


def test_pedestrians_faster_than_walking_speed_run_in_sports_clothes(network: RoadNetwork) -> None:
    def draw_pedestrians(max_speed_mps: float) -> tuple[PedestrianSpec, ...]:
        traffic = Traffic(vehicles=0, pedestrians=120, pedestrian_max_speed_mps=max_speed_mps, group_probability=0)
        return draw_scene(scenario(traffic=traffic), PLANNED, network).pedestrians

    slow, fast = draw_pedestrians(1.5), draw_pedestrians(5.0)
    named = {blueprint.name: blueprint for blueprint in load_blueprints()}
    assert len({each.blueprint for each in fast}) == 4
    for walker, runner in zip(slow, fast, strict=True):
        expected = named[walker.blueprint].runs_as or "pedestrian.wheelchair"
        assert (runner.blueprint, runner.start, runner.jaywalks) == (expected, walker.start, walker.jaywalks)
        assert runner.color in named[expected].colors
        assert runner.max_speed_mps == (2.2 if expected == "pedestrian.wheelchair" else 5.0)


def test_only_slow_pedestrians_limp(network: RoadNetwork) -> None:
    limping = {blueprint.name: blueprint.fast for blueprint in load_blueprints() if blueprint.fast}

    def draw_pedestrians(max_speed_mps: float) -> list[str]:
        traffic = Traffic(vehicles=0, pedestrians=400, pedestrian_max_speed_mps=max_speed_mps, group_probability=0)
        return [each.blueprint for each in draw_scene(scenario(traffic=traffic), PLANNED, network).pedestrians]

    slow, fast = draw_pedestrians(0.8), draw_pedestrians(1.2)
    assert 1 < sum(name in limping for name in slow) < 0.15 * len(slow)
    assert fast == [limping.get(name, name) for name in slow]


@pytest.mark.slow
def test_paper_draws_up_to_three_less_than_the_free_positions(network: RoadNetwork) -> None:
    traffic = Traffic(spawn_radius_m=150, pedestrians=0)
    counts = []
    for number in range(40):
        spec = draw_scene(scenario(traffic=traffic), PLANNED._replace(number=number), network)
        waypoints = network.waypoints(24)
        ego_m = network.pose_on_lane(spec.vehicles[0].start.lane, spec.vehicles[0].start.s_m)[0]
        free = int((np.linalg.norm(waypoints.position_m - ego_m, axis=1) <= 150).sum()) - 1
        counts.append((len(spec.vehicles) - 1) / (free - 3))
    assert max(counts) <= 1
    assert 0.3 < np.mean(counts) < 0.7


def test_weather_follows_the_papers_conditions() -> None:
    drawn = [draw_weather(WeatherConfig(), seed, even_fog=False) for seed in range(800)]
    dry = [weather for weather in drawn if weather.cloudiness <= 40]
    assert dry and all(weather.precipitation == 0 for weather in dry)
    assert all(weather.precipitation <= weather.cloudiness for weather in drawn)
    assert all(weather.precipitation_deposits >= weather.precipitation for weather in drawn)
    clear_day = [weather for weather in dry if weather.sun_altitude_deg >= 10]
    assert clear_day and all(weather.fog_density == 0 and weather.fog_falloff == 1 for weather in clear_day)
    cloudiness = np.array([weather.cloudiness for weather in drawn])
    assert cloudiness.mean() == pytest.approx(100 * 0.8 / 1.8, abs=3)
    altitude = np.array([weather.sun_altitude_deg for weather in drawn])
    assert altitude.mean() == pytest.approx(180 * 3.6 / 5.6 - 90, abs=4)


def test_fixing_one_weather_parameter_leaves_the_independent_ones_unchanged() -> None:
    free = draw_weather(WeatherConfig(), 5, even_fog=False)
    fixed = draw_weather(WeatherConfig(cloudiness=12.0), 5, even_fog=False)
    assert fixed.cloudiness == 12.0
    assert (fixed.wind_intensity, fixed.sun_azimuth_deg) == (free.wind_intensity, free.sun_azimuth_deg)


def test_scenes_are_numbered_in_the_order_of_the_file() -> None:
    planned = list(planned_scenes(load_scenario("paper")))
    assert [scene.number for scene in planned] == list(range(320))
    assert [scene.split for scene in planned].count("val") == 50


def test_time_never_runs_backwards_from_scene_to_scene(network: RoadNetwork) -> None:
    one = draw_scene(scenario(), PLANNED, network)
    two = draw_scene(scenario(), PLANNED._replace(number=4), network)
    assert one.stamp_ns(one.ticks) < two.stamp_ns(two.loaded_tick)
    assert one.tick_of(one.stamp_ns(-1)) == -1


def test_a_message_stamped_between_two_ticks_is_published_at_the_later_one(network: RoadNetwork) -> None:
    spec = draw_scene(scenario(), PLANNED, network)
    around = [spec.stamp_ns(3) - 1, spec.stamp_ns(3), spec.stamp_ns(3) + 1]
    assert [spec.publishing_tick_of(stamp_ns) for stamp_ns in around] == [3, 3, 4]
    assert [spec.messages_per_tick(rate_hz) for rate_hz in (None, 10, 20, 40, 100)] == [1, 1, 1, 2, 5]
