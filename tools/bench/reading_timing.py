"""Times the reading and decoding of frames of a recorded scene, in order and at random."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import numpy as np

from simbev_ros.dataset import Scene, open_dataset
from simbev_ros.foundation.errors import InputError


@dataclass(frozen=True, slots=True)
class AccessTiming:
    """Wall time and processor time of all threads per frame, for one order of frames."""

    order: str
    median_s: float
    least_s: float
    cpu_s: float

    @classmethod
    def of(cls, order: str, spent_s: Sequence[tuple[float, float]]) -> Self:
        """Summarize the wall and processor times of frames."""
        wall_s, cpu_s = np.array(spent_s).T
        return cls(order, float(np.median(wall_s)), float(wall_s.min()), float(np.median(cpu_s)))


@dataclass(frozen=True, slots=True)
class ReadingTiming:
    """Times of reading whole frames; ``decoded_mb`` is the size of all arrays of the first one."""

    scene: str
    frames: int
    decoded_mb: float
    accesses: list[AccessTiming]

    def rows(self) -> list[tuple[str, ...]]:
        """Rows of a table."""
        return [
            (each.order, f"{each.median_s:.3f}", f"{each.least_s:.3f}", f"{each.cpu_s:.3f}", f"{1 / each.median_s:.1f}")
            for each in self.accesses
        ]


def timed_reading(path: Path, count: int, advance: Callable[[], None] = lambda: None) -> ReadingTiming:
    """Read frames of a bag, or of the first scene of a dataset, in order and at random.

    At random each frame is read with an empty cache; only the index of the file is known.

    Args:
        path: The dataset or bag.
        count: Number of frames to read in each order.
        advance: Called after each frame.

    Raises:
        InputError: There is no scene, or it has no frames.
        BagError: The bag is damaged.
    """
    scenes = open_dataset(path).scenes
    if not scenes or not len(scenes[0]):
        raise InputError(f"{path}: there is no frame to read")
    ticks = np.arange(count) % len(scenes[0])
    in_order = AccessTiming.of("in order", [_loading_s(scenes[0], tick, advance) for tick in ticks.tolist()])
    shuffled = np.random.default_rng(0).permutation(ticks).tolist()
    at_random = [_loading_s(open_dataset(path).scenes[0], tick, advance) for tick in shuffled]
    arrays = [value for value in scenes[0][0].load().values() if isinstance(value, np.ndarray)]
    decoded_mb = sum(array.nbytes for array in arrays) / 1e6
    return ReadingTiming(scenes[0].name, count, decoded_mb, [in_order, AccessTiming.of("at random", at_random)])


def _loading_s(scene: Scene, tick: int, advance: Callable[[], None]) -> tuple[float, float]:
    """Wall and processor time of reading a whole frame; the scene's index is read before."""
    frame = scene[tick]
    wall_s, cpu_s = time.perf_counter(), time.process_time()
    frame.load()
    spent = time.perf_counter() - wall_s, time.process_time() - cpu_s
    advance()
    return spent
