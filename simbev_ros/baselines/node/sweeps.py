"""Keeps the lidar's sweeps with the ego's poses, so that a frame can have earlier ones."""

from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from simbev_ros.baselines.frames import sweeps_of_frame
from simbev_ros.foundation.types import Float32Array, Float64Array, Table

_MARGIN_NS = 250_000_000
"""Time for which a sweep is kept after the oldest age that is asked for."""


class Sweep(NamedTuple):
    """A sweep of the lidar.

    Attributes:
        stamp_ns: Its stamp.
        points_ego: (N, 3) points, m, in the ego frame of its stamp.
        map_from_ego: (4, 4) pose of the ego.
    """

    stamp_ns: int
    points_ego: Float32Array
    map_from_ego: Float64Array


class SweepMemory:
    """The sweeps of the last moments, in the order of their stamps.

    Args:
        ages_ns: Ages of the sweeps of a frame, ascending.
    """

    def __init__(self, ages_ns: Sequence[int]) -> None:
        self._ages_ns = ages_ns
        self._sweeps: deque[Sweep] = deque()

    def add(self, sweep: Sweep) -> None:
        """Add a sweep, which is later than all others; if time has gone back, these are forgotten."""
        if self._sweeps and sweep.stamp_ns <= self._sweeps[-1].stamp_ns:
            self._sweeps.clear()
        while self._sweeps and self._sweeps[0].stamp_ns < sweep.stamp_ns - self._ages_ns[-1] - _MARGIN_NS:
            self._sweeps.popleft()
        self._sweeps.append(sweep)

    def of_frame(self, stamp_ns: int) -> list[Sweep | None]:
        """The sweeps of a frame, newest first; None: there is none of that age."""
        sweeps = list(self._sweeps)
        stamps_ns = np.array([sweep.stamp_ns for sweep in sweeps], np.int64)
        indices = sweeps_of_frame(stamp_ns, stamps_ns, self._ages_ns)
        return [sweeps[index] if index >= 0 else None for index in indices]


def points_in_ego(cloud: Table, ego_from_lidar: Float64Array) -> Float32Array:
    """(N, 3) points, ego frame, of the rows of a cloud whose x, y and z (m, lidar frame) are finite.

    Raises:
        ValueError: The cloud has no such columns.
    """
    points = np.empty((len(cloud), 3), np.float32)
    for column, name in enumerate("xyz"):
        points[:, column] = cloud[name]
    finite = np.isfinite(points).all(axis=1)
    if not finite.all():
        points = points[finite]
    rotation, origin = ego_from_lidar[:3, :3].astype(np.float32), ego_from_lidar[:3, 3].astype(np.float32)
    return points @ rotation.T + origin
