"""Draw scenes: configuration and map in, a complete ``SceneSpec`` out. All randomness of a scene starts here."""

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
from simbev_ros.scene.drawing.drivers import DriverFields, draw_driver
from simbev_ros.scene.drawing.spawn import draw_spawn
from simbev_ros.scene.drawing.start_clearance import StartClearance
from simbev_ros.scene.drawing.starts import StartPositions
from simbev_ros.scene.gait import transition_mps
from simbev_ros.scene.hazards.detours import Detours
from simbev_ros.scene.hazards.draw_hazards import DrawnHazards, draw_hazards
from simbev_ros.scene.spec import PedestrianSpec, SceneSpec, VehicleSpec, WaypointSpec
from simbev_ros.scene.streets.off_tracking import is_long
from simbev_ros.types import BoolArray, Float64Array, Int64Array

_LOGGER = logging.getLogger(__name__)
_CLEARANCE_FACTOR = 0.99  # of the waypoint spacing: no other vehicle starts closer to the ego on its lane


class PlannedScene(NamedTuple):
    """A scene that the configuration asks for."""

    number: int
    map: MapSpec
    split: Split


def planned_scenes(scenario: Scenario) -> Iterator[PlannedScene]:
    """Yield the scenes that the configuration asks for, numbered from 0 in the order of the file.

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
    scenario: Scenario, planned: PlannedScene, network: RoadNetwork, starts: StartPositions | None = None
) -> SceneSpec:
    """Draw one scene.

    Args:
        scenario: The configuration.
        planned: Number, map and split.
        network: The roads of ``planned.map``.
        starts: ``start_positions`` of this configuration and network, to be shared between scenes; None: compute it.

    Raises:
        InputError: More vehicles are requested than there are free positions, or the ego's blueprint is unknown or has
            no lane to drive on.
    """
    seed = scenario.seed + planned.number
    starts = start_positions(scenario, network) if starts is None else starts
    ticks, warm_up_ticks = duration_ticks(scenario.time, seed), round(scenario.time.warm_up_s / scenario.time.tick_s)
    duration_s = (warm_up_ticks + ticks) * scenario.time.tick_s
    ego, ego_position_m = _draw_ego(scenario, seed, network, starts, duration_s)
    weather, final_weather = draw_weathers(scenario.weather, seed, hilly=starts.is_hilly)
    hazards = _draw_hazards(scenario, seed, network, starts, duration_s, ego, ego_position_m)
    clearance = StartClearance(network)
    clearance.occupy(ego)
    vehicles = tuple(
        _draw_vehicles(scenario.traffic, seed, starts, duration_s, ego.start, ego_position_m, hazards, clearance)
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
            _draw_pedestrians(scenario.traffic, seed, starts, duration_s, network.name, ego_position_m, clearance)
        ),
        walker_cross_factor=_cross_factor(scenario.traffic, seed),
        hazards=hazards.hazards,
        green_time_s=tuple(
            sample(scenario.traffic.green_time_s, stream(seed, f"signals.{program}.green"))
            for program in starts.signal_programs or ("",)
        ),
    )


def _standing_ticks(scenario: Scenario) -> int | None:
    standing_s = scenario.time.end_after_standing_s
    return None if standing_s is None else max(1, math.ceil(standing_s / scenario.time.tick_s - 1e-6))


def start_positions(scenario: Scenario, network: RoadNetwork) -> StartPositions:
    """Compute where actors can start on a map: the part of drawing that all scenes of the map share."""
    return StartPositions(network, scenario.traffic.waypoint_spacing_m)


def duration_ticks(timing: Timing, seed: int) -> int:
    """Number of ticks of a scene: its fixed or drawn duration, rounded to whole ticks."""
    return max(1, round(sample(timing.duration_s, stream(seed, "time.duration")) / timing.tick_s))


def _draw_ego(
    scenario: Scenario, seed: int, network: RoadNetwork, starts: StartPositions, duration_s: float
) -> tuple[VehicleSpec, Float64Array]:
    """Draw the ego and its (3,) position."""
    by_name = {blueprint.name: blueprint for blueprint in load_blueprints() if blueprint.kind == "vehicle"}
    if scenario.ego.blueprint not in by_name:
        raise InputError(f"ego.blueprint: no vehicle {scenario.ego.blueprint!r}; allowed: {', '.join(by_name)}")
    blueprint = by_name[scenario.ego.blueprint]
    if scenario.ego.spawn:
        start = draw_spawn(scenario.ego.spawn, seed, blueprint, network)
        position_m, _ = network.pose_on_lane(start.lane, start.s_m)
    else:
        without_tight_turns = starts.usable(duration_s)[blueprint.name]
        usable = np.flatnonzero(
            without_tight_turns if without_tight_turns.any() else starts.usable_on_tight_turns(blueprint, duration_s)
        )
        if not len(usable):
            raise InputError(f"ego.blueprint: {blueprint.name} has no lane to drive on in map {network.name}")
        position_index = int(usable[stream(seed, "ego.place").integers(len(usable))])
        start, position_m = starts.vehicles.waypoint(position_index), starts.vehicles.position_m[position_index]
    probability = scenario.ego.reckless_probability
    driver = draw_driver(scenario.traffic, blueprint, seed, "ego")
    return _vehicle(scenario.traffic, blueprint, start, stream(seed, "ego.style"), probability, driver), position_m


def _free_positions(
    traffic: Traffic,
    starts: StartPositions,
    duration_s: float,
    ego: WaypointSpec,
    ego_m: Float64Array,
    closed: frozenset[str] = frozenset(),
) -> BoolArray:
    """(N,) positions around the ego where vehicles can start, with routes that avoid ``closed`` edges."""
    positions = starts.vehicles
    free: BoolArray = (
        positions.within_radius(ego_m, traffic.spawn_radius_m)
        & np.any(list(starts.usable(duration_s, closed).values()), axis=0)
        & ~positions.on_lane_near(ego, _CLEARANCE_FACTOR * traffic.waypoint_spacing_m)
    )
    return free


def _draw_hazards(
    scenario: Scenario,
    seed: int,
    network: RoadNetwork,
    starts: StartPositions,
    duration_s: float,
    ego: VehicleSpec,
    ego_m: Float64Array,
) -> DrawnHazards:
    """Draw hazard areas at some of the free positions."""
    free = _free_positions(scenario.traffic, starts, duration_s, ego.start, ego_m)
    sites = starts.hazard_sites(scenario.hazards.taper_factor)
    blueprint = load_blueprints()[blueprint_index()[ego.blueprint]]
    detours = Detours(network, blueprint, ego.start.lane, starts.vehicles, free)
    return draw_hazards(scenario.hazards, seed, sites, starts.vehicles, free, ego_m, detours)


def _draw_vehicles(
    traffic: Traffic,
    seed: int,
    starts: StartPositions,
    duration_s: float,
    ego: WaypointSpec,
    ego_m: Float64Array,
    hazards: DrawnHazards,
    clearance: StartClearance,
) -> Iterator[VehicleSpec]:
    """Draw vehicles at free positions around the ego and outside hazard areas, each of a kind that may drive there."""
    positions, closed = starts.vehicles, hazards.closed_edges
    usable = starts.usable(duration_s, closed)
    free: Int64Array = np.flatnonzero(
        _free_positions(traffic, starts, duration_s, ego, ego_m, closed) & hazards.free_positions(positions)
    )
    order = stream(seed, "vehicles.places").permutation(free)
    rng = stream(seed, "vehicles.count")
    if traffic.vehicles == "paper":
        count = int(rng.integers(0, max(len(free) - 3, 0), endpoint=True))
    else:
        count = round(sample(traffic.vehicles, rng))
    if count > len(free):
        raise InputError(
            f"traffic.vehicles: {count} requested, but only {len(free)} positions are free within "
            f"spawn_radius_m {traffic.spawn_radius_m:g} at waypoint_spacing_m {traffic.waypoint_spacing_m:g}"
        )
    drawn_count = 0
    for position_index in order.tolist():
        if drawn_count == count:
            return
        start, rng = positions.waypoint(position_index), stream(seed, f"vehicles.{drawn_count}")
        blueprint = _draw_blueprint_with_room(
            tuple(name for name in usable if usable[name][position_index]), start, clearance, rng
        )
        if blueprint is not None:
            driver = draw_driver(traffic, blueprint, seed, f"vehicles.{drawn_count}")
            vehicle = _vehicle(traffic, blueprint, start, rng, traffic.reckless_probability, driver)
            clearance.occupy(vehicle)
            yield vehicle
            drawn_count += 1
    if drawn_count < count:
        _LOGGER.warning("room for %d of %d vehicles around the ego", drawn_count, count)


def _draw_blueprint_with_room(
    names: tuple[str, ...], start: WaypointSpec, clearance: StartClearance, rng: np.random.Generator
) -> Blueprint | None:
    """Draw one of these blueprints; if it does not fit, a short one; None if that does not fit either."""
    short = tuple(name for name in names if not is_long(load_blueprints()[blueprint_index()[name]]))
    for allowed in (names, short):
        if allowed and clearance.is_free(blueprint := _draw_blueprint("vehicle", allowed, rng), start):
            return blueprint
    return None


def _vehicle(
    traffic: Traffic,
    blueprint: Blueprint,
    start: WaypointSpec,
    rng: np.random.Generator,
    reckless_probability: float,
    driver: DriverFields,
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
    starts: StartPositions,
    duration_s: float,
    map_name: str,
    ego_m: Float64Array,
    clearance: StartClearance,
) -> Iterator[PedestrianSpec]:
    """Draw pedestrians on sidewalks around the ego; fewer than requested, with a warning, if there is no room."""
    rng = stream(seed, "pedestrians.count")
    requested = int(rng.integers(0, 640, endpoint=True)) if traffic.pedestrians == "paper" else None
    requested = round(sample(traffic.pedestrians, rng)) if requested is None else requested  # type: ignore[arg-type]
    positions = starts.pedestrians
    candidates = np.flatnonzero(starts.walkable_near(duration_s, ego_m, traffic.spawn_radius_m))
    half_width_m = np.array([lane.width_m for lane in positions.lanes])[positions.row[candidates]] / 2.0
    candidates = candidates[clearance.is_free_at(positions.position_m[candidates], half_width_m)]
    if requested > len(candidates):
        _LOGGER.warning(
            "%s: room for %d of %d pedestrians on sidewalks within spawn_radius_m %g of the ego",
            *(map_name, len(candidates), requested, traffic.spawn_radius_m),
        )
    order = stream(seed, "pedestrians.places").permutation(candidates)
    cross_factor = _cross_factor(traffic, seed)
    for index, position_index in enumerate(order[:requested]):
        rng = stream(seed, f"pedestrians.{index}")
        blueprint = _draw_blueprint("pedestrian", None, rng)
        color = blueprint.colors[int(rng.integers(len(blueprint.colors)))]
        max_speed_mps = sample(traffic.pedestrian_max_speed_mps, rng)
        if blueprint.runs_as and max_speed_mps > transition_mps(blueprint.size_m[2]):
            blueprint = load_blueprints()[blueprint_index()[blueprint.runs_as]]
            color = blueprint.colors[int(stream(seed, f"pedestrians.{index}.sports").integers(len(blueprint.colors)))]
        yield PedestrianSpec(
            blueprint=blueprint.name,
            color=color,
            start=positions.waypoint(int(position_index)),
            max_speed_mps=min(max_speed_mps, blueprint.max_speed_mps or math.inf),
            # Wheelchair users do not cross curbs.
            jaywalks=not blueprint.wheelchair
            and bool(stream(seed, f"pedestrians.{index}.jaywalks").random() < cross_factor),
            visits_plazas=max_speed_mps <= transition_mps(blueprint.size_m[2])
            and bool(stream(seed, f"pedestrians.{index}.plazas").random() < traffic.plaza_probability),
        )


def _cross_factor(traffic: Traffic, seed: int) -> float:
    """Draw the share of the scene's pedestrians that may jaywalk."""
    return sample(traffic.walker_cross_factor, stream(seed, "pedestrians.cross_factor"))


def _draw_blueprint(kind: str, names: tuple[str, ...] | None, rng: np.random.Generator) -> Blueprint:
    """Draw a blueprint of a kind, among these names (None: all), weighted by frequency."""
    blueprints, shares = _frequencies(kind, names)
    return blueprints[int(np.searchsorted(shares, rng.random(), side="right"))]


@cache
def _frequencies(kind: str, names: tuple[str, ...] | None) -> tuple[list[Blueprint], Float64Array]:
    """The blueprints to choose from, and their (B,) cumulative share of all draws."""
    blueprints = [each for each in load_blueprints() if each.kind == kind and (names is None or each.name in names)]
    cumulative = np.cumsum([blueprint.frequency for blueprint in blueprints])
    return blueprints, cumulative / cumulative[-1]
