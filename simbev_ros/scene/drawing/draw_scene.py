"""Drawing a scene: configuration and map in, a complete ``SceneSpec`` out. All randomness of a scene starts here."""

import logging
import math
from collections.abc import Iterator
from functools import cache
from typing import NamedTuple

import numpy as np

from simbev_ros.config.draw import sample
from simbev_ros.config.scenario import SPLITS, Scenario, Split, Timing, Traffic
from simbev_ros.errors import InputError
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.source import map_spec
from simbev_ros.maps.spec import MapSpec
from simbev_ros.random import stream
from simbev_ros.scene.blueprints import Blueprint, blueprint_index, load_blueprints
from simbev_ros.scene.drawing.draw_lights import draw_lights
from simbev_ros.scene.drawing.draw_weather import draw_weathers
from simbev_ros.scene.drawing.drivers import Driver, draw_driver
from simbev_ros.scene.drawing.spawn import draw_spawn
from simbev_ros.scene.drawing.start_clearance import Room
from simbev_ros.scene.drawing.starts import Starts
from simbev_ros.scene.gait import transition_mps
from simbev_ros.scene.hazards.detours import Detours
from simbev_ros.scene.hazards.draw_hazards import DrawnHazards, draw_hazards
from simbev_ros.scene.spec import PedestrianSpec, SceneSpec, VehicleSpec, WaypointSpec
from simbev_ros.scene.streets.off_tracking import is_long
from simbev_ros.types import BoolArray, Float64Array, Int64Array

_LOGGER = logging.getLogger(__name__)
_CLOSE = 0.99  # of the spacing of places: so near the ego nobody else starts on its lane


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


def draw_scene(
    scenario: Scenario, planned: PlannedScene, network: RoadNetwork, starts: Starts | None = None
) -> SceneSpec:
    """Draw one scene.

    Args:
        scenario: The configuration.
        planned: Number, map and split.
        network: The roads of ``planned.map``.
        starts: ``starts_of`` the configuration and these roads, for whoever draws many scenes; by default worked out.

    Raises:
        InputError: more vehicles are asked for than there is room, or a blueprint is unknown or may drive nowhere.
    """
    seed = scenario.seed + planned.number
    starts = starts_of(scenario, network) if starts is None else starts
    ticks, warm_up_ticks = ticks_of(scenario.time, seed), round(scenario.time.warm_up_s / scenario.time.tick_s)
    duration_s = (warm_up_ticks + ticks) * scenario.time.tick_s
    ego, ego_position_m = _draw_ego(scenario, seed, network, starts, duration_s)
    weather, final_weather = draw_weathers(scenario.weather, seed, hilly=starts.is_hilly)
    hazards = _draw_hazards(scenario, seed, network, starts, duration_s, ego, ego_position_m)
    room = Room(network)
    room.take(ego)
    vehicles = tuple(
        _draw_vehicles(scenario.traffic, seed, starts, duration_s, ego.start, ego_position_m, hazards, room)
    )
    return SceneSpec(
        number=planned.number,
        split=planned.split,
        seed=seed,
        map=planned.map,
        tick_ns=scenario.time.tick_ns,
        warm_up_ticks=warm_up_ticks,
        ticks=ticks,
        end_after_standing_ticks=_standing_ticks(scenario),
        weather=weather,
        final_weather=final_weather,
        lights=draw_lights(scenario.lights, seed),
        ego_driver=scenario.ego.driver,
        rig=scenario.rig,
        annotation=scenario.annotation,
        vehicles=(ego, *vehicles, *hazards.vehicles),
        pedestrians=tuple(
            _draw_pedestrians(scenario.traffic, seed, starts, duration_s, network.name, ego_position_m, room)
        ),
        walker_cross_factor=_cross_factor(scenario.traffic, seed),
        hazards=hazards.hazards,
        green_time_s=tuple(
            sample(scenario.traffic.green_time_s, stream(seed, f"signals.{programme}.green"))
            for programme in starts.programmes or ("",)
        ),
    )


def _standing_ticks(scenario: Scenario) -> int | None:
    standing_s = scenario.time.end_after_standing_s
    return None if standing_s is None else max(1, math.ceil(standing_s / scenario.time.tick_s - 1e-6))


def starts_of(scenario: Scenario, network: RoadNetwork) -> Starts:
    """Where actors can start on a map: the part of drawing that all scenes of the map share."""
    return Starts(network, scenario.traffic.waypoint_spacing_m)


