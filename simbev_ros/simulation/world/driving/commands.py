"""Commands of outside nodes to vehicles, and the controllers that turn them into steering and acceleration."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from simbev_ros.foundation.types import Float64Array, Int64Array
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.simulation.world.driving.vehicle_model import VehicleModel

_SPEED_GAIN = 2.0  # 1/s
_DISTANCE_GAIN = 0.5  # 1/s
_BANDWIDTH_RADPS, _DAMPING = 1.5, 1.0  # of the motion beside the planned path
_MIN_SPEED_MPS = 2.0  # at lower speeds, gains are those at this speed
_PREVIEW_S = 0.15  # time that the wheels need
_BEHIND_M, _AHEAD_M = 30.0, 15.0  # part of the plan around its present place in which the vehicle is looked for


class Demand(NamedTuple):
    """What a controller wants of a vehicle: angle of the front wheels, speed, and acceleration toward it."""

    steer_rad: float
    speed_mps: float
    acceleration_mps2: float


@dataclass(frozen=True, slots=True)
class AckermannCommand:
    """Desired steering and speed, as in ackermann_msgs/AckermannDrive.

    Attributes:
        steer_rad: Angle of the front wheels, left positive.
        speed_mps: Speed, negative in reverse.
        acceleration_mps2: Maximum acceleration toward this speed; 0: that of the vehicle.
        steer_rate_radps: Maximum rate of the front wheels; 0: that of the vehicle.
    """

    steer_rad: float
    speed_mps: float
    acceleration_mps2: float = 0.0
    steer_rate_radps: float = 0.0

    def __post_init__(self) -> None:
        """Refuse numbers that are not finite, and negative limits."""
        values = self.steer_rad, self.speed_mps, self.acceleration_mps2, self.steer_rate_radps
        if not all(map(math.isfinite, values)):
            raise ValueError("a command must have finite numbers; the vehicle keeps its last valid command")
        if self.acceleration_mps2 < 0.0 or self.steer_rate_radps < 0.0:
            raise ValueError("acceleration and steering_angle_velocity are limits; they must be 0 or more")

    def demand(self, model: VehicleModel, stamp_ns: int, step_s: float) -> Demand:
        """The demand at a time, of which the next one follows after ``step_s``."""
        limit_mps2, limit_rad = self.acceleration_mps2 or math.inf, (self.steer_rate_radps or math.inf) * step_s
        turn_rad = min(max(self.steer_rad - model.steer_rad, -limit_rad), limit_rad)
        wanted_mps2 = _SPEED_GAIN * (self.speed_mps - model.speed_mps)
        return Demand(model.steer_rad + turn_rad, self.speed_mps, min(max(wanted_mps2, -limit_mps2), limit_mps2))


@dataclass(frozen=True, slots=True)
class TrajectoryCommand:
    """A planned motion forward, which holds until its last pose; there the vehicle stops.

    Steering is the feedback of the rear axle by Samson (Paden et al., "A Survey of Motion Planning and Control
    Techniques for Self-Driving Urban Vehicles", 2016, section V-A3), with gains for the same bandwidth at all speeds,
    and with what a steady curve needs by the understeer gradient. Speed follows that of the plan, and the distance
    between the vehicle and its place in the plan at this time.

    Attributes:
        stamp_ns: (N,) times of the poses, ascending.
        points_m: (N, 2) positions of the rear axle, map frame.
    """

    stamp_ns: Int64Array
    points_m: Float64Array

    @classmethod
    def of(cls, stamp_ns: Sequence[int], points_m: Sequence[tuple[float, float]]) -> "TrajectoryCommand":
        """Make a command of N poses.

        Raises:
            ValueError: There are fewer than two, or their numbers or times are impossible.
        """
        if len(stamp_ns) < 2:
            raise ValueError("a trajectory needs at least 2 poses; the vehicle keeps its last valid one")
        if not np.isfinite(points_m).all():
            raise ValueError("a trajectory must have finite numbers; the vehicle keeps its last valid one")
        if (np.diff(stamp_ns) <= 0).any():
            raise ValueError("the times of a trajectory must ascend; the vehicle keeps its last valid one")
        return cls(np.array(stamp_ns, np.int64), np.array(points_m, np.float64))

    def demand(self, model: VehicleModel, stamp_ns: int, step_s: float) -> Demand:
        """The demand at a time."""
        own, cosine, sine = model.dynamics, math.cos(model.yaw_rad), math.sin(model.yaw_rad)
        rear_m = np.array([model.x_m - own.rear_m * cosine, model.y_m - own.rear_m * sine])
        station_m = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(self.points_m, axis=0), axis=1))])
        times_s = (self.stamp_ns - stamp_ns) / NS_PER_S
        planned_m = np.interp([0.0, step_s, 2.0 * step_s], times_s, station_m)
        speeds_mps = np.diff(planned_m) / step_s
        if station_m[-1] < 0.1:  # a plan to stand
            return Demand(model.steer_rad, 0.0, _SPEED_GAIN * -model.speed_mps)
        along_m, offset_m = self._nearest(rear_m, station_m, float(planned_m[0]))
        speed_mps = float(speeds_mps[0] + _DISTANCE_GAIN * (planned_m[0] - along_m)) if times_s[-1] > 0.0 else 0.0
        speed_mps = max(speed_mps, 0.0)
        forward_mps2 = (speeds_mps[1] - speeds_mps[0]) / step_s if times_s[-1] > 2.0 * step_s else 0.0
        acceleration_mps2 = float(forward_mps2) + _SPEED_GAIN * (speed_mps - model.speed_mps)
        return Demand(self._steer_rad(model, station_m, along_m, offset_m), speed_mps, acceleration_mps2)

    def _nearest(self, point_m: Float64Array, station_m: Float64Array, near_m: float) -> tuple[float, Float64Array]:
        """Distance along the plan of the place nearest to a point, and the (2,) vector from there to the point."""
        step_m, from_m = np.diff(self.points_m, axis=0), point_m - self.points_m[:-1]
        share = np.einsum("ni,ni->n", from_m, step_m) / np.maximum(np.einsum("ni,ni->n", step_m, step_m), 1e-12)
        share = np.clip(share, 0.0, 1.0)
        distance_m = np.linalg.norm(from_m - share[:, None] * step_m, axis=1)
        distance_m[(station_m[1:] < near_m - _BEHIND_M) | (station_m[:-1] > near_m + _AHEAD_M)] = np.inf
        row = int(np.argmin(distance_m))
        return float(station_m[row] + share[row] * (station_m[row + 1] - station_m[row])), (
            from_m[row] - share[row] * step_m[row]
        )

    def _steer_rad(self, model: VehicleModel, station_m: Float64Array, along_m: float, offset_m: Float64Array) -> float:
        speed_mps = max(model.speed_mps, 0.0)
        step_m = np.diff(self.points_m, axis=0)
        long = np.flatnonzero(np.linalg.norm(step_m, axis=1) > 1e-3)
        yaws_rad = np.unwrap(np.arctan2(step_m[long, 1], step_m[long, 0]))
        middles_m = (station_m[long] + station_m[long + 1]) / 2.0
        ahead_m = along_m + _PREVIEW_S * speed_mps
        yaw_rad, *around_rad = np.interp([along_m, ahead_m - 0.5, ahead_m + 0.5], middles_m, yaws_rad).tolist()
        curvature_pm = around_rad[1] - around_rad[0]
        left_m = float(-math.sin(yaw_rad) * offset_m[0] + math.cos(yaw_rad) * offset_m[1])
        turned_rad = math.remainder(model.yaw_rad - yaw_rad, math.tau)
        gain_pm = _BANDWIDTH_RADPS / max(speed_mps, _MIN_SPEED_MPS)
        curvature_pm -= 2.0 * _DAMPING * gain_pm * turned_rad + gain_pm**2 * left_m * math.sin(turned_rad + 1e-9) / (
            turned_rad + 1e-9
        )
        own = model.dynamics
        return math.atan(own.wheelbase_m * curvature_pm) + own.understeer_s2pm * speed_mps**2 * curvature_pm


@dataclass(frozen=True, slots=True)
class IndicatorsCommand:
    """Indicators that are to be on until the next command."""

    left: bool
    right: bool


VehicleCommand = AckermannCommand | TrajectoryCommand
"""What a vehicle moves by."""
DriverCommand = VehicleCommand | IndicatorsCommand
"""What its driver sends."""
