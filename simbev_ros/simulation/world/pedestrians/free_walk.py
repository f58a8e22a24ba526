"""Free walk: a pedestrian outside SUMO's network walks along lines, tick by tick."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from simbev_ros.foundation.types import Float64Array


@dataclass(slots=True)
class FreeWalker:
    """A pedestrian outside SUMO's network. Its methods yield once per tick.

    Attributes:
        position_m: (3,) map frame, on the carriageway's plane.
        speed_mps: Walking speed.
        reach_m: Distance from its center to its foremost foot.
        tick_s: Length of a tick.
    """

    position_m: Float64Array
    speed_mps: float
    reach_m: float
    tick_s: float

    def walk_to(self, goal_m: Float64Array) -> Iterator[None]:
        """Walk straight to a (3,) position."""
        yield from self.walk_along(np.stack([self.position_m, goal_m]))

    def walk_along(self, line_m: Float64Array) -> Iterator[None]:
        """Walk along a (K, 3) line."""
        station_m = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line_m, axis=0), axis=1))])
        walked_m = 0.0
        while walked_m < station_m[-1]:
            walked_m = min(walked_m + self.speed_mps * self.tick_s, float(station_m[-1]))
            self.position_m = np.array([np.interp(walked_m, station_m, column) for column in line_m.T])
            yield

    def wait(self, duration_s: float) -> Iterator[None]:
        """Stand still for this duration."""
        for _ in range(round(duration_s / self.tick_s)):
            yield
