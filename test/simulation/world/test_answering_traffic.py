"""Traffic and pedestrians answer to an ego that is driven from outside."""

import numpy as np
import pytest
from scene_edits import ego
from world_scenes import TICK_S, blocks, scene

from simbev_ros.schema.scene.spec import VehicleSpec, WaypointSpec
from simbev_ros.schema.scene.state import EGO_ID
from simbev_ros.simulation.world.simulation import Simulation


def car(lane: str, s_m: float, **fields: object) -> VehicleSpec:
    start = WaypointSpec(lane=lane, s_m=s_m)
    return VehicleSpec(
        blueprint="vehicle.sedan", color=0x336699, start=start, speed_factor=1.0, min_gap_m=2.0, **fields
    )


@pytest.mark.parametrize("yaw_rate_radps", [0.0, 0.3, -0.3])
def test_others_expect_a_driven_vehicle_to_go_on_along_its_curve(yaw_rate_radps: float) -> None:
    spec = scene(vehicles=1, pedestrians=0, agents=[ego(driver="twist")])
    with Simulation(spec, blocks()) as simulation:
        for _ in range(120):
            simulation.drive_vehicle(0, 5.0, yaw_rate_radps)
            simulation.step()
        expected_m = simulation._sumo.ahead_m(np.array([0]), np.array([[8.0]]), np.zeros((1, 1)))[0, 0]
        speed_mps = np.hypot(1.0, yaw_rate_radps * 3.77 / 5.0) * 5.0  # of the front, which is ahead of the axle
        fronts_m = []
        for _ in range(round(8.0 / speed_mps / TICK_S) + 2):
            simulation.drive_vehicle(0, 5.0, yaw_rate_radps)
            simulation.step()
            fronts_m.append(simulation._outside_drivers._drivers[0].front_m)
    assert np.linalg.norm(np.array(fronts_m)[:, :2] - expected_m[:2], axis=1).min() < 0.2


def test_a_vehicle_brakes_behind_an_ego_that_brakes_hard() -> None:
    spec = scene(vehicles=1, pedestrians=0, ticks=300, agents=[ego(driver="twist")])
    spec = spec.model_copy(update={"vehicles": (car("grid.ring.8_1", 40.0), car("grid.ring.8_1", 20.0))})
    gap_m = []
    with Simulation(spec, blocks()) as simulation:
        for step in range(spec.warm_up_ticks + spec.ticks):
            heading = simulation._sumo.direction(0)
            yaw_rad = np.arctan2(*heading[::-1])
            lane = blocks().nearest_lane(simulation._population.sample().front_m[:1], np.array([yaw_rad]))
            turn_rad = np.remainder(lane.yaw_rad[0] - yaw_rad + np.pi, 2.0 * np.pi) - np.pi
            simulation.drive_vehicle(0, 9.0 if step < 160 else 0.0, float(turn_rad) * 2.0)
            state = simulation.step()
            assert not state.events
            rows = state.actors[:2]
            gap_m.append(np.hypot(rows["x"][0] - rows["x"][1], rows["y"][0] - rows["y"][1]) - rows["length"][0])
    assert np.hypot(rows["vx"], rows["vy"]).max() < 0.1 and 0.5 < gap_m[-1] < 6.0


@pytest.mark.slow
def test_crossing_traffic_does_not_run_into_an_ego_that_stands_in_a_junction() -> None:
    spec = scene(vehicles=24, pedestrians=16, ticks=500, agents=[ego(driver="twist")], seed=4)
    start = car("grid.ns2.0.0_1", 60.0)
    spec = spec.model_copy(update={"vehicles": (start, *spec.vehicles[1:])})
    with Simulation(spec, blocks()) as simulation:
        for step in range(spec.warm_up_ticks + spec.ticks):
            simulation.drive_vehicle(0, 6.0 if 40 <= step < 110 else 0.0, 0.0)
            state = simulation.step()
            assert not any(EGO_ID in event.ids for event in state.events)
