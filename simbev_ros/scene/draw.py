"""Drawing a scene: configuration and map in, a complete ``SceneSpec`` out. All randomness of a scene starts here."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from simbev_ros.config.draw import sample
from simbev_ros.config.scenario import SPLITS, Scenario, Split, Traffic
from simbev_ros.errors import InputError
from simbev_ros.maps.lane_kind import LaneKind
from simbev_ros.maps.network import RoadNetwork, Waypoints
from simbev_ros.maps.spec import MapSpec
from simbev_ros.random import stream
from simbev_ros.scene.blueprints import Blueprint, load_blueprints
from simbev_ros.scene.draw_weather import draw_weather
from simbev_ros.scene.spec import PedestrianSpec, SceneSpec, VehicleSpec, WaypointSpec
from simbev_ros.types import Float64Array, Int64Array


class PlannedScene(NamedTuple):
    """A scene that the configuration asks for."""

    number: int
    map: MapSpec
    split: Split


def planned_scenes(scenario: Scenario) -> Iterator[PlannedScene]:
    """The scenes that the configuration asks for, numbered from 0 in the order of the file."""
    number = 0
    for entry in scenario.scenes:
        for split in SPLITS:
            for _ in range(getattr(entry, split)):
                yield PlannedScene(number, MapSpec(name=entry.map), split)
                number += 1


def draw_scene(scenario: Scenario, planned: PlannedScene, network: RoadNetwork) -> SceneSpec:
    """Draw one scene.

    Args:
        scenario: The configuration.
        planned: Number, map and split.
        network: The roads of ``planned.map``.

    Raises:
        InputError: more actors are asked for than there is room, or a blueprint is unknown.
    """
    seed = scenario.seed + planned.number
    waypoints = network.waypoints(scenario.traffic.waypoint_spacing_m)
    ego_place = int(stream(seed, "ego.place").integers(len(waypoints.lane)))
    ego_position_m = waypoints.position_m[ego_place]
    programmes = sorted({signal.programme for signal in network.signals})
    heights_m = np.concatenate([lane.centerline_m[:, 2] for lane in network.lanes.values()])
    return SceneSpec(
        number=planned.number,
        split=planned.split,
        seed=seed,
        map=planned.map,
        tick_ns=scenario.time.tick_ns,
        warm_up_ticks=round(scenario.time.warm_up_s / scenario.time.tick_s),
        ticks=round(scenario.time.duration_s / scenario.time.tick_s),
        weather=draw_weather(scenario.weather, seed, hilly=bool(np.any(np.abs(heights_m) > 0.01))),
        rig=scenario.rig,
        annotation=scenario.annotation,
        vehicles=(
            _draw_ego(scenario, seed, waypoints, ego_place),
            *_draw_vehicles(scenario.traffic, seed, waypoints, ego_place),
        ),
        pedestrians=tuple(_draw_pedestrians(scenario.traffic, seed, network, ego_position_m)),
        green_time_s=tuple(
            sample(scenario.traffic.green_time_s, stream(seed, f"signals.{programme}.green"))
            for programme in programmes
        ),
    )


def _draw_ego(scenario: Scenario, seed: int, waypoints: Waypoints, place: int) -> VehicleSpec:
    by_name = {blueprint.name: blueprint for blueprint in load_blueprints() if blueprint.kind == "vehicle"}
    if scenario.ego.blueprint not in by_name:
        raise InputError(f"ego.blueprint: no vehicle {scenario.ego.blueprint!r}; allowed: {', '.join(by_name)}")
    rng = stream(seed, "ego.style")
    return _vehicle(
        scenario.traffic,
        by_name[scenario.ego.blueprint],
        waypoints,
        place,
        rng,
        reckless_probability=scenario.ego.reckless_probability,
    )


def _draw_vehicles(traffic: Traffic, seed: int, waypoints: Waypoints, ego_place: int) -> Iterator[VehicleSpec]:
    distance_m = np.linalg.norm(waypoints.position_m - waypoints.position_m[ego_place], axis=1)
    free: Int64Array = np.flatnonzero(
        (distance_m <= traffic.spawn_radius_m) & (np.arange(len(distance_m)) != ego_place)
    )
    places = stream(seed, "vehicles.places").permutation(free)
    rng = stream(seed, "vehicles.count")
    if traffic.vehicles == "paper":
        count = int(rng.integers(0, max(len(free) - 3, 0), endpoint=True))
    else:
        count = round(sample(traffic.vehicles, rng))
    if count > len(free):
        raise InputError(
            f"traffic.vehicles: {count} wanted, but only {len(free)} places are free within "
            f"spawn_radius_m {traffic.spawn_radius_m:g} at waypoint_spacing_m {traffic.waypoint_spacing_m:g}"
        )
    blueprints = [blueprint for blueprint in load_blueprints() if blueprint.kind == "vehicle"]
    for index in range(count):
        rng = stream(seed, f"vehicles.{index}")
        blueprint = _choice(blueprints, rng)
        probability = traffic.reckless_probability
        yield _vehicle(traffic, blueprint, waypoints, int(places[index]), rng, reckless_probability=probability)


def _vehicle(
    traffic: Traffic,
    blueprint: Blueprint,
    waypoints: Waypoints,
    place: int,
    rng: np.random.Generator,
    *,
    reckless_probability: float,
) -> VehicleSpec:
    return VehicleSpec(
        blueprint=blueprint.name,
        color=blueprint.colors[int(rng.integers(len(blueprint.colors)))],
        start=WaypointSpec(lane=waypoints.lane[place], s_m=float(waypoints.s_m[place])),
        speed_factor=sample(traffic.speed_factor, rng),
        min_gap_m=sample(traffic.min_gap_m, rng),
        reckless=bool(rng.random() < reckless_probability),
    )


def _draw_pedestrians(
    traffic: Traffic, seed: int, network: RoadNetwork, center_m: Float64Array
) -> Iterator[PedestrianSpec]:
    rng = stream(seed, "pedestrians.count")
    count = int(rng.integers(0, 640, endpoint=True)) if traffic.pedestrians == "paper" else None
    count = round(sample(traffic.pedestrians, rng)) if count is None else count  # type: ignore[arg-type]
    sidewalks = [lane for lane in network.lanes.values() if lane.kind is LaneKind.SIDEWALK]
    places = [
        (lane.id, s_m)
        for lane in sidewalks
        for s_m in np.arange(1.0, lane.length_m - 0.5, 1.0)
        if np.linalg.norm(network.pose_on_lane(lane.id, float(s_m))[0] - center_m) <= traffic.spawn_radius_m
    ]
    if count > len(places):
        raise InputError(
            f"traffic.pedestrians: {count} wanted, but only {len(places)} places are free on sidewalks within "
            f"spawn_radius_m {traffic.spawn_radius_m:g}"
        )
    order = stream(seed, "pedestrians.places").permutation(len(places))
    blueprints = [blueprint for blueprint in load_blueprints() if blueprint.kind == "pedestrian"]
    for index in range(count):
        rng = stream(seed, f"pedestrians.{index}")
        blueprint = _choice(blueprints, rng)
        lane, s_m = places[order[index]]
        yield PedestrianSpec(
            blueprint=blueprint.name,
            color=blueprint.colors[int(rng.integers(len(blueprint.colors)))],
            start=WaypointSpec(lane=lane, s_m=float(s_m)),
            max_speed_mps=sample(traffic.pedestrian_max_speed_mps, rng),
        )


def _choice(blueprints: list[Blueprint], rng: np.random.Generator) -> Blueprint:
    frequencies = np.array([blueprint.frequency for blueprint in blueprints])
    return blueprints[int(rng.choice(len(blueprints), p=frequencies / frequencies.sum()))]
