"""Ego driver for an outside node: desired speed and yaw rate in, the motion of a car that can follow them out."""

import math
from collections.abc import Callable

import numpy as np

from simbev_ros.foundation.types import Float64Array
from simbev_ros.scene.blueprints import Blueprint

_COMMAND_TIMEOUT_S = 0.5  # without a command for this long, the ego brakes
_MAX_STEER_RAD = 0.6
_MAX_STEER_RATE_RADPS = 0.8
_MAX_LATERAL_MPS2 = 7.0
_MAX_YAW_RATE_RADPS = 1.2
_MIN_ROLLING_MPS = 0.5  # at lower speeds, the wheels steer as they would at this speed


class EgoDriver:
    """Kinematic bicycle model with limited acceleration, steering angle, steering rate and lateral acceleration.

    Attributes:
        front_m: (3,) center of the front bumper, map frame.
        yaw_rad: Heading.
    """

    def __init__(
        self,
        blueprint: Blueprint,
        front_m: Float64Array,
        direction: Float64Array,
        max_speed_mps: float,
        tick_s: float,
        heights_m: Callable[[Float64Array], Float64Array],
    ) -> None:
        """Start at rest.

        Args:
            blueprint: The vehicle.
            front_m: (3,) center of the front bumper, map frame.
            direction: (2,) or (3,) vector of its heading.
            max_speed_mps: Maximum speed.
            tick_s: Time between two calls of ``advance_tick``.
            heights_m: Function from (N, 3) points, roughly at road height, to the (N,) heights of the road.
        """
        self.front_m = front_m.copy()
        self.yaw_rad = math.atan2(direction[1], direction[0])
        self._blueprint = blueprint
        self._rear_to_front_m = (blueprint.size_m[0] + blueprint.wheelbase_m) / 2.0  # from the rear axle to the bumper
        self._max_speed_mps, self._tick_s, self._heights_m = max_speed_mps, tick_s, heights_m
        # SUMO's points have the height of their lane's center line, which may differ from the road surface below.
        self._above_m = float(front_m[2] - heights_m(front_m[None])[0])
        self._desired_mps = self._desired_radps = 0.0
        self._speed_mps = self._steer_rad = 0.0
        self._ticks_without_command = 0

    def set_command(self, speed_mps: float, yaw_rate_radps: float) -> None:
        """Set the desired motion from the next tick on; negative speeds count as 0, non-finite values are ignored."""
        if math.isfinite(speed_mps) and math.isfinite(yaw_rate_radps):
            self._desired_mps, self._desired_radps = max(speed_mps, 0.0), yaw_rate_radps
            self._ticks_without_command = 0

    def advance_tick(self) -> None:
        """Drive for one tick."""
        if self._ticks_without_command * self._tick_s >= _COMMAND_TIMEOUT_S - 1e-9:
            self._desired_mps = self._desired_radps = 0.0
        self._ticks_without_command += 1
        tick_s, wheelbase_m = self._tick_s, self._blueprint.wheelbase_m
        speed_change_mps = min(self._desired_mps, self._max_speed_mps) - self._speed_mps
        speed_change_mps = min(max(speed_change_mps, -self._blueprint.decel * tick_s), self._blueprint.accel * tick_s)
        self._speed_mps += speed_change_mps
        rolling_mps = max(self._speed_mps, _MIN_ROLLING_MPS)
        max_radps = min(_MAX_YAW_RATE_RADPS, _MAX_LATERAL_MPS2 / rolling_mps)
        steer_rad = math.atan(wheelbase_m * _clamp(self._desired_radps, max_radps) / rolling_mps)
        steer_rad = _clamp(steer_rad, _MAX_STEER_RAD)
        self._steer_rad += _clamp(steer_rad - self._steer_rad, _MAX_STEER_RATE_RADPS * tick_s)
        rear_m = self.front_m[:2] - self._rear_to_front_m * self._ahead()
        yaw_rate_radps = self._speed_mps * math.tan(self._steer_rad) / wheelbase_m
        yaw_rad = self.yaw_rad + _clamp(yaw_rate_radps, max_radps) * tick_s  # the tires cannot hold more
        mean_yaw_rad = (self.yaw_rad + yaw_rad) / 2.0
        rear_m += self._speed_mps * tick_s * np.array([math.cos(mean_yaw_rad), math.sin(mean_yaw_rad)])
        self.yaw_rad = yaw_rad
        front_m = np.array([*(rear_m + self._rear_to_front_m * self._ahead()), self.front_m[2]])
        front_m[2] = self._heights_m(front_m[None])[0] + self._above_m
        self.front_m = front_m

    def _ahead(self) -> Float64Array:
        """(2,) unit vector of the heading."""
        return np.array([math.cos(self.yaw_rad), math.sin(self.yaw_rad)])


def _clamp(value: float, limit: float) -> float:
    """The value, limited to ``limit`` in magnitude."""
    return min(max(value, -limit), limit)
