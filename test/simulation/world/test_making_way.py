"""Vehicles with emergency lights: others leave their lane and stop before their path, and they pass red lights."""

from functools import cache

import numpy as np
from scene_edits import ego
from world_scenes import blocks, scene

from simbev_ros.schema.scene.spec import SceneSpec, VehicleSpec, WaypointSpec
from simbev_ros.schema.scene.state import WorldState
from simbev_ros.simulation.world.simulation import Simulation

EDGE = "grid.ns2.0.1"  # two lanes, up to a traffic light
POLICE, WALL = 0, (1, 2)


def vehicle(blueprint: str, lane: str, s_m: float, speed_factor: float, **fields: object) -> VehicleSpec:
    start = WaypointSpec(lane=lane, s_m=s_m)
    return VehicleSpec(
        blueprint=blueprint, color=0x336699, start=start, speed_factor=speed_factor, min_gap_m=2.0, **fields
    )


def wall(yields: bool) -> SceneSpec:
    """A police car with lights on behind two slow cars that fill both lanes."""
    vehicles = (
        vehicle("vehicle.police", f"{EDGE}_2", 8.0, 1.2, emergency_lights=True),
        vehicle("vehicle.sedan", f"{EDGE}_2", 22.0, 0.4),
        vehicle("vehicle.sedan", f"{EDGE}_1", 24.0, 0.42),
    )
    base = scene(vehicles=1, pedestrians=0, ticks=360, agents=[ego()])
    return base.model_copy(update={"vehicles": vehicles, "yields_to_emergency": yields})


@cache
def drive(yields: bool) -> tuple[WorldState, ...]:
    spec = wall(yields)
    with Simulation(spec, blocks()) as simulation:
        return tuple(simulation.step() for _ in range(spec.warm_up_ticks + spec.ticks))


def along_m(states: tuple[WorldState, ...]) -> np.ndarray:
    """(T, V) distances along the street."""
    start_m, yaw_rad = blocks().pose_on_lane(f"{EDGE}_1", 0.0)
    rows = np.stack([state.actors[:3] for state in states])
    return (rows["x"] - start_m[0]) * np.cos(yaw_rad) + (rows["y"] - start_m[1]) * np.sin(yaw_rad)


def test_a_slow_vehicle_leaves_the_lane_of_a_police_car_with_lights() -> None:
    position_m = along_m(drive(True))
    stop_line_m = blocks().lanes[f"{EDGE}_1"].length_m
    passes = int(np.argmax(position_m[:, POLICE] > stop_line_m))
    assert passes and position_m[passes, WALL[0]] < position_m[passes, POLICE] - 5.0
    assert not any(state.events for state in drive(True))


def test_without_the_rule_the_wall_stays_in_front_of_it() -> None:
    position_m = along_m(drive(False))
    stop_line_m = blocks().lanes[f"{EDGE}_1"].length_m
    before = position_m[:, POLICE] < stop_line_m
    assert np.all(position_m[before][:, POLICE] < position_m[before][:, WALL[0]])


def test_it_does_not_wait_at_red_lights() -> None:
    speed_mps = np.array([np.hypot(state.actors[POLICE]["vx"], state.actors[POLICE]["vy"]) for state in drive(True)])
    moving = int(np.argmax(speed_mps > 3.0))
    assert speed_mps[moving:].min() > 0.5
