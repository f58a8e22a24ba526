"""Motion of a point on the ego within one tick, for sensors with a higher rate than the simulation (the IMU).

World states hold poses at ticks, and central differences of the poses as velocities, accelerations and rates
(``simulation.world.motion``), so that the state of tick k also determines the pose of tick k + 1. Between two ticks

* the point moves along the uniform cubic B-spline whose control points are its positions at the four nearest ticks. At
  a tick, its acceleration is the second difference of the positions and its velocity the central difference; in
  between, the acceleration is linear in time. The spline misses the positions by h² a / 6 (h: tick length, a:
  acceleration), 2 mm at 5 m/s² and 20 Hz, which does not accumulate. A curve through the positions with the same
  velocities would oscillate within every tick;
* the orientation follows a cubic on SO(3), R₀ exp(θ(t)), exactly from one attitude and rate to the next: under gravity,
  a tilt error of a hundredth of a degree would become 0.2 m after 16 s.

A strapdown integration by the trapezoidal rule thus recovers attitude, velocity and position from the samples.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from simbev_ros.config.sensor import Pose
from simbev_ros.foundation.geometry.transforms import rotations_from_rpy
from simbev_ros.foundation.types import Float64Array
from simbev_ros.schema.scene.state import WorldState
from simbev_ros.simulation.sensors.mount import vector


@dataclass(frozen=True, slots=True)
class TickMotion:
    """Motion of the sensor at S equally spaced times, the last of which is the tick.

    Attributes:
        map_from_sensor: (S, 3, 3) rotations.
        acceleration_mps2: (S, 3) acceleration of the sensor's origin, map frame.
        angular_velocity_radps: (S, 3) angular velocity, sensor frame.
    """

    map_from_sensor: Float64Array
    acceleration_mps2: Float64Array
    angular_velocity_radps: Float64Array


class _Ego(NamedTuple):
    """The ego at one tick; (3,) each, map frame."""

    rpy_rad: Float64Array
    rpy_rates_radps: Float64Array
    angular_velocity_radps: Float64Array
    acceleration_mps2: Float64Array


def motion_within_tick(
    pose: Pose, state: WorldState, previous: WorldState | None, tick_s: float, samples: int = 1
) -> TickMotion:
    """Motion of a sensor at S equally spaced times within the tick that ends with a state.

    Args:
        pose: Mounting pose of the sensor on the ego.
        state: World state now.
        previous: World state one tick ago. If it is unknown (None, or an older one in a graph that dropped ticks), the
            ego is assumed to have moved with its present acceleration and rates.
        tick_s: Length of a tick.
        samples: Number S of times.
    """
    now = _ego(state)
    if previous is not None and previous.tick == state.tick - 1:
        before = _ego(previous)
    else:
        before = now._replace(rpy_rad=now.rpy_rad - tick_s * now.rpy_rates_radps)
    fraction = np.arange(1, samples + 1)[:, None] / samples
    map_from_ego, rates = _interpolate_attitude(before, now, tick_s, fraction)
    ego_from_sensor = pose.ego_from_sensor
    first, last = _arm_accelerations(before, now, tick_s, ego_from_sensor[:3, 3])
    first, last = before.acceleration_mps2 + first, now.acceleration_mps2 + last
    return TickMotion(
        map_from_ego @ ego_from_sensor[:3, :3],
        first + fraction * (last - first),
        rates @ ego_from_sensor[:3, :3],
    )


def _ego(state: WorldState) -> _Ego:
    rpy_rad, spin = vector(state.ego, "roll pitch yaw"), vector(state.ego, "wx wy wz")
    return _Ego(rpy_rad, _rpy_rates(rpy_rad, spin), spin, vector(state.ego, "ax ay az"))


def _rpy_rates(rpy_rad: Float64Array, spin: Float64Array) -> Float64Array:
    """(3,) rates of roll, pitch, yaw (Rz Ry Rx) for an angular velocity in the parent frame; pitch is not ±90°."""
    _, pitch, yaw = rpy_rad
    ahead = np.cos(yaw) * spin[0] + np.sin(yaw) * spin[1]
    sideward = np.cos(yaw) * spin[1] - np.sin(yaw) * spin[0]
    return np.array([ahead / np.cos(pitch), sideward, spin[2] + np.tan(pitch) * ahead])


def _interpolate_attitude(
    before: _Ego, now: _Ego, tick_s: float, fraction: Float64Array
) -> tuple[Float64Array, Float64Array]:
    """(S, 3, 3) map from ego and (S, 3) angular velocity in the ego frame, at (S, 1) fractions of a tick."""
    start, end = rotations_from_rpy(np.stack([before.rpy_rad, now.rpy_rad]))
    first, last = before.angular_velocity_radps @ start, now.angular_velocity_radps @ end
    turn = Rotation.from_matrix(start.T @ end).as_rotvec()
    mean = turn / tick_s
    last_slope = last + np.cross(turn, last) / 2.0 + np.cross(turn, np.cross(turn, last)) / 12.0
    bulge = mean - (first + last_slope) / 2.0
    angle = tick_s * (
        first * (fraction - fraction**2 / 2.0)
        + last_slope * fraction**2 / 2.0
        + bulge * (3.0 * fraction**2 - 2.0 * fraction**3)
    )
    slope = first + fraction * (last_slope - first) + 6.0 * fraction * (1.0 - fraction) * bulge
    rates = slope - np.cross(angle, slope) / 2.0 + np.cross(angle, np.cross(angle, slope)) / 6.0
    # Corrects the trapezoidal rule: its error for a quadratic is 1/12 of its second derivative times step².
    rates += fraction[0] ** 2 * (mean - (first + last) / 2.0)
    return start @ Rotation.from_rotvec(angle).as_matrix(), rates


def _arm_accelerations(
    before: _Ego, now: _Ego, tick_s: float, arm_m: Float64Array
) -> tuple[Float64Array, Float64Array]:
    """(3,) accelerations of a point of the ego relative to the ego's origin, map frame, at both ends of a tick.

    They are second differences of positions; the rates at both ends extrapolate the outer two attitudes.
    """
    ahead_rad = before.rpy_rad + 2.0 * tick_s * now.rpy_rates_radps
    behind_rad = now.rpy_rad - 2.0 * tick_s * before.rpy_rates_radps
    rpy_rad = np.stack([behind_rad, before.rpy_rad, now.rpy_rad, ahead_rad])
    first, last = np.diff(rotations_from_rpy(rpy_rad) @ arm_m, n=2, axis=0) / tick_s**2
    return first, last
