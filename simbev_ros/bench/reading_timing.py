"""Timing how fast frames of a recorded scene can be read and decoded, one after the other and at random."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import numpy as np

from simbev_ros.dataset import Scene, open_dataset
from simbev_ros.errors import InputError


@dataclass(frozen=True, slots=True)
class AccessTiming:
    """One way to read, per frame; wall and processor time of all threads."""

    order: str
    median_s: float
    least_s: float
    cpu_s: float

    @classmethod
    def of(cls, order: str, spent_s: Sequence[tuple[float, float]]) -> Self:
        """Of the wall and processor times of some frames."""
        wall_s, cpu_s = np.array(spent_s).T
        return cls(order, float(np.median(wall_s)), float(wall_s.min()), float(np.median(cpu_s)))


@dataclass(frozen=True, slots=True)
class ReadingTiming:
    """A scene's frames with all that they have; ``decoded_mb`` are of arrays in the first one."""

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
    """Read frames of the first scene of a dataset, or of a bag, in order and at random places.

    At random nothing is known of the file but its index: each frame is read with an empty cache.

    Args:
        path: The dataset or bag.
        count: How many frames, in each order.
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
    """Wall and processor time of all that a frame has; the scene's index is read before."""
    frame = scene[tick]
    wall_s, cpu_s = time.perf_counter(), time.process_time()
    frame.load()
    spent = time.perf_counter() - wall_s, time.process_time() - cpu_s
    advance()
    return spent
