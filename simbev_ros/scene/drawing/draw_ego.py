"""Draw the ego of a scene: its start, on the listed poses or anywhere on the map, its color and its driver."""

import numpy as np

from simbev_ros.config.scenario import Scenario
from simbev_ros.errors import InputError
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.random import stream
from simbev_ros.scene.blueprints import load_blueprints
from simbev_ros.scene.drawing.drivers import draw_driver, draw_vehicle
from simbev_ros.scene.drawing.spawn import draw_spawn
from simbev_ros.scene.drawing.starts import StartPositions
from simbev_ros.scene.spec import VehicleSpec
from simbev_ros.types import Float64Array


def draw_ego(
    scenario: Scenario, seed: int, network: RoadNetwork, starts: StartPositions, duration_s: float
) -> tuple[VehicleSpec, Float64Array]:
    """Draw the ego.

    Args:
        scenario: The configuration.
        seed: Seed of the scene.
        network: Roads of the scene's map.
        starts: Positions on them where actors can start.
        duration_s: Duration of the scene with its warm-up.

    Returns:
        The ego, and its (3,) start, map frame.

    Raises:
        InputError: Its blueprint is unknown or has no lane to drive on, or one of its poses is off the lanes.
    """
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
    return draw_vehicle(scenario.traffic, blueprint, start, stream(seed, "ego.style"), probability, driver), position_m
