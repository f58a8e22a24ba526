"""Draw scenes: configuration and map in, a complete ``SceneSpec`` out. All randomness of a scene starts here."""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple, TypedDict

from simbev_ros.config.draw import sample
from simbev_ros.config.scenario import SPLITS, Scenario, Split, Timing
from simbev_ros.foundation.errors import foreign_content
from simbev_ros.foundation.geometry.geodesy import MapDatum
from simbev_ros.foundation.random import stream
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.scene.drawing.chosen_maps import maps_of
from simbev_ros.scene.drawing.draw_agents import draw_agents
from simbev_ros.scene.drawing.draw_drive import draw_drive
from simbev_ros.scene.drawing.draw_events import draw_events
from simbev_ros.scene.drawing.draw_lights import draw_appearance, draw_lights
from simbev_ros.scene.drawing.draw_v2x import draw_v2x
from simbev_ros.scene.drawing.draw_weather import draw_season, draw_weathers, fog_fills_heights
from simbev_ros.scene.drawing.scene_drawer import SceneDrawer
from simbev_ros.scene.drawing.start_clearance import StartClearance
from simbev_ros.scene.drawing.starts import StartPositions
from simbev_ros.schema.scene.map_spec import MapSpec
from simbev_ros.schema.scene.spec import DatumSpec, SceneSpec
from simbev_ros.schema.scene.storyboard_spec import StoryboardSpec
from simbev_ros.schema.scene.weather import Weather

SEEDS_PER_DRAW = 1 << 32
"""Distance between the seeds of two draws of a scene; more than the largest seed and number together."""
_CLEARED_S = 30.0  # time after which wrecks are removed in a drive


class PlannedScene(NamedTuple):
    """A scene that the configuration asks for.

    ``draw`` counts its draws before this one, which were not accepted. ``seed`` replaces the one that follows from the
    configuration's seed and the number. ``scenario`` is the OpenSCENARIO file that the scene plays, or empty.
    """

    number: int
    map: MapSpec
    split: Split
    draw: int = 0
    seed: int | None = None
    scenario: str = ""


def planned_scenes(scenario: Scenario) -> Iterator[PlannedScene]:
    """Yield the scenes that the configuration asks for, numbered from 0 in the order of the file.

    Raises:
        InputError: There is no such map.
    """
    number = 0
    for entry, chosen in zip(scenario.scenes, maps_of(scenario), strict=True):
        for split in SPLITS:
            for _ in range(getattr(entry, split)):
                yield PlannedScene(number, chosen, split, scenario=entry.scenario)
                number += 1


