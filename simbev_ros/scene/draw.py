"""Drawing a scene: configuration and map in, a complete ``SceneSpec`` out. All randomness of a scene starts here."""

import logging
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from simbev_ros.config.draw import sample
from simbev_ros.config.scenario import SPLITS, Scenario, Split, Traffic
from simbev_ros.errors import InputError
from simbev_ros.maps.network import Lane, RoadNetwork
from simbev_ros.maps.source import map_spec
from simbev_ros.maps.spec import MapSpec
from simbev_ros.random import stream
from simbev_ros.scene.blueprints import Blueprint, load_blueprints
from simbev_ros.scene.draw_weather import draw_weather
from simbev_ros.scene.places import Places, places_along
from simbev_ros.scene.spec import PedestrianSpec, SceneSpec, VehicleSpec
from simbev_ros.scene.streets import Streets
from simbev_ros.scene.walks import WalkGraph
from simbev_ros.types import BoolArray, Float64Array, Int64Array

_LOGGER = logging.getLogger(__name__)
_WALK_MPS = 2.0  # where one can walk at this speed for the whole scene is room enough


class PlannedScene(NamedTuple):
    """A scene that the configuration asks for."""

    number: int
    map: MapSpec
    split: Split


def planned_scenes(scenario: Scenario) -> Iterator[PlannedScene]:
    """The scenes that the configuration asks for, numbered from 0 in the order of the file.

    Raises:
        InputError: There is no such map.
    """
    number = 0
    for entry in scenario.scenes:
        chosen = map_spec(entry.map)
        for split in SPLITS:
            for _ in range(getattr(entry, split)):
                yield PlannedScene(number, chosen, split)
                number += 1


def draw_scene(scenario: Scenario, planned: PlannedScene, network: RoadNetwork) -> SceneSpec:
    """Draw one scene.

    Args:
        scenario: The configuration.
        planned: Number, map and split.
        network: The roads of ``planned.map``.

    Raises:
        InputError: more vehicles are asked for than there is room, or a blueprint is unknown or may drive nowhere.
    """
    seed = scenario.seed + planned.number
    starts = _starts(scenario, network)
    ego, ego_position_m = _draw_ego(scenario, seed, network.name, starts)
    programmes = sorted({signal.programme for signal in network.signals}) or [""]
    heights_m = np.concatenate([lane.centerline_m[:, 2] for lane in network.lanes.values()])
    pedestrians = _draw_pedestrians(scenario, seed, network, ego_position_m)
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
        vehicles=(ego, *_draw_vehicles(scenario.traffic, seed, starts, ego_position_m)),
        pedestrians=tuple(pedestrians),
        green_time_s=tuple(
            sample(scenario.traffic.green_time_s, stream(seed, f"signals.{programme}.green"))
            for programme in programmes
        ),
    )


class _Starts(NamedTuple):
    """Places where vehicles can start, and for each of SUMO's vehicle classes (N,) at which of them it can."""

    places: Places
    fit: Mapping[str, BoolArray]


def _starts(scenario: Scenario, network: RoadNetwork) -> _Starts:
    """Waypoints of the map from which each class gets as far as it could drive in the scene."""
    streets = Streets(network)
    spacing_m = scenario.traffic.waypoint_spacing_m
    places = places_along(streets.lanes, spacing_m / 2.0, spacing_m)
    fastest_mps = max((lane.speed_mps for lane in streets.lanes), default=0.0)
    fit = {}
    for sumo_class in sorted({blueprint.sumo_class for blueprint in _vehicle_blueprints()}):
        speeds_mps = [each.max_speed_mps for each in _vehicle_blueprints() if each.sumo_class == sumo_class]
        way_m = _duration_s(scenario) * min(fastest_mps, max(speeds_mps))
        fit[sumo_class] = streets.for_class(sumo_class).fit(places.row, places.s_m, way_m)
    return _Starts(places, fit)


def _duration_s(scenario: Scenario) -> float:
    return scenario.time.warm_up_s + scenario.time.duration_s


def _vehicle_blueprints() -> list[Blueprint]:
    return [blueprint for blueprint in load_blueprints() if blueprint.kind == "vehicle"]


