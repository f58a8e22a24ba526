"""Vehicles that outside nodes drive: commands in, the motion of a car that can follow them out."""

import math
from collections.abc import Callable

import numpy as np

from simbev_ros.foundation.types import Float64Array
from simbev_ros.scene.blueprints import Blueprint
from simbev_ros.simulation.world.driving.commands import AckermannCommand, VehicleCommand
from simbev_ros.simulation.world.driving.vehicle_model import Dynamics, VehicleModel, clamp

COMMAND_TIMEOUT_S = 0.5
"""Time without a command after which a vehicle brakes."""
_MAX_REVERSE_MPS = 5.0
_MAX_STEER_RAD = 0.6
_MAX_STEER_RATE_RADPS = 0.8
_MAX_LATERAL_MPS2 = 7.0
_MAX_YAW_RATE_RADPS = 1.2
_MIN_ROLLING_MPS = 0.5  # at lower speeds, the wheels steer as they would at this speed
_HOLDING_MPS, _HOLDING_MPS2 = 0.05, 2.0  # speed below which the brakes hold a vehicle that is to stand, and how firmly


class DrivenVehicle:
    """A vehicle that stands on the road with its front bumper and its rear axle.

    Attributes:
        front_m: (3,) center of the front bumper, map frame.
        axle_m: (3,) center of the rear axle, at the height of the road like ``front_m``.
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
            max_speed_mps: Maximum speed forward.
            tick_s: Time between two ticks.
            heights_m: Function from (N, 3) points, roughly at road height, to the (N,) heights of the road.
        """
        self._rear_to_front_m = (blueprint.size_m[0] + blueprint.wheelbase_m) / 2.0  # from the rear axle to the bumper
        self._max_speed_mps, self._tick_s, self._heights_m = max_speed_mps, tick_s, heights_m
        # SUMO's points have the height of their lane's center line, which may differ from the road surface below.
        self._above_m = float(front_m[2] - heights_m(front_m[None])[0])
        self._ticks_without_command = 0
        self.front_m = front_m.copy()
        yaw_rad = math.atan2(direction[1], direction[0])
        self.axle_m = self._on_road(front_m[:2] - self._rear_to_front_m * _ahead(yaw_rad), front_m[2])
        self._start(blueprint, yaw_rad)

    def _start(self, blueprint: Blueprint, yaw_rad: float) -> None:
        """Prepare the model of the motion of a vehicle that stands with this heading."""
        raise NotImplementedError

    @property
    def _lacks_command(self) -> bool:
        """Whether the latest command is too old."""
        return self._ticks_without_command * self._tick_s >= COMMAND_TIMEOUT_S - 1e-9

    def _on_road(self, xy_m: Float64Array, near_m: float) -> Float64Array:
        """(3,) point at (2,) coordinates, on the road that is roughly at the height ``near_m``."""
        point_m = np.array([*xy_m, near_m])
        point_m[2] = self._heights_m(point_m[None])[0] + self._above_m
        return point_m


