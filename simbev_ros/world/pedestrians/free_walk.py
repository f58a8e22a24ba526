"""Somebody off SUMO's net, who walks along lines, tick by tick."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from simbev_ros.types import Float64Array


@dataclass(slots=True)
class Stroller:
    """Somebody off the net.

    Attributes:
        position_m: (3,) map frame, on the carriageway's plane.
        speed_mps: At which it walks.
        reach_m: From its middle to its foremost foot.
        tick_s: Length of a tick.
    """

    position_m: Float64Array
    speed_mps: float
    reach_m: float
    tick_s: float

    def go(self, goal_m: Float64Array) -> Iterator[None]:
        """Walk straight to a (3,) place."""
        yield from self.follow(np.stack([self.position_m, goal_m]))

    def follow(self, line_m: Float64Array) -> Iterator[None]:
        """Walk along a (K, 3) line."""
        station_m = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line_m, axis=0), axis=1))])
        walked_m = 0.0
        while walked_m < station_m[-1]:
            walked_m = min(walked_m + self.speed_mps * self.tick_s, float(station_m[-1]))
            self.position_m = np.array([np.interp(walked_m, station_m, column) for column in line_m.T])
            yield

    def stand(self, duration_s: float) -> Iterator[None]:
        """Stay for a while."""
        for _ in range(round(duration_s / self.tick_s)):
            yield
