"""Finds in samples of a graph's resource use what grows after warm-up."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from simbev_ros.foundation.types import Float64Array
from simbev_ros.foundation.units import S_PER_H
from tools.bench.resource_use import ResourceUse

WARM_UP_SHARE = 0.2
"""Share of the samples' time that counts as warm-up, in which everything may grow."""

_MAX_RISE_MIB, _MAX_RISE_SHARE = 16.0, 0.1
"""Memory may rise by the larger of the two: some caches of limited size fill slowly, such as that of contour meshes in
the annotator, to which a vehicle model is added when a camera sees it for the first time.
"""
_MAX_RISE = 2.0
"""Maximum rise of counts."""

MEMORY = "memory_mib"


@dataclass(frozen=True, slots=True)
class Trend:
    """How one quantity develops after warm-up.

    Attributes:
        name: The process or folder.
        quantity: ``memory_mib`` (of files: their size), ``descriptors``, ``threads`` or ``files``.
        start: Value at the end of warm-up.
        end: Last value.
        rise: Rise from ``start`` to ``end`` of a line fitted to all values (Theil 1950, Sen 1968), on which less than
            29 % of outliers have little effect.
        per_h: Slope of the line per hour.
        max_rise: Largest rise that does not count as growth.
    """

    name: str
    quantity: str
    start: float
    end: float
    rise: float
    per_h: float
    max_rise: float

    @property
    def grows(self) -> bool:
        """Whether the rise is too large."""
        return self.rise > self.max_rise


def trends(samples: Sequence[ResourceUse]) -> list[Trend]:
    """The trends of all processes, and of the files in both folders.

    Args:
        samples: At least three of them after warm-up, all of the same processes.
    """
    settled = [sample for sample in samples if sample.time_s >= WARM_UP_SHARE * samples[-1].time_s]
    times_s = np.array([sample.time_s for sample in settled])
    return [_trend(name, quantity, times_s, values) for name, quantity, values in _series(settled)]


def _series(samples: Sequence[ResourceUse]) -> Iterator[tuple[str, str, Float64Array]]:
    """Name, quantity and (N,) values of everything in the samples."""
    for name in samples[0].processes:
        uses = [sample.processes[name] for sample in samples]
        yield name, MEMORY, np.array([use.memory_mib for use in uses])
        yield name, "descriptors", np.array([float(use.descriptors) for use in uses])
        yield name, "threads", np.array([float(use.threads) for use in uses])
    for name, folders in (
        ("/dev/shm", [sample.shared_memory for sample in samples]),
        ("temporary files", [sample.temporary for sample in samples]),
    ):
        yield name, MEMORY, np.array([use.size_mib for use in folders])
        yield name, "files", np.array([float(use.files) for use in folders])


def _trend(name: str, quantity: str, times_s: Float64Array, values: Float64Array) -> Trend:
    per_s = robust_slope(times_s, values)
    start, end = float(values[0]), float(values[-1])
    max_rise = max(_MAX_RISE_MIB, _MAX_RISE_SHARE * start) if quantity == MEMORY else _MAX_RISE
    rise = per_s * float(times_s[-1] - times_s[0])
    return Trend(name, quantity, start, end, rise, per_s * S_PER_H, max_rise)


def robust_slope(times: Float64Array, values: Float64Array) -> float:
    """Median of the slopes between all pairs of (N,) values at (N,) different times (Theil 1950, Sen 1968)."""
    first, second = np.triu_indices(len(times), k=1)
    return float(np.median((values[second] - values[first]) / (times[second] - times[first])))
