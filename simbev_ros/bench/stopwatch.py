"""Times of pieces of work that are done again and again."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from statistics import median
from typing import TypeVar

_T = TypeVar("_T")


@dataclass(frozen=True, slots=True)
class Cost:
    """One thing that was timed, per tick: the median, the least, and the processor's time of all threads together."""

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
        """What work of that name took, or of several names together; the first time was to warm up."""
        ticks = zip(*(self._spent[each][1:] for each in (name, *more)), strict=True)
        wall_s, cpu_s = zip(*(map(sum, zip(*tick, strict=True)) for tick in ticks), strict=True)
        return Cost(title or name, 1e3 * median(wall_s), 1e3 * min(wall_s), 1e3 * median(cpu_s))
