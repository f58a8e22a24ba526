"""Driver of a vehicle that follows stamped commands of an outside node with the dynamic vehicle model."""

import math

import numpy as np

from simbev_ros.foundation.types import Float64Array
from simbev_ros.scene.blueprints import Blueprint
from simbev_ros.simulation.world.driving.commands import AckermannCommand, VehicleCommand
from simbev_ros.simulation.world.driving.driven_vehicle import DrivenVehicle
from simbev_ros.simulation.world.driving.vehicle_model import Dynamics, VehicleModel

_HOLDING_MPS, _HOLDING_MPS2 = 0.05, 2.0  # speed below which the brakes hold a vehicle that is to stand, and how firmly


class CommandedDriver(DrivenVehicle):
    """Drives one vehicle; a trajectory lasts until its end, whatever the age of its command.

    Attributes:
        model: The state of the vehicle.
    """

    def _start(self, blueprint: Blueprint, direction: Float64Array) -> None:
        self._comfortable_mps2 = blueprint.decel
        yaw_rad = math.atan2(direction[1], direction[0])
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
        model, ahead = self.model, np.array([math.cos(self.model.yaw_rad), math.sin(self.model.yaw_rad)])
        axle_m = np.array([model.x_m, model.y_m]) - model.dynamics.rear_m * ahead
        self.axle_m = self._on_road(axle_m, self.axle_m[2])
        self.front_m = self._on_road(axle_m + self._rear_to_front_m * ahead, self.front_m[2])
