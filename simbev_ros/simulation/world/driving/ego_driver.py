"""Ego driver for an outside node: desired speed and yaw rate in, the motion of a car that can follow them out."""

import math

import numpy as np

from simbev_ros.foundation.types import Float64Array
from simbev_ros.scene.blueprints import Blueprint
from simbev_ros.simulation.world.driving.driven_vehicle import DrivenVehicle

_MAX_REVERSE_MPS = 5.0
_MAX_STEER_RAD = 0.6
_MAX_STEER_RATE_RADPS = 0.8
_MAX_LATERAL_MPS2 = 7.0
_MAX_YAW_RATE_RADPS = 1.2
_MIN_ROLLING_MPS = 0.5  # at lower speeds, the wheels steer as they would at this speed


class EgoDriver(DrivenVehicle):
    """Kinematic bicycle model with limited acceleration, steering angle, steering rate and lateral acceleration.

    It drives forward and backward, and stops in between.

    Attributes:
        yaw_rad: Heading.
    """

    def _start(self, blueprint: Blueprint, direction: Float64Array) -> None:
        self._blueprint, self.yaw_rad = blueprint, math.atan2(direction[1], direction[0])
        self.axle_m = self._on_road(self.front_m[:2] - self._rear_to_front_m * self._ahead(), self.front_m[2])
        self._desired_mps = self._desired_radps = 0.0
        self._speed_mps = self._steer_rad = 0.0

    def set_command(self, speed_mps: float, yaw_rate_radps: float) -> None:
        """Set the desired motion from the next tick on; negative speeds go backward, non-finite values are ignored."""
        if math.isfinite(speed_mps) and math.isfinite(yaw_rate_radps):
            self._desired_mps, self._desired_radps = speed_mps, yaw_rate_radps
            self._ticks_without_command = 0

    def advance_tick(self) -> None:
        """Drive for one tick."""
        if self._lacks_command:
            self._desired_mps = self._desired_radps = 0.0
        self._ticks_without_command += 1
        self._change_speed()
        tick_s, wheelbase_m = self._tick_s, self._blueprint.wheelbase_m
        rolling_mps = max(abs(self._speed_mps), _MIN_ROLLING_MPS)
        max_radps = min(_MAX_YAW_RATE_RADPS, _MAX_LATERAL_MPS2 / rolling_mps)
        rolling_mps = math.copysign(rolling_mps, self._speed_mps or self._desired_mps)  # at rest: before it moves off
        steer_rad = math.atan(wheelbase_m * _clamp(self._desired_radps, max_radps) / rolling_mps)
        steer_rad = _clamp(steer_rad, _MAX_STEER_RAD)
        self._steer_rad += _clamp(steer_rad - self._steer_rad, _MAX_STEER_RATE_RADPS * tick_s)
        yaw_rate_radps = self._speed_mps * math.tan(self._steer_rad) / wheelbase_m
        yaw_rad = self.yaw_rad + _clamp(yaw_rate_radps, max_radps) * tick_s  # the tires cannot hold more
        mean_yaw_rad = (self.yaw_rad + yaw_rad) / 2.0
        step_m = self._speed_mps * tick_s * np.array([math.cos(mean_yaw_rad), math.sin(mean_yaw_rad)])
        self.yaw_rad = yaw_rad
        axle_m = self.axle_m[:2] + step_m
        self.axle_m = self._on_road(axle_m, self.axle_m[2])
        self.front_m = self._on_road(axle_m + self._rear_to_front_m * self._ahead(), self.front_m[2])

    def _change_speed(self) -> None:
        """Accelerate or brake toward the desired speed; between forward and backward, the speed is 0 at one tick."""
        desired_mps = min(max(self._desired_mps, -_MAX_REVERSE_MPS), self._max_speed_mps)
        if desired_mps * self._speed_mps < 0.0:
            desired_mps = 0.0
        accelerates = abs(desired_mps) > abs(self._speed_mps)
        limit_mps2 = self._blueprint.accel if accelerates else self._blueprint.decel
        self._speed_mps += _clamp(desired_mps - self._speed_mps, limit_mps2 * self._tick_s)

    def _ahead(self) -> Float64Array:
        """(2,) unit vector of the heading."""
        return np.array([math.cos(self.yaw_rad), math.sin(self.yaw_rad)])


def _clamp(value: float, limit: float) -> float:
    """The value, limited to ``limit`` in magnitude."""
    return min(max(value, -limit), limit)
