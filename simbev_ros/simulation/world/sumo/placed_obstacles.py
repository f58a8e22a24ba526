"""Vehicles without drivers that commands place on SUMO's roads, so that traffic brakes for them and passes them."""

from collections.abc import Mapping

import numpy as np

from simbev_ros.foundation.errors import SimulationError
from simbev_ros.foundation.types import Float64Array
from simbev_ros.simulation.world.sumo.given_motion import NO_CHECKS
from simbev_ros.simulation.world.sumo.libsumo_import import FAILURES, libsumo

_NAME = "e"  # a number follows
_DEFAULT_TYPE = "DEFAULT_VEHTYPE"
_ON_OR_OFF_ROAD = 2  # mode of moveToXY


Obstacle = tuple[tuple[float, float, float], Float64Array, Float64Array]
"""Length, width and height of something on a road; its (2+,) center, map frame; its heading as (2+,) unit vector."""


class PlacedObstacles:
    """The obstacles on SUMO's roads.

    Attributes:
        placed: Their numbers.
    """

    def __init__(self) -> None:
        self.placed: set[int] = set()
        self._typed: set[int] = set()  # SUMO keeps the types of those that have left the roads

    def place(self, obstacles: Mapping[int, Obstacle]) -> None:
        """Place all obstacles, by number, at the next step; other ones are taken off the roads.

        Raises:
            SimulationError: SUMO failed.
        """
        try:
            for number in sorted(self.placed - obstacles.keys()):
                self.placed.remove(number)
                libsumo.vehicle.remove(f"{_NAME}{number}")
            for number, obstacle in obstacles.items():
                self._place_one(number, obstacle)
        except FAILURES as error:
            raise SimulationError(f"SUMO failed: {error}") from error

    def _place_one(self, number: int, obstacle: Obstacle) -> None:
        name, ((length_m, width_m, height_m), center_m, forward) = f"{_NAME}{number}", obstacle
        if number not in self.placed:
            self.placed.add(number)
            if number not in self._typed:
                self._typed.add(number)
                libsumo.vehicletype.copy(_DEFAULT_TYPE, name)
                libsumo.vehicletype.setVehicleClass(name, "passenger")  # SUMO crashes if it takes walking areas, too
                libsumo.vehicletype.setMinGap(name, 0.0)
                libsumo.vehicletype.setLength(name, length_m)
                libsumo.vehicletype.setWidth(name, width_m)
                libsumo.vehicletype.setHeight(name, height_m)
            libsumo.vehicle.add(name, "", name)
            libsumo.vehicle.setSpeedMode(name, NO_CHECKS)
            libsumo.vehicle.setLaneChangeMode(name, 0)
        x_m, y_m = (center_m[:2] + forward[:2] * length_m / 2.0).tolist()  # SUMO's is the front
        angle_deg = np.degrees(np.arctan2(forward[0], forward[1]))
        libsumo.vehicle.moveToXY(name, "", -1, x_m, y_m, angle_deg, keepRoute=_ON_OR_OFF_ROAD)