def ticks_of(timing: Timing, seed: int) -> int:
    """Length of the scene: as it is fixed, or drawn and rounded to whole ticks."""
    return max(1, round(sample(timing.duration_s, stream(seed, "time.duration")) / timing.tick_s))


def _draw_ego(
    scenario: Scenario, seed: int, network: RoadNetwork, starts: Starts, duration_s: float
) -> tuple[VehicleSpec, Float64Array]:
    """The ego and its (3,) place."""
    by_name = {blueprint.name: blueprint for blueprint in load_blueprints() if blueprint.kind == "vehicle"}
    if scenario.ego.blueprint not in by_name:
        raise InputError(f"ego.blueprint: no vehicle {scenario.ego.blueprint!r}; allowed: {', '.join(by_name)}")
    blueprint = by_name[scenario.ego.blueprint]
    if scenario.ego.spawn:
        start = draw_spawn(scenario.ego.spawn, seed, blueprint, network)
        position_m, _ = network.pose_on_lane(start.lane, start.s_m)
    else:
        somewhere = starts.fit(duration_s)[blueprint.name]
        fit = np.flatnonzero(somewhere if somewhere.any() else starts.anyhow(blueprint, duration_s))
        if not len(fit):
            raise InputError(f"ego.blueprint: {blueprint.name} has no lane to drive on in map {network.name}")
        place = int(fit[stream(seed, "ego.place").integers(len(fit))])
        start, position_m = starts.vehicles.waypoint(place), starts.vehicles.position_m[place]
    probability = scenario.ego.reckless_probability
    driver = draw_driver(scenario.traffic, blueprint, seed, "ego")
    return _vehicle(scenario.traffic, blueprint, start, stream(seed, "ego.style"), probability, driver), position_m


def _free_places(
    traffic: Traffic,
    starts: Starts,
    duration_s: float,
    ego: WaypointSpec,
    ego_m: Float64Array,
    closed: frozenset[str] = frozenset(),
) -> BoolArray:
    """(N,) at which of the places around the ego vehicles can start, with no way onto ``closed`` edges."""
    places = starts.vehicles
    free: BoolArray = (
        places.within(ego_m, traffic.spawn_radius_m)
        & np.any(list(starts.fit(duration_s, closed).values()), axis=0)
        & ~places.beside(ego, _CLOSE * traffic.waypoint_spacing_m)
    )
    return free


def _draw_hazards(
    scenario: Scenario,
    seed: int,
    network: RoadNetwork,
    starts: Starts,
    duration_s: float,
    ego: VehicleSpec,
    ego_m: Float64Array,
) -> DrawnHazards:
    """Hazard areas at some of these places."""
    free = _free_places(scenario.traffic, starts, duration_s, ego.start, ego_m)
    sites = starts.hazard_sites(scenario.hazards.taper_factor)
    blueprint = load_blueprints()[blueprint_index()[ego.blueprint]]
    detours = Detours(network, blueprint, ego.start.lane, starts.vehicles, free)
    return draw_hazards(scenario.hazards, seed, sites, starts.vehicles, free, ego_m, detours)


