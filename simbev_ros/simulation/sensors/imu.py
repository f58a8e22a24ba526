"""IMU model: turns the world states of two ticks into specific force, angular rate and orientation. No ROS.

As REP-145 demands, the accelerometer measures specific force: at rest and level it reads +g along z.
"""

from dataclasses import dataclass

import numpy as np

from simbev_ros.config.positioning import Imu
from simbev_ros.foundation.geometry.transforms import (
    quaternion_from_rpy,
    rotations_from_rpy,
    rpy_from_rotation,
    with_signs_of,
)
from simbev_ros.foundation.random import stream
from simbev_ros.foundation.types import Float64Array, Int64Array
from simbev_ros.foundation.units import GRAVITY_MPS2, NS_PER_S
from simbev_ros.schema.scene.state import WorldState
from simbev_ros.simulation.sensors.attitude import MIN_VARIANCE, AttitudeErrors
from simbev_ros.simulation.sensors.processes import Drift
from simbev_ros.simulation.sensors.tick_motion import motion_within_tick

_IDENTITY_XYZW = np.array([0.0, 0.0, 0.0, 1.0])


@dataclass(frozen=True, slots=True)
class ImuSamples:
    """Batch of S IMU measurements, in the sensor frame.

    Attributes:
        stamps_ns: (S,) time stamps, ascending.
        linear_acceleration_mps2: (S, 3) specific force.
        angular_velocity_radps: (S, 3) angular velocity.
        orientation_xyzw: (S, 4) unit quaternions, from the sensor to east, north, up; continuous throughout a scene.
        linear_acceleration_covariance: (3, 3) covariance of the white noise, (m/s²)².
        angular_velocity_covariance: (3, 3) of the white noise, (rad/s)². Neither covariance includes the biases.
        orientation_covariance: (3, 3) of the orientation about east, north and up, rad². In contrast to the
            others it includes the slowly changing errors.
    """

    stamps_ns: Int64Array
    linear_acceleration_mps2: Float64Array
    angular_velocity_radps: Float64Array
    orientation_xyzw: Float64Array
    linear_acceleration_covariance: Float64Array
    angular_velocity_covariance: Float64Array
    orientation_covariance: Float64Array


class ImuModel:
    """An IMU that measures throughout one scene, at its mounting position (with the lever arm to the ego's origin)."""

    def __init__(
        self,
        imu: Imu,
        seed: int,
        tick_ns: int,
        period_ticks: int = 1,
        samples: int = 1,
        map_from_east_rad: float = 0.0,
    ) -> None:
        """Create the IMU at tick 0.

        Args:
            imu: Configuration of the IMU.
            seed: Seed of the scene.
            tick_ns: Length of a tick.
            period_ticks: Number of ticks between measurements; 1 if there are several samples per tick.
            samples: Number of samples per tick; 1 if there are several ticks between measurements.
            map_from_east_rad: Direction of the map's x axis, counterclockwise from east.
        """
        self._east_from_map = rotations_from_rpy(np.array([0.0, 0.0, map_from_east_rad])) if map_from_east_rad else None
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

        self._orientation_xyzw = _IDENTITY_XYZW
        self._attitude = None if imu.orientation is None else AttitudeErrors(imu.name, imu.orientation, seed, step_s)

    def is_due(self, tick: int) -> bool:
        """Whether the IMU measures at a tick."""
        return tick >= 0 and tick % self._period_ticks == 0

    def measure(self, state: WorldState, previous: WorldState | None) -> ImuSamples:
        """Measure all samples since the previous tick; at tick 0, where measuring begins, there is one.

        Args:
            state: World state at a tick that is due; ticks must increase from call to call.
            previous: World state one tick ago; None if unknown.
        """
        imu, count = self._imu, self._samples if state.tick else 1
        motion = motion_within_tick(imu.pose, state, previous, self._tick_ns / NS_PER_S, self._samples)
        map_from_sensor = motion.map_from_sensor[-count:]
        force = motion.acceleration_mps2[-count:] + np.array([0.0, 0.0, GRAVITY_MPS2])
        force_errors, rate_errors = self._errors(state.tick, count)
        orientation_xyzw = with_signs_of(
            quaternion_from_rpy(rpy_from_rotation(self._in_east(self._measured_attitude(state.tick, map_from_sensor)))),
            self._orientation_xyzw if state.tick else _IDENTITY_XYZW,
        )
        self._orientation_xyzw = orientation_xyzw[-1]
        return ImuSamples(
            stamps_ns=self._stamps_ns(state, count),
            linear_acceleration_mps2=np.einsum("sji,sj->si", map_from_sensor, force) + force_errors,
            angular_velocity_radps=motion.angular_velocity_radps[-count:] + rate_errors,
            orientation_xyzw=orientation_xyzw,
            linear_acceleration_covariance=_covariance(imu.accelerometer_noise_sigma_mps2),
            angular_velocity_covariance=_covariance(imu.gyroscope_noise_sigma_radps),
            orientation_covariance=_covariance(0.0) if self._attitude is None else self._attitude.covariance,
        )

    def _stamps_ns(self, state: WorldState, count: int) -> Int64Array:
        """(count,) time stamps, at equal steps since tick 0 rounded down to whole nanoseconds."""
        last = state.tick * self._samples
        since_ns = np.arange(last - count + 1, last + 1, dtype=np.int64) * self._tick_ns // self._samples
        return state.stamp_ns - state.tick * self._tick_ns + since_ns

    def _measured_attitude(self, tick: int, map_from_sensor: Float64Array) -> Float64Array:
        """(S, 3, 3) rotations with their errors."""
        if self._attitude is None:
            return map_from_sensor
        index = tick // self._period_ticks * self._samples
        errors_rad = self._attitude.errors_until(tick, index, self._samples)[-len(map_from_sensor) :]
        return rotations_from_rpy(errors_rad) @ map_from_sensor

    def _in_east(self, map_from_sensor: Float64Array) -> Float64Array:
        """(S, 3, 3) rotations to axes of which x points east, as REP-103 and REP-145 demand."""
        return map_from_sensor if self._east_from_map is None else self._east_from_map @ map_from_sensor

    def _errors(self, tick: int, count: int) -> tuple[Float64Array, Float64Array]:
        """(count, 3) errors of specific force and of angular rate: constant bias, bias walk and white noise."""
        imu = self._imu
        rng = stream(self._seed, f"imu.{imu.name}", tick)
        force_noise, rate_noise = np.moveaxis(rng.standard_normal((self._samples, 2, 3))[-count:], 1, 0)
        index = tick // self._period_ticks * self._samples
        force_bias = self._force_walk.values_until(index, count) + np.array(imu.accelerometer_bias_mps2)
        rate_bias = self._rate_walk.values_until(index, count) + np.array(imu.gyroscope_bias_radps)
        return (
            force_bias + imu.accelerometer_noise_sigma_mps2 * force_noise,
            rate_bias + imu.gyroscope_noise_sigma_radps * rate_noise,
        )


def _covariance(sigma: float) -> Float64Array:
    """(3, 3) covariance of equal and independent components."""
    return np.eye(3) * max(sigma**2, MIN_VARIANCE)