class EgoDriver(DrivenVehicle):
    """Kinematic bicycle model with limited acceleration, steering angle, steering rate and lateral acceleration.

    It drives forward and backward, and stops in between.

    Attributes:
        yaw_rad: Heading.
    """

    def _start(self, blueprint: Blueprint, yaw_rad: float) -> None:
        self._blueprint, self.yaw_rad = blueprint, yaw_rad
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
        steer_rad = math.atan(wheelbase_m * clamp(self._desired_radps, max_radps) / rolling_mps)
        steer_rad = clamp(steer_rad, _MAX_STEER_RAD)
        self._steer_rad += clamp(steer_rad - self._steer_rad, _MAX_STEER_RATE_RADPS * tick_s)
        yaw_rate_radps = self._speed_mps * math.tan(self._steer_rad) / wheelbase_m
        yaw_rad = self.yaw_rad + clamp(yaw_rate_radps, max_radps) * tick_s  # the tires cannot hold more
        mean_yaw_rad = (self.yaw_rad + yaw_rad) / 2.0
        step_m = self._speed_mps * tick_s * _ahead(mean_yaw_rad)
        self.yaw_rad = yaw_rad
        axle_m = self.axle_m[:2] + step_m
        self.axle_m = self._on_road(axle_m, self.axle_m[2])
        self.front_m = self._on_road(axle_m + self._rear_to_front_m * _ahead(yaw_rad), self.front_m[2])

    def _change_speed(self) -> None:
        """Accelerate or brake toward the desired speed; between forward and backward, the speed is 0 at one tick."""
        desired_mps = min(max(self._desired_mps, -_MAX_REVERSE_MPS), self._max_speed_mps)
        if desired_mps * self._speed_mps < 0.0:
            desired_mps = 0.0
        accelerates = abs(desired_mps) > abs(self._speed_mps)
        limit_mps2 = self._blueprint.accel if accelerates else self._blueprint.decel
        self._speed_mps += clamp(desired_mps - self._speed_mps, limit_mps2 * self._tick_s)


class CommandedDriver(DrivenVehicle):
    """Drives one vehicle; a trajectory lasts until its end, whatever the age of its command.

    Attributes:
        model: The state of the vehicle.
    """

    def _start(self, blueprint: Blueprint, yaw_rad: float) -> None:
        self._comfortable_mps2 = blueprint.decel
        own = Dynamics.of(blueprint)
        back_m = self._rear_to_front_m - own.rear_m
        x_m, y_m = self.front_m[0] - back_m * math.cos(yaw_rad), self.front_m[1] - back_m * math.sin(yaw_rad)
        self.model = VehicleModel(own, float(x_m), float(y_m), yaw_rad)
        self._place()
        self._command: VehicleCommand | None = None

    def follow(self, command: VehicleCommand) -> None:
        """Follow a command from the next tick on."""
        self._command, self._ticks_without_command = command, 0

    def advance_tick(self, stamp_ns: int, friction: float) -> None:
        """Drive for one tick, which begins at a time, on a road with a friction by that of a dry one."""
        model, command = self.model, self._command
        rise_m, run_m = self.front_m[2] - self.axle_m[2], np.linalg.norm((self.front_m - self.axle_m)[:2])
        slope = float(rise_m / run_m)
        if command is None or (self._lacks_command and isinstance(command, AckermannCommand)):
            command = AckermannCommand(model.steer_rad, 0.0, self._comfortable_mps2)
        self._ticks_without_command += 1
        steer_rad, speed_mps, wanted_mps2 = command.demand(model, stamp_ns, self._tick_s)
        if speed_mps > self._max_speed_mps:
            wanted_mps2 = min(wanted_mps2, 2.0 * (self._max_speed_mps - model.speed_mps))
        moves = abs(model.speed_mps) > _HOLDING_MPS
        reverse = model.speed_mps < 0.0 if moves else speed_mps < 0.0
        drive_mps2 = (wanted_mps2 + model.dynamics.resistance_mps2(model.speed_mps, slope)) * (-1.0 if reverse else 1.0)
        if not moves and abs(speed_mps) < _HOLDING_MPS:
            drive_mps2 = -_HOLDING_MPS2
        model.advance(self._tick_s, steer_rad, drive_mps2, friction, slope, reverse=reverse)
        self._place()

    def _place(self) -> None:
        """Set bumper and axle by the state of the model."""
        model, ahead = self.model, _ahead(self.model.yaw_rad)
        axle_m = np.array([model.x_m, model.y_m]) - model.dynamics.rear_m * ahead
        self.axle_m = self._on_road(axle_m, self.axle_m[2])
        self.front_m = self._on_road(axle_m + self._rear_to_front_m * ahead, self.front_m[2])


def _ahead(yaw_rad: float) -> Float64Array:
    """(2,) unit vector of a heading."""
    return np.array([math.cos(yaw_rad), math.sin(yaw_rad)])