def _draw_vehicles(
    traffic: Traffic,
    seed: int,
    starts: Starts,
    duration_s: float,
    ego: WaypointSpec,
    ego_m: Float64Array,
    hazards: DrawnHazards,
    room: Room,
) -> Iterator[VehicleSpec]:
    """Vehicles at the free places around the ego and outside of hazard areas, each of a kind that may drive there."""
    places, closed = starts.vehicles, hazards.closed_edges
    fit = starts.fit(duration_s, closed)
    free: Int64Array = np.flatnonzero(
        _free_places(traffic, starts, duration_s, ego, ego_m, closed) & hazards.leave_free(places)
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
    found = 0
    for place in order.tolist():
        if found == count:
            return
        start, rng = places.waypoint(place), stream(seed, f"vehicles.{found}")
        blueprint = _with_room(tuple(name for name in fit if fit[name][place]), start, room, rng)
        if blueprint is not None:
            driver = draw_driver(traffic, blueprint, seed, f"vehicles.{found}")
            vehicle = _vehicle(traffic, blueprint, start, rng, traffic.reckless_probability, driver)
            room.take(vehicle)
            yield vehicle
            found += 1
    if found < count:
        _LOGGER.warning("room for %d of %d vehicles around the ego", found, count)


def _with_room(names: tuple[str, ...], start: WaypointSpec, room: Room, rng: np.random.Generator) -> Blueprint | None:
    """One of these vehicles; a short one if there is no room for that; None if there is none for that either."""
    short = tuple(name for name in names if not is_long(load_blueprints()[blueprint_index()[name]]))
    for allowed in (names, short):
        if allowed and room.is_free(blueprint := _choice("vehicle", allowed, rng), start):
            return blueprint
    return None


def _vehicle(
    traffic: Traffic,
    blueprint: Blueprint,
    start: WaypointSpec,
    rng: np.random.Generator,
    reckless_probability: float,
    driver: Driver,
) -> VehicleSpec:
    return VehicleSpec(
        blueprint=blueprint.name,
        color=blueprint.colors[int(rng.integers(len(blueprint.colors)))],
        start=start,
        speed_factor=sample(traffic.speed_factor, rng),
        min_gap_m=sample(traffic.min_gap_m, rng),
        reckless=bool(rng.random() < reckless_probability),
        **driver,
    )


def _draw_pedestrians(
    traffic: Traffic,
    seed: int,
    starts: Starts,
    duration_s: float,
    map_name: str,
    center_m: Float64Array,
    room: Room,
) -> Iterator[PedestrianSpec]:
    """Pedestrians on sidewalks around the ego; as many as there is room for, down to none, and a note if not all."""
    rng = stream(seed, "pedestrians.count")
    wanted = int(rng.integers(0, 640, endpoint=True)) if traffic.pedestrians == "paper" else None
    wanted = round(sample(traffic.pedestrians, rng)) if wanted is None else wanted  # type: ignore[arg-type]
    places = starts.pedestrians
    near = np.flatnonzero(starts.walkable(duration_s, center_m, traffic.spawn_radius_m))
    half_width_m = np.array([lane.width_m for lane in places.lanes])[places.row[near]] / 2.0
    near = near[room.is_free_at(places.position_m[near], half_width_m)]
    if wanted > len(near):
        _LOGGER.warning(
            "%s: room for %d of %d pedestrians on sidewalks within spawn_radius_m %g of the ego",
            *(map_name, len(near), wanted, traffic.spawn_radius_m),
        )
    order = stream(seed, "pedestrians.places").permutation(near)
    cross_factor = _cross_factor(traffic, seed)
    for index, place in enumerate(order[:wanted]):
        rng = stream(seed, f"pedestrians.{index}")
        blueprint = _choice("pedestrian", None, rng)
        color = blueprint.colors[int(rng.integers(len(blueprint.colors)))]
        max_speed_mps = sample(traffic.pedestrian_max_speed_mps, rng)
        if blueprint.runs_as and max_speed_mps > transition_mps(blueprint.size_m[2]):
            blueprint = load_blueprints()[blueprint_index()[blueprint.runs_as]]
            color = blueprint.colors[int(stream(seed, f"pedestrians.{index}.sports").integers(len(blueprint.colors)))]
        yield PedestrianSpec(
            blueprint=blueprint.name,
            color=color,
            start=places.waypoint(int(place)),
            max_speed_mps=min(max_speed_mps, blueprint.max_speed_mps or math.inf),
            # Wheelchairs do not take kerbs.
            jaywalks=not blueprint.wheelchair
            and bool(stream(seed, f"pedestrians.{index}.jaywalks").random() < cross_factor),
            visits_plazas=max_speed_mps <= transition_mps(blueprint.size_m[2])
            and bool(stream(seed, f"pedestrians.{index}.plazas").random() < traffic.plaza_probability),
        )


def _cross_factor(traffic: Traffic, seed: int) -> float:
    """Share of the scene's pedestrians that may jaywalk."""
    return sample(traffic.walker_cross_factor, stream(seed, "pedestrians.cross_factor"))


def _choice(kind: str, names: tuple[str, ...] | None, rng: np.random.Generator) -> Blueprint:
    """One of the blueprints of a kind and of some (None: any) names, each as often as it is frequent."""
    blueprints, shares = _frequencies(kind, names)
    return blueprints[int(np.searchsorted(shares, rng.random(), side="right"))]


@cache
def _frequencies(kind: str, names: tuple[str, ...] | None) -> tuple[list[Blueprint], Float64Array]:
    """Such blueprints, and the (B,) share of all draws that falls on each or one before it."""
    blueprints = [each for each in load_blueprints() if each.kind == kind and (names is None or each.name in names)]
    upto = np.cumsum([blueprint.frequency for blueprint in blueprints])
    return blueprints, upto / upto[-1]
