"""Wheel odometry model: turns the true motion of the ego into speed, yaw rate and a drifting pose. No ROS.

The rear axle of the simulated vehicles moves along their heading, which is what wheel odometry assumes. Each tick the
wheels measure the distance of the rear axle and the yaw rate sensor the turn about the vehicle's z axis. Both
increments are wrong by a constant factor, the turn also by a drifting bias, and both by white noise. They are
integrated by the midpoint rule, in a plane: the odometry knows no height, roll or pitch. While the wheels stand, so
does the pose.

The covariance of the pose is propagated to first order along the measured path, as in A. Kelly, "Linearized Error
Propagation in Odometry", International Journal of Robotics Research 23(2), 2004. The factors and the bias are states of
the propagation, because an error that lasts for a whole scene grows with the distance, not with its root.
"""

import math
from dataclasses import dataclass

import numpy as np

from simbev_ros.config.odometry import Odometry
from simbev_ros.foundation.random import stream
from simbev_ros.foundation.types import Float64Array
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.schema.scene.state import WorldState, map_from_actors
from simbev_ros.simulation.sensors.mount import vector
from simbev_ros.simulation.sensors.processes import Drift

_STANDING_MPS = 0.001
"""Speed below which the wheels are taken to stand."""
_LATERAL_SIGMA_MPS = 0.01
"""Standard deviation of the rear axle's sideward speed, which is taken to be zero: it stays below 0.02 m/s in traffic,
from the axle's finite steps."""
_MIN_VARIANCE = 1e-9
"""Variance of a value that has no error yet, in the units of the value: filters reject a covariance of zeros."""
_X, _Y, _YAW, _SPEED_SCALE, _YAW_SCALE, _BIAS = range(6)


@dataclass(frozen=True, slots=True)
class PlanarPose:
    """A pose in the plane of the odometry, and its covariance.

    Attributes:
        x_m: Position, in the frame in which the odometry is continuous.
        y_m: Position.
        yaw_rad: Heading, not wrapped.
        covariance: (3, 3) of x, y (m) and yaw (rad), along the axes of that frame.
    """

    x_m: float
    y_m: float
    yaw_rad: float
    covariance: Float64Array


@dataclass(frozen=True, slots=True)
class PlanarTwist:
    """A velocity in the plane of the odometry, and its covariance.

    Attributes:
        forward_mps: Velocity of base_link along its x axis.
        left_mps: Velocity of base_link along its y axis.
        yaw_rate_radps: Yaw rate.
        covariance: (3, 3) of these values.
    """

    forward_mps: float
    left_mps: float
    yaw_rate_radps: float
    covariance: Float64Array


class DeadReckoning:
    """The integrated pose of an odometry through one scene; it starts from zero at tick 0.

    Attributes:
        speed_factor: Measured speed over the true one.
        yaw_factor: Measured yaw rate over the true one.
        bias_radps: Present bias of the yaw rate.
    """

    def __init__(self, odometry: Odometry, seed: int, tick_ns: int, axle_m: float, base_link_x_m: float) -> None:
        """Start a scene.

        Args:
            odometry: Configuration of the odometry.
            seed: Seed of the scene.
            tick_ns: Length of a tick.
            axle_m: Distance from the origin of the ego frame back to the rear axle.
            base_link_x_m: X of the origin of base_link in the ego frame.
        """
        self._odometry, self._seed, self._tick_s = odometry, seed, tick_ns / NS_PER_S
        self._axle_m, self._arm_m = axle_m, base_link_x_m + axle_m
        errors = stream(seed, f"odometry.{odometry.name}.constant").standard_normal(3)
        sigmas = (odometry.speed_scale_sigma, odometry.yaw_rate_scale_sigma, odometry.yaw_rate_bias_sigma_radps)
        self.speed_factor, self.yaw_factor = (1.0 + errors[:2] * sigmas[:2]).tolist()
        self._first_bias_radps = float(errors[2] * sigmas[2])
        self._bias_walk = Drift.random_walk(
            stream(seed, f"odometry.{odometry.name}.bias_walk"),
            odometry.yaw_rate_bias_walk_radps_per_sqrt_s,
            self._tick_s,
        )
        self._rear = np.array([-self._arm_m, 0.0, 0.0])  # x, y, yaw of the rear axle
        self._covariance = np.diag([0.0, 0.0, 0.0, *np.square(sigmas)])
        self._before: tuple[int, Float64Array] | None = None
        self.bias_radps = self._first_bias_radps

    @property
    def yaw_rate_variances(self) -> tuple[float, float]:
        """Variances of the factor of the yaw rate, and of its present bias, (rad/s)²."""
        return float(self._covariance[_YAW_SCALE, _YAW_SCALE]), float(self._covariance[_BIAS, _BIAS])

    @property
    def pose(self) -> PlanarPose:
        """Pose of base_link."""
        x_m, y_m, yaw_rad = self._rear.tolist()
        cos, sin = math.cos(yaw_rad), math.sin(yaw_rad)
        move = np.eye(3)
        move[:2, 2] = -self._arm_m * sin, self._arm_m * cos
        covariance = move @ self._covariance[:3, :3] @ move.T + _MIN_VARIANCE * np.eye(3)
        return PlanarPose(x_m + self._arm_m * cos, y_m + self._arm_m * sin, yaw_rad, covariance)

    def advance_to(self, tick: int, map_from_ego: Float64Array) -> None:
        """Take the true pose of a tick; ticks increase from call to call, and those before 0 move nothing.

        Args:
            tick: The tick; if ticks in between are missing, the motion since the last one counts as one step.
            map_from_ego: (4, 4) pose of the ego frame.
        """
        map_from_rear = map_from_ego.copy()
        map_from_rear[:3, 3] -= self._axle_m * map_from_ego[:3, 0]
        before, self._before = self._before, (tick, map_from_rear)
        if before is None or tick <= 0:
            return
        first_tick, first = max(before[0], 0), before[1]
        self.bias_radps = self._first_bias_radps + float(self._bias_walk.values_until(tick)[0, 0])
        self._covariance[_BIAS, _BIAS] += (
            self._odometry.yaw_rate_bias_walk_radps_per_sqrt_s**2 * (tick - first_tick) * self._tick_s
        )
        turn = first[:3, :3].T @ map_from_rear[:3, :3]
        ahead = first[:3, 0] + map_from_rear[:3, 0]
        distance_m = float((map_from_rear[:3, 3] - first[:3, 3]) @ ahead / np.linalg.norm(ahead))
        self._integrate(tick, (tick - first_tick) * self._tick_s, distance_m, math.atan2(turn[1, 0], turn[0, 0]))

    def _integrate(self, tick: int, step_s: float, distance_m: float, turn_rad: float) -> None:
        if abs(distance_m) < _STANDING_MPS * step_s:
            return
        odometry = self._odometry
        sigma_m = odometry.distance_walk_m_per_sqrt_m * math.sqrt(abs(distance_m))
        sigma_rad = odometry.heading_walk_rad_per_sqrt_s * math.sqrt(step_s)
        noise = stream(self._seed, f"odometry.{odometry.name}.walk", tick).standard_normal(2)
        measured_m = self.speed_factor * distance_m + sigma_m * float(noise[0])
        measured_rad = self.yaw_factor * turn_rad + self.bias_radps * step_s + sigma_rad * float(noise[1])
        middle_rad = float(self._rear[2]) + measured_rad / 2.0
        ahead = np.array([math.cos(middle_rad), math.sin(middle_rad)])
        left = np.array([-ahead[1], ahead[0]])
        self._rear += [*(measured_m * ahead), measured_rad]
        per_m, per_rad = np.zeros(6), np.zeros(6)  # derivatives of the new state by the increments
        per_m[:2] = ahead
        per_rad[:2], per_rad[_YAW] = measured_m / 2.0 * left, 1.0
        step = np.eye(6)
        step[:2, _YAW] = measured_m * left
        step[:, _SPEED_SCALE] += measured_m * per_m
        step[:, _YAW_SCALE] += measured_rad * per_rad
        step[:, _BIAS] += step_s * per_rad
        self._covariance = (
            step @ self._covariance @ step.T
            + sigma_m**2 * np.outer(per_m, per_m)
            + sigma_rad**2 * np.outer(per_rad, per_rad)
        )


