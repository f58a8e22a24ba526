"""Inertial measurement unit: world states in, specific force, angular rate and orientation out. No ROS.

By REP-145 the accelerometer measures specific force: at rest and level it reads +g along z.
"""

from dataclasses import dataclass

import numpy as np

from simbev_ros.config.positioning import Imu
from simbev_ros.geometry.transforms import quaternion_from_rpy, rpy_from_rotation
from simbev_ros.random import stream
from simbev_ros.scene.spec import NS_PER_S
from simbev_ros.scene.state import WorldState
from simbev_ros.sensors.processes import Drift
from simbev_ros.sensors.tick_motion import motion_within_tick
from simbev_ros.types import Float64Array, Int64Array

GRAVITY_MPS2 = 9.81
"""As in CARLA."""

_LEAST_VARIANCE = 1e-12
"""Of what is exact up to rounding, (m/s²)², (rad/s)² and rad²: a covariance of zeros would mean "unknown"."""


@dataclass(frozen=True, slots=True)
class ImuSamples:
    """S measurements, in the sensor frame.

    Attributes:
        stamps_ns: (S,) ascending.
        linear_acceleration_mps2: (S, 3) specific force.
        angular_velocity_radps: (S, 3).
        orientation_xyzw: (S, 4) unit quaternions, map from sensor.
        linear_acceleration_covariance: (3, 3) of the white noise, (m/s²)².
        angular_velocity_covariance: (3, 3) of the white noise, (rad/s)²; biases are in neither.
        orientation_covariance: (3, 3), rad².
    """

    stamps_ns: Int64Array
    linear_acceleration_mps2: Float64Array
    angular_velocity_radps: Float64Array
    orientation_xyzw: Float64Array
    linear_acceleration_covariance: Float64Array
    angular_velocity_covariance: Float64Array
    orientation_covariance: Float64Array


class ImuModel:
    """One IMU through one scene. It measures at its own place, i.e. with the lever arm to the ego's origin."""

    def __init__(self, imu: Imu, seed: int, tick_ns: int, period_ticks: int = 1, samples: int = 1) -> None:
        """At tick 0.

        Args:
            imu: Its configuration.
            seed: The scene's.
            tick_ns: Length of a tick.
            period_ticks: It measures at every so many ticks,
            samples: and so often per tick; one of both is 1.
        """
        self._imu, self._seed, self._tick_ns = imu, seed, tick_ns
        self._period_ticks, self._samples = period_ticks, samples
        step_s = tick_ns / NS_PER_S * period_ticks / samples
        self._force_walk, self._rate_walk = (
            Drift.random_walk(stream(seed, f"imu.{imu.name}.{name}"), sigma, step_s)
            for name, sigma in (
                ("accelerometer_bias_walk", imu.accelerometer_bias_walk_mps2_per_sqrt_s),
                ("gyroscope_bias_walk", imu.gyroscope_bias_walk_radps_per_sqrt_s),
            )
        )

    def is_due(self, tick: int) -> bool:
        """Whether there is something to measure at a tick."""
        return tick >= 0 and tick % self._period_ticks == 0

    def measure(self, state: WorldState, previous: WorldState | None) -> ImuSamples:
        """The samples since the tick before; at tick 0, where measuring begins, one.

        Args:
            state: The world at a tick that is due; ticks rise from call to call.
            previous: The world one tick ago, None if it is not known.
        """
        imu, count = self._imu, self._samples if state.tick else 1
        motion = motion_within_tick(imu.pose, state, previous, self._tick_ns / NS_PER_S, self._samples)
        map_from_sensor = motion.map_from_sensor[-count:]
        force = motion.acceleration_mps2[-count:] + np.array([0.0, 0.0, GRAVITY_MPS2])
        force_errors, rate_errors = self._errors(state.tick, count)
        return ImuSamples(
            stamps_ns=self._stamps_ns(state, count),
            linear_acceleration_mps2=np.einsum("sji,sj->si", map_from_sensor, force) + force_errors,
            angular_velocity_radps=motion.angular_velocity_radps[-count:] + rate_errors,
            orientation_xyzw=quaternion_from_rpy(rpy_from_rotation(map_from_sensor)),
            linear_acceleration_covariance=_covariance(imu.accelerometer_noise_sigma_mps2),
            angular_velocity_covariance=_covariance(imu.gyroscope_noise_sigma_radps),
            orientation_covariance=_covariance(0.0),
        )

    def _stamps_ns(self, state: WorldState, count: int) -> Int64Array:
        """(count,) whole nanoseconds, counted from tick 0."""
        last = state.tick * self._samples
        since_ns = np.arange(last - count + 1, last + 1, dtype=np.int64) * self._tick_ns // self._samples
        return state.stamp_ns - state.tick * self._tick_ns + since_ns

    def _errors(self, tick: int, count: int) -> tuple[Float64Array, Float64Array]:
        """(count, 3) of specific force and of angular rate: constant bias, its walk, white noise."""
        imu = self._imu
        rng = stream(self._seed, f"imu.{imu.name}", tick)
        force_noise, rate_noise = np.moveaxis(rng.standard_normal((self._samples, 2, 3))[-count:], 1, 0)
        index = tick // self._period_ticks * self._samples
        force_bias = self._force_walk.until(index, count) + np.array(imu.accelerometer_bias_mps2)
        rate_bias = self._rate_walk.until(index, count) + np.array(imu.gyroscope_bias_radps)
        return (
            force_bias + imu.accelerometer_noise_sigma_mps2 * force_noise,
            rate_bias + imu.gyroscope_noise_sigma_radps * rate_noise,
        )


def _covariance(sigma: float) -> Float64Array:
    """(3, 3) of equal and independent components."""
    return np.eye(3) * max(sigma**2, _LEAST_VARIANCE)