def _draw_ego(scenario: Scenario, seed: int, map_name: str, starts: _Starts) -> tuple[VehicleSpec, Float64Array]:
    """The ego and its (3,) place."""
    by_name = {blueprint.name: blueprint for blueprint in _vehicle_blueprints()}
    if scenario.ego.blueprint not in by_name:
        raise InputError(f"ego.blueprint: no vehicle {scenario.ego.blueprint!r}; allowed: {', '.join(by_name)}")
    blueprint = by_name[scenario.ego.blueprint]
    fit = np.flatnonzero(starts.fit[blueprint.sumo_class])
    if not len(fit):
        raise InputError(f"ego.blueprint: {blueprint.name} has no lane to drive on in map {map_name}")
    place = int(fit[stream(seed, "ego.place").integers(len(fit))])
    probability = scenario.ego.reckless_probability
    ego = _vehicle(scenario.traffic, blueprint, starts.places, place, stream(seed, "ego.style"), probability)
    return ego, starts.places.position_m[place]


def _draw_vehicles(traffic: Traffic, seed: int, starts: _Starts, ego_m: Float64Array) -> Iterator[VehicleSpec]:
    """Vehicles at the free places around the ego, each of a kind that may drive there."""
    places, fit = starts
    free: Int64Array = np.flatnonzero(
        places.within(ego_m, traffic.spawn_radius_m)
        & np.any(list(fit.values()), axis=0)
        & np.any(places.position_m != ego_m, axis=1)
    )
    order = stream(seed, "vehicles.places").permutation(free)
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
    for index, place in enumerate(order[:count]):
        rng = stream(seed, f"vehicles.{index}")
        blueprint = _choice([each for each in _vehicle_blueprints() if fit[each.sumo_class][place]], rng)
        yield _vehicle(traffic, blueprint, places, int(place), rng, traffic.reckless_probability)


def _vehicle(
    traffic: Traffic,
    blueprint: Blueprint,
    places: Places,
    place: int,
    rng: np.random.Generator,
    reckless_probability: float,
) -> VehicleSpec:
    return VehicleSpec(
        blueprint=blueprint.name,
        color=blueprint.colors[int(rng.integers(len(blueprint.colors)))],
        start=places.waypoint(place),
        speed_factor=sample(traffic.speed_factor, rng),
        min_gap_m=sample(traffic.min_gap_m, rng),
        reckless=bool(rng.random() < reckless_probability),
    )


def _draw_pedestrians(
    scenario: Scenario, seed: int, network: RoadNetwork, center_m: Float64Array
) -> Iterator[PedestrianSpec]:
    """Pedestrians on sidewalks around the ego; as many as there is room for, down to none, and a note if not all."""
    traffic = scenario.traffic
    rng = stream(seed, "pedestrians.count")
    wanted = int(rng.integers(0, 640, endpoint=True)) if traffic.pedestrians == "paper" else None
    wanted = round(sample(traffic.pedestrians, rng)) if wanted is None else wanted  # type: ignore[arg-type]
    places = places_along(_long_sidewalks(scenario, network, center_m), 1.0, 1.0, end_margin_m=0.5)
    near = np.flatnonzero(places.within(center_m, traffic.spawn_radius_m))
    if wanted > len(near):
        _LOGGER.warning(
            "%s: room for %d of %d pedestrians on sidewalks within spawn_radius_m %g of the ego",
            *(network.name, len(near), wanted, traffic.spawn_radius_m),
        )
    blueprints = [blueprint for blueprint in load_blueprints() if blueprint.kind == "pedestrian"]
    order = stream(seed, "pedestrians.places").permutation(near)
    for index, place in enumerate(order[:wanted]):
        rng = stream(seed, f"pedestrians.{index}")
        blueprint = _choice(blueprints, rng)
        yield PedestrianSpec(
            blueprint=blueprint.name,
            color=blueprint.colors[int(rng.integers(len(blueprint.colors)))],
            start=places.waypoint(int(place)),
            max_speed_mps=sample(traffic.pedestrian_max_speed_mps, rng),
        )


def _long_sidewalks(scenario: Scenario, network: RoadNetwork, center_m: Float64Array) -> list[Lane]:
    """Sidewalks that may come within the spawn radius and from which one can walk through the scene, or the longest."""
    walks = WalkGraph(network)
    way_m = walks.component_m()
    needed_m = min(_duration_s(scenario) * _WALK_MPS, max(way_m.values(), default=0.0))
    return [
        lane
        for lane in walks.sidewalks
        if way_m[lane.edge] >= needed_m
        and np.linalg.norm(lane.centerline_m[0] - center_m) <= scenario.traffic.spawn_radius_m + lane.length_m
    ]


def _choice(blueprints: Sequence[Blueprint], rng: np.random.Generator) -> Blueprint:
    frequencies = np.array([blueprint.frequency for blueprint in blueprints])
    return blueprints[int(rng.choice(len(blueprints), p=frequencies / frequencies.sum()))]
