"""Strapdown integration of IMU samples from simulated traffic ends at the vehicle's pose."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from simbev_ros.config.load import load_scenario
from simbev_ros.config.positioning import Imu
from simbev_ros.config.sensor import Pose
from simbev_ros.foundation.geometry.transforms import rotations_from_rpy
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.build import load_network
from simbev_ros.scene.drawing.draw_scene import draw_scene, planned_scenes
from simbev_ros.schema.scene.state import WorldState
from simbev_ros.simulation.sensors.imu import ImuModel
from simbev_ros.simulation.sensors.mount import map_from_sensor, vector
from simbev_ros.simulation.world.simulation import Simulation

TICK_S = 0.05
CORNER = Pose(x_m=1.5, y_m=0.6, z_m=1.0, roll_deg=180.0, yaw_deg=-40.0)
GRAVITY = np.array([0.0, 0.0, 9.81])
MAX_ERROR_PER_PATH = 1e-3


@pytest.fixture(scope="module")
def states() -> list[WorldState]:
    """World states of tick -1 and of the 321 ticks from tick 0 on: 16 s."""
    scenario = load_scenario("demo")
    traffic = scenario.traffic.model_copy(update={"vehicles": 20, "pedestrians": 0})
    time = scenario.time.model_copy(update={"duration_s": 16.05})
    scenario = scenario.model_copy(update={"traffic": traffic, "time": time})
    planned = next(planned_scenes(scenario))
    network = load_network(planned.map)
    spec = draw_scene(scenario, planned, network)
    with Simulation(spec, network) as simulation:
        return [simulation.step() for _ in range(spec.warm_up_ticks + spec.ticks)][spec.warm_up_ticks - 1 :]


def integrate(
    force: Float64Array, rate: Float64Array, step_s: float, start: Float64Array, velocity: Float64Array
) -> Float64Array:
    """(4, 4) pose after (N, 3) samples in the sensor frame, integrated from a (4, 4) pose by the trapezoidal rule."""
    rotation, position = Rotation.from_matrix(start[:3, :3]), start[:3, 3]
    acceleration = rotation.apply(force[0]) - GRAVITY
    for index in range(1, len(force)):
        rotation = rotation * Rotation.from_rotvec(step_s * (rate[index - 1] + rate[index]) / 2)
        latest = rotation.apply(force[index]) - GRAVITY
        faster = velocity + step_s * (acceleration + latest) / 2
        position = position + step_s * (velocity + faster) / 2
        acceleration, velocity = latest, faster
    end = np.eye(4)
    end[:3, :3], end[:3, 3] = rotation.as_matrix(), position
    return end


def integration_errors(states: Sequence[WorldState], samples: int, pose: Pose) -> tuple[float, float, float]:
    """Path length of an IMU on the ego in m, and errors of the integrated pose in m and degrees."""
    imu = Imu(
        type="imu",
        name="imu",
        pose=pose,
        accelerometer_noise_sigma_mps2=0,
        gyroscope_noise_sigma_radps=0,
        gyroscope_bias_radps=0,
    )
    model = ImuModel(imu, 0, round(TICK_S * 1e9), samples=samples)
    measured = [model.measure(now, before) for before, now in pairwise(states)]
    force = np.concatenate([each.linear_acceleration_mps2 for each in measured])
    rate = np.concatenate([each.angular_velocity_radps for each in measured])
    poses = np.array([map_from_sensor(pose, state) for state in states[1:]])
    ego = states[1].ego
    arm_m = rotations_from_rpy(vector(ego, "roll pitch yaw")) @ pose.ego_from_sensor[:3, 3]
    velocity = vector(ego, "vx vy vz") + np.cross(vector(ego, "wx wy wz"), arm_m)
    end = integrate(force, rate, TICK_S / samples, poses[0], velocity)
    path_m = np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1).sum()
    turn_rad = Rotation.from_matrix(end[:3, :3].T @ poses[-1, :3, :3]).magnitude()
    return float(path_m), float(np.linalg.norm(end[:3, 3] - poses[-1, :3, 3])), float(np.degrees(turn_rad))


@pytest.mark.slow
@pytest.mark.parametrize("pose", [Pose(), CORNER], ids=["origin", "corner"])
@pytest.mark.parametrize(("samples", "max_error_per_path"), [(1, MAX_ERROR_PER_PATH), (5, MAX_ERROR_PER_PATH / 10)])
def test_integration_ends_at_the_pose_of_the_vehicle(
    states: list[WorldState], pose: Pose, samples: int, max_error_per_path: float
) -> None:
    actors = states[0].actors
    vehicles = actors["id"][np.isin(actors["tag"], [Tag.CAR, Tag.TRUCK, Tag.BUS, Tag.MOTORCYCLE, Tag.BICYCLE])]
    driven = 0
    for vehicle in vehicles[:6]:
        path_m, error_m, error_deg = integration_errors(
            [replace(state, ego_id=int(vehicle)) for state in states], samples, pose
        )
        if path_m > 20.0:  # 16 s of gravity along an axis that is 0.001° off are 2 cm
            driven += 1
            assert error_m < max_error_per_path * path_m, f"actor {vehicle} after {path_m:.0f} m"
            assert error_deg < 0.02 / samples
    assert driven >= 3


@pytest.mark.slow
def test_integration_does_not_drift_for_a_stationary_tilted_vehicle(states: list[WorldState]) -> None:
    actors = states[0].actors.copy()
    for name in ("vx", "vy", "vz", "ax", "ay", "az", "wx", "wy", "wz"):
        actors[name] = 0
    standing = [replace(state, actors=actors) for state in states]
    assert actors["roll"][0] != 0
    _, error_m, error_deg = integration_errors(standing, 5, CORNER)
    assert error_m < 1e-9 and error_deg < 1e-9
