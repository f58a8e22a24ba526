"""Inertial measurement unit: world state in, specific force, angular rate and orientation out. No ROS.

By REP-145 the accelerometer measures specific force: at rest and level it reads +g along z.
"""

from dataclasses import dataclass

import numpy as np

from simbev_ros.config.positioning import Imu
from simbev_ros.geometry.transforms import quaternion_from_rpy, rpy_from_rotation
from simbev_ros.random import stream
from simbev_ros.scene.state import WorldState, map_from_actors
from simbev_ros.sensors.mount import map_from_sensor, vector
from simbev_ros.types import Float64Array

GRAVITY_MPS2 = 9.81
"""As in CARLA."""

_NS_PER_S = 1e9
_ORIENTATION_VARIANCE_RAD2 = 1e-12
"""The orientation is exact up to float32; a covariance of zeros would mean "unknown"."""


@dataclass(frozen=True, slots=True)
class ImuSample:
    """One measurement, in the sensor frame.

    Attributes:
        linear_acceleration_mps2: (3,) specific force.
        angular_velocity_radps: (3,).
        orientation_xyzw: (4,) unit quaternion, map (east, north, up) from sensor.
        linear_acceleration_covariance: (3, 3) of the noise, (m/s²)².
        angular_velocity_covariance: (3, 3) of the noise, (rad/s)²; the bias is not in it.
        orientation_covariance: (3, 3), rad².
    """

    linear_acceleration_mps2: Float64Array
    angular_velocity_radps: Float64Array
    orientation_xyzw: Float64Array
    linear_acceleration_covariance: Float64Array
    angular_velocity_covariance: Float64Array
    orientation_covariance: Float64Array


def measure_imu(imu: Imu, state: WorldState, previous: WorldState | None, seed: int) -> ImuSample:
    """Measures at the sensor's place, i.e. with the lever arm to the ego's origin.

    Args:
        imu: Its configuration.
        state: The world now.
        previous: The world one tick ago; the change of the angular velocity since then gives the angular acceleration,
            which is taken to be zero at the first tick (None) and matters only off the ego's origin.
        seed: The scene's seed.
    """
    pose = map_from_sensor(imu.pose, state)
    spin = vector(state.ego, "wx wy wz")
    arm_m = pose[:3, 3] - map_from_actors(state.ego)[:3, 3]
    force = vector(state.ego, "ax ay az") + np.array([0.0, 0.0, GRAVITY_MPS2])
    force += np.cross(_angular_acceleration(state, previous), arm_m) + np.cross(spin, np.cross(spin, arm_m))
    rng = stream(seed, f"imu.{imu.name}", state.tick)
    force_sigma, rate_sigma = imu.accelerometer_noise_sigma_mps2, imu.gyroscope_noise_sigma_radps
    force_noise, rate_noise = rng.standard_normal((2, 3)) * [[force_sigma], [rate_sigma]]
    return ImuSample(
        linear_acceleration_mps2=force @ pose[:3, :3] + force_noise,
        angular_velocity_radps=spin @ pose[:3, :3] + imu.gyroscope_bias_radps + rate_noise,
        orientation_xyzw=quaternion_from_rpy(rpy_from_rotation(pose[:3, :3])),
        linear_acceleration_covariance=np.eye(3) * force_sigma**2,
        angular_velocity_covariance=np.eye(3) * rate_sigma**2,
        orientation_covariance=np.eye(3) * _ORIENTATION_VARIANCE_RAD2,
    )


def _angular_acceleration(state: WorldState, previous: WorldState | None) -> Float64Array:
    """(3,) rad/s², map frame."""
    if previous is None:
        return np.zeros(3)
    elapsed_s = (state.stamp_ns - previous.stamp_ns) / _NS_PER_S
    change: Float64Array = vector(state.ego, "wx wy wz") - vector(previous.ego, "wx wy wz")
    return change / elapsed_s
