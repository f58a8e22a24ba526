"""The ego driven by an outside node: wanted speed and yaw rate in, the motion of a car that can follow them out."""

import math
from collections.abc import Callable

import numpy as np

from simbev_ros.scene.blueprints import Blueprint
from simbev_ros.types import Float64Array

_PATIENCE_S = 0.5  # without a command for so long, it brakes
_LARGEST_STEER_RAD = 0.6
_STEER_RATE_RADPS = 0.8
_SIDEWAYS_MPS2 = 7.0
_TURN_RADPS = 1.2
_CRAWLING_MPS = 0.5  # below, wheels steer as they would at this speed


class EgoDriver:
    """A kinematic bicycle model with limits of acceleration, steering angle, steering rate and sideways acceleration.

    Attributes:
        front_m: (3,) middle of the front bumper, map frame.
        yaw_rad: Heading.
    """

    def __init__(
        self,
        blueprint: Blueprint,
        front_m: Float64Array,
        direction: Float64Array,
        top_mps: float,
        tick_s: float,
        heights_m: Callable[[Float64Array], Float64Array],
    ) -> None:
        """At rest.

        Args:
            blueprint: The vehicle.
            front_m: (3,) middle of the front bumper, map frame.
            direction: (2,) or (3,) vector in which it looks.
            top_mps: Highest speed.
            tick_s: Time between two calls of ``advance``.
            heights_m: (N,) heights of the road at (N, 3) points, which are near it in height.
        """
        self.front_m = front_m.copy()
        self.yaw_rad = math.atan2(direction[1], direction[0])
        self._blueprint = blueprint
        self._reach_m = (blueprint.size_m[0] + blueprint.wheelbase_m) / 2.0  # from the rear axle to the bumper
        self._top_mps, self._tick_s, self._heights_m = top_mps, tick_s, heights_m
        # Points of traffic have the height of their lane's middle, which is not that of the road below in all places.
        self._above_m = float(front_m[2] - heights_m(front_m[None])[0])
        self._wanted_mps = self._wanted_radps = 0.0
        self._speed_mps = self._steer_rad = 0.0
        self._silent_ticks = 0

    def command(self, speed_mps: float, yaw_rate_radps: float) -> None:
        """What is wanted from the next tick on; backwards it does not drive, and what is no number is left out."""
        if math.isfinite(speed_mps) and math.isfinite(yaw_rate_radps):
            self._wanted_mps, self._wanted_radps = max(speed_mps, 0.0), yaw_rate_radps
            self._silent_ticks = 0

    def advance(self) -> None:
        """Drive for one tick."""
        if self._silent_ticks * self._tick_s >= _PATIENCE_S - 1e-9:
            self._wanted_mps = self._wanted_radps = 0.0
        self._silent_ticks += 1
        tick_s, wheelbase_m = self._tick_s, self._blueprint.wheelbase_m
        gain_mps = min(self._wanted_mps, self._top_mps) - self._speed_mps
        gain_mps = min(max(gain_mps, -self._blueprint.decel * tick_s), self._blueprint.accel * tick_s)
        self._speed_mps += gain_mps
        rolling_mps = max(self._speed_mps, _CRAWLING_MPS)
        most_radps = min(_TURN_RADPS, _SIDEWAYS_MPS2 / rolling_mps)
        steer_rad = math.atan(wheelbase_m * _within(self._wanted_radps, most_radps) / rolling_mps)
        steer_rad = _within(steer_rad, _LARGEST_STEER_RAD)
        self._steer_rad += _within(steer_rad - self._steer_rad, _STEER_RATE_RADPS * tick_s)
        rear_m = self.front_m[:2] - self._reach_m * self._ahead()
        turn_radps = self._speed_mps * math.tan(self._steer_rad) / wheelbase_m
        yaw_rad = self.yaw_rad + _within(turn_radps, most_radps) * tick_s  # tyres slide before they hold more
        middle_rad = (self.yaw_rad + yaw_rad) / 2.0
        rear_m += self._speed_mps * tick_s * np.array([math.cos(middle_rad), math.sin(middle_rad)])
        self.yaw_rad = yaw_rad
        front_m = np.array([*(rear_m + self._reach_m * self._ahead()), self.front_m[2]])
        front_m[2] = self._heights_m(front_m[None])[0] + self._above_m
        self.front_m = front_m

    def _ahead(self) -> Float64Array:
        """(2,) unit vector."""
        return np.array([math.cos(self.yaw_rad), math.sin(self.yaw_rad)])


def _within(value: float, most: float) -> float:
    """The value, but no further from zero than a limit."""
    return min(max(value, -most), most)