def draw_scene(
    scenario: Scenario, planned: PlannedScene, network: RoadNetwork, starts: StartPositions | None = None
) -> SceneSpec:
    """Draw one scene.

    Args:
        scenario: The configuration.
        planned: What is drawn.
        network: The roads of ``planned.map``.
        starts: ``start_positions`` of this configuration and network, to be shared between scenes; None: compute it.

    Raises:
        InputError: An agent cannot be drawn; see ``draw_agents``.
    """
    first_seed = scenario.seed + planned.number if planned.seed is None else planned.seed
    seed = first_seed + planned.draw * SEEDS_PER_DRAW
    starts = start_positions(scenario, network) if starts is None else starts
    scenario, storyboard = _cast(scenario, planned, network)
    ticks, warm_up_ticks = duration_ticks(scenario.time, seed), round(scenario.time.warm_up_s / scenario.time.tick_s)
    duration_s = (warm_up_ticks + ticks) * scenario.time.tick_s
    agents, drive = draw_drive(scenario, seed, network, draw_agents(scenario, seed, network, starts, duration_s))
    clearance = StartClearance(network, agents.vehicles)
    weather, final_weather = _draw_weathers(scenario, seed, planned.map, network, storyboard)
    drawer = SceneDrawer(scenario, seed, network, starts, duration_s, agents, weather)
    hazards = drawer.draw_hazards()
    vehicles = *agents.vehicles, *drawer.draw_vehicles(hazards, clearance)
    pedestrians = tuple(drawer.draw_pedestrians(clearance))
    if drive is not None:
        events = draw_events(scenario, seed, network, drive.route, vehicles, pedestrians, clearance, hazards.hazards)
        drive = drive.model_copy(update={"events": events.events})
        vehicles, pedestrians = (*vehicles, *events.vehicles), (*pedestrians, *events.pedestrians)
    return SceneSpec(
        number=planned.number,
        split=planned.split,
        seed=seed,
        map=planned.map.model_copy(update={"season": draw_season(scenario.weather, seed, network.datum)}),
        tick_ns=scenario.time.tick_ns,
        warm_up_ticks=warm_up_ticks,
        ticks=ticks,
        end_after_standing_ticks=_standing_ticks(scenario),
        weather=weather,
        final_weather=final_weather,
        lights=draw_lights(scenario.lights, seed),
        appearance=draw_appearance(scenario.appearance, seed),
        agents=agents.specs,
        v2x=draw_v2x(scenario, seed, [agent.name for agent in agents.specs]),
        vehicles=(*vehicles, *hazards.vehicles),
        pedestrians=pedestrians,
        walker_cross_factor=drawer.draw_cross_factor(),
        pedestrian_standing_share=scenario.traffic.pedestrian_standing_share,
        parked_density=sample(scenario.traffic.parked.density, stream(seed, "parked.density")),
        resting_share=scenario.traffic.resting_share,
        **_manners(scenario),
        hazards=hazards.hazards,
        drive=drive,
        storyboard=storyboard,
        datum=datum_spec(network.datum),
        green_time_s=_green_times_s(scenario, seed, starts),
    )


def _green_times_s(scenario: Scenario, seed: int, starts: StartPositions) -> tuple[float, ...]:
    """The green time of each signal program; one where there are no signals."""
    programs = starts.signal_programs or ("",)
    return tuple(sample(scenario.traffic.green_time_s, stream(seed, f"signals.{each}.green")) for each in programs)


def _cast(scenario: Scenario, planned: PlannedScene, network: RoadNetwork) -> tuple[Scenario, StoryboardSpec | None]:
    """The configuration and the storyboard of a scene that plays a scenario; None: it plays none."""
    if not planned.scenario:
        return scenario, None
    from simbev_ros.scene.drawing.draw_storyboard import cast_scenario  # what few scenes need

    with foreign_content(planned.scenario):
        return cast_scenario(scenario, Path(planned.scenario), planned.number, network)


def _draw_weathers(
    scenario: Scenario, seed: int, chosen: MapSpec, network: RoadNetwork, storyboard: StoryboardSpec | None
) -> tuple[Weather, Weather | None]:
    """Weather at the start and at the end, of which a storyboard may prescribe the first."""
    even_fog = fog_fills_heights(chosen, network)
    weather, final_weather = draw_weathers(scenario.weather, seed, even_fog=even_fog, datum=network.datum)
    if storyboard is not None:
        from simbev_ros.scene.drawing.draw_storyboard import first_weather

        weather = weather.model_copy(update=first_weather(storyboard, network.datum))
    return weather, final_weather


class _Manners(TypedDict):
    """Fields of a scene that say how traffic deals with emergencies and accidents."""

    yields_to_emergency: bool
    wrecks_cleared_s: float | None


def _manners(scenario: Scenario) -> _Manners:
    """How traffic deals with emergencies and accidents; what the configuration leaves open depends on the drive."""
    traffic, drives = scenario.traffic, scenario.drive is not None
    return _Manners(
        yields_to_emergency=drives if traffic.yield_to_emergency is None else traffic.yield_to_emergency,
        wrecks_cleared_s=_CLEARED_S if traffic.wrecks_cleared_s is None and drives else traffic.wrecks_cleared_s,
    )


def datum_spec(datum: MapDatum) -> DatumSpec:
    """A map's position on Earth, as it is stored in a scene."""
    return DatumSpec(
        latitude_deg=datum.latitude_deg,
        longitude_deg=datum.longitude_deg,
        altitude_m=datum.altitude_m,
        map_from_east_rad=datum.map_from_east_rad,
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