class OdometryModel:
    """One wheel odometry through one scene: pose since tick 0, and velocity."""

    def __init__(
        self,
        odometry: Odometry,
        seed: int,
        tick_ns: int,
        period_ticks: int = 1,
        *,
        axle_m: float,
        base_link_x_m: float = 0.0,
    ) -> None:
        """Start a scene; ``DeadReckoning`` describes the arguments, ``period_ticks`` is the time between messages."""
        self._odometry, self._seed, self._period_ticks = odometry, seed, period_ticks
        self._axle_m, self._arm_m = axle_m, base_link_x_m + axle_m
        self._reckoning = DeadReckoning(odometry, seed, tick_ns, axle_m, base_link_x_m)

    def is_due(self, tick: int) -> bool:
        """Whether there is a message at a tick."""
        return tick >= 0 and tick % self._period_ticks == 0

    def advance(self, state: WorldState) -> None:
        """Take the next state, also if no message is due; ticks must increase from call to call."""
        self._reckoning.advance_to(state.tick, map_from_actors(state.ego[None])[0])

    @property
    def pose(self) -> PlanarPose:
        """Pose of base_link since tick 0, at the state that ``advance`` took last."""
        return self._reckoning.pose

    def twist(self, state: WorldState) -> PlanarTwist:
        """Measured velocity of base_link at the state that ``advance`` took last."""
        odometry, reckoning = self._odometry, self._reckoning
        ego_from_map = map_from_actors(state.ego[None])[0, :3, :3].T
        speed_mps = float((ego_from_map @ vector(state.ego, "vx vy vz"))[0])
        rate_radps = float((ego_from_map @ vector(state.ego, "wx wy wz"))[2])
        speed_variance, lateral_variance, rate_variance = (_MIN_VARIANCE,) * 3
        if abs(speed_mps) >= _STANDING_MPS:
            noise = stream(self._seed, f"odometry.{odometry.name}.twist", state.tick).standard_normal(2)
            scale_variance, bias_variance = reckoning.yaw_rate_variances
            speed_mps = reckoning.speed_factor * speed_mps + odometry.speed_noise_sigma_mps * float(noise[0])
            rate_radps = (
                reckoning.yaw_factor * rate_radps
                + reckoning.bias_radps
                + odometry.yaw_rate_noise_sigma_radps * float(noise[1])
            )
            speed_variance += (odometry.speed_scale_sigma * speed_mps) ** 2 + odometry.speed_noise_sigma_mps**2
            lateral_variance += _LATERAL_SIGMA_MPS**2
            rate_variance += scale_variance * rate_radps**2 + bias_variance + odometry.yaw_rate_noise_sigma_radps**2
        else:
            speed_mps = rate_radps = 0.0
            speed_variance = _STANDING_MPS**2
        move = np.eye(3)
        move[1, 2] = self._arm_m
        covariance = move @ np.diag([speed_variance, lateral_variance, rate_variance]) @ move.T
        return PlanarTwist(speed_mps, self._arm_m * rate_radps, rate_radps, covariance)
