"""Measures the wall and processor time of repeated work."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from statistics import median
from typing import TypeVar

_T = TypeVar("_T")


@dataclass(frozen=True, slots=True)
class Cost:
    """Time of one part per tick: median and minimum wall time, and median processor time of all threads."""

    name: str
    wall_ms: float
    least_ms: float
    cpu_ms: float


class Stopwatch:
    """Collects times by name."""

    def __init__(self) -> None:
        self._spent: dict[str, list[tuple[float, float]]] = {}

    def run(self, name: str, work: Callable[[], _T]) -> _T:
        """Time a piece of work."""
        wall_s, cpu_s = time.perf_counter(), time.process_time()
        result = work()
        spent = time.perf_counter() - wall_s, time.process_time() - cpu_s
        self._spent.setdefault(name, []).append(spent)
        return result

    def cost(self, name: str, *more: str, title: str = "") -> Cost:
        """Time of the work with a name, or with several names together; the first run was for warm-up."""
        ticks = zip(*(self._spent[each][1:] for each in (name, *more)), strict=True)
        wall_s, cpu_s = zip(*(map(sum, zip(*tick, strict=True)) for tick in ticks), strict=True)
        return Cost(title or name, 1e3 * median(wall_s), 1e3 * min(wall_s), 1e3 * median(cpu_s))
