"""The motion of a place on the ego within one tick, for sensors that measure more often than the world moves.

The world tells poses at ticks, and their central differences as velocities, accelerations and rates (``world.motion``).
So at tick k the pose of tick k + 1 is known too. Between two ticks

* the place moves along the uniform cubic B-spline whose control points are its positions at the four ticks around. Its
  acceleration is linear in time and at the ticks the second difference of the positions, its velocity there the central
  one. It passes the positions at a distance of h² a / 6 (h: a tick, a: acceleration), 2 mm at 5 m/s² and 20 Hz, which
  does not add up. A curve through them with the same velocities would swing back and forth within every tick;
* the orientation follows a cubic on SO(3), R₀ exp(θ(t)), from the one attitude and rate exactly to the other: a tilt of
  a hundredth of a degree would be 0.2 m after 16 s under gravity.

The trapezoidal rule, with which strapdown integration begins, then finds the way back from samples to attitude,
velocity and position.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from simbev_ros.config.sensor import Pose
from simbev_ros.geometry.transforms import rotations_from_rpy
from simbev_ros.scene.state import WorldState
from simbev_ros.sensors.mount import vector
from simbev_ros.types import Float64Array


@dataclass(frozen=True, slots=True)
class TickMotion:
    """The motion at S moments at equal distances, the last of which is the tick.

    Attributes:
        map_from_sensor: (S, 3, 3) rotations.
        acceleration_mps2: (S, 3) of the sensor's place, map frame.
        angular_velocity_radps: (S, 3) sensor frame.
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
    """The motion after 1, 2, … S equal parts of the tick that ends with a state.

    Args:
        pose: Of the sensor on the ego.
        state: The world now.
        previous: The world one tick ago. If it is not known (None, or an older one in a graph that dropped ticks), the
            ego is taken to have moved with the acceleration and the rates that it has now.
        tick_s: Length of a tick.
        samples: S.
    """
    now = _ego(state)
    if previous is not None and previous.tick == state.tick - 1:
        before = _ego(previous)
    else:
        before = now._replace(rpy_rad=now.rpy_rad - tick_s * now.rpy_rates_radps)
    share = np.arange(1, samples + 1)[:, None] / samples
    map_from_ego, rates = _turning(before, now, tick_s, share)
    ego_from_sensor = pose.ego_from_sensor
    first, last = _arm_accelerations(before, now, tick_s, ego_from_sensor[:3, 3])
    first, last = before.acceleration_mps2 + first, now.acceleration_mps2 + last
    return TickMotion(
        map_from_ego @ ego_from_sensor[:3, :3],
        first + share * (last - first),
        rates @ ego_from_sensor[:3, :3],
    )


def _ego(state: WorldState) -> _Ego:
    rpy_rad, spin = vector(state.ego, "roll pitch yaw"), vector(state.ego, "wx wy wz")
    return _Ego(rpy_rad, _rpy_rates(rpy_rad, spin), spin, vector(state.ego, "ax ay az"))


def _rpy_rates(rpy_rad: Float64Array, spin: Float64Array) -> Float64Array:
    """(3,) rates of roll, pitch, yaw (Rz Ry Rx) of an angular velocity in the parent frame; pitch is not ±90°."""
    _, pitch, yaw = rpy_rad
    ahead = np.cos(yaw) * spin[0] + np.sin(yaw) * spin[1]
    aside = np.cos(yaw) * spin[1] - np.sin(yaw) * spin[0]
    return np.array([ahead / np.cos(pitch), aside, spin[2] + np.tan(pitch) * ahead])


def _turning(before: _Ego, now: _Ego, tick_s: float, share: Float64Array) -> tuple[Float64Array, Float64Array]:
    """(S, 3, 3) map from ego and (S, 3) angular velocity in the ego frame, after (S, 1) shares of a tick."""
    start, end = rotations_from_rpy(np.stack([before.rpy_rad, now.rpy_rad]))
    first, last = before.angular_velocity_radps @ start, now.angular_velocity_radps @ end
    turn = Rotation.from_matrix(start.T @ end).as_rotvec()
    mean = turn / tick_s
    last_slope = last + np.cross(turn, last) / 2.0 + np.cross(turn, np.cross(turn, last)) / 12.0
    bulge = mean - (first + last_slope) / 2.0
    angle = tick_s * (
        first * (share - share**2 / 2.0) + last_slope * share**2 / 2.0 + bulge * (3.0 * share**2 - 2.0 * share**3)
    )
    slope = first + share * (last_slope - first) + 6.0 * share * (1.0 - share) * bulge
    rates = slope - np.cross(angle, slope) / 2.0 + np.cross(angle, np.cross(angle, slope)) / 6.0
    # By the trapezoidal rule the integral of a quadratic lacks 1/12 of its second derivative times the step squared.
    rates += share[0] ** 2 * (mean - (first + last) / 2.0)
    return start @ Rotation.from_rotvec(angle).as_matrix(), rates


def _arm_accelerations(
    before: _Ego, now: _Ego, tick_s: float, arm_m: Float64Array
) -> tuple[Float64Array, Float64Array]:
    """(3,) acceleration relative to the ego's origin, map frame, of a place in the ego frame, at both ends of a tick.

    They are second differences, of which the outer attitudes follow from the rates at both ends.
    """
    ahead_rad = before.rpy_rad + 2.0 * tick_s * now.rpy_rates_radps
    behind_rad = now.rpy_rad - 2.0 * tick_s * before.rpy_rates_radps
    rpy_rad = np.stack([behind_rad, before.rpy_rad, now.rpy_rad, ahead_rad])
    first, last = np.diff(rotations_from_rpy(rpy_rad) @ arm_m, n=2, axis=0) / tick_s**2
    return first, last
