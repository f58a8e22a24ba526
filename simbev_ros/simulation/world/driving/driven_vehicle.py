"""What drivers of outside nodes have in common: where their vehicle stands on the road, and how old its command is."""

from collections.abc import Callable

import numpy as np

from simbev_ros.foundation.types import Float64Array
from simbev_ros.scene.blueprints import Blueprint

COMMAND_TIMEOUT_S = 0.5
"""Time without a command after which a vehicle brakes."""


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
        ahead = np.array(direction[:2]) / np.hypot(*direction[:2])
        self.axle_m = self._on_road(front_m[:2] - self._rear_to_front_m * ahead, front_m[2])
        self._start(blueprint, direction)

    def _start(self, blueprint: Blueprint, direction: Float64Array) -> None:
        """Prepare the model of the motion, at rest; the arguments are those of the constructor."""
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
