"""Brings together what belongs to one tick: its odometry, which comes at each, and the cloud, where one is due.

Messages of two topics are not in step: either may come first, and live some never come.
"""

from collections.abc import Callable, Iterator
from typing import Generic, TypeVar

Cloud = TypeVar("Cloud")
Odometry = TypeVar("Odometry")

_MOST_WAITING = 100
"""Ticks; with more of them the oldest is given up."""


class TickJoin(Generic[Cloud, Odometry]):
    """Messages by stamp, until their tick is complete."""

    def __init__(self) -> None:
        self._clouds: dict[int, Cloud] = {}
        self._odometry: dict[int, Odometry] = {}

    def clear(self) -> None:
        """Forget all."""
        self._clouds.clear()
        self._odometry.clear()

    def add_cloud(self, stamp_ns: int, cloud: Cloud) -> None:
        """Take a cloud."""
        self._clouds[stamp_ns] = cloud

    def add_odometry(self, stamp_ns: int, odometry: Odometry) -> None:
        """Take the odometry of a tick."""
        self._odometry[stamp_ns] = odometry

    def complete(self, is_due: Callable[[int], bool]) -> Iterator[tuple[int, Odometry, Cloud | None]]:
        """Stamp, odometry and cloud of each tick that waits for nothing more, in order; each once.

        Args:
            is_due: Whether there is a cloud at a stamp. It is taken as lost when a later one is there.
        """
        for stamp_ns in sorted(self._odometry):
            newest_ns = max(self._clouds, default=-1)
            if is_due(stamp_ns) and newest_ns < stamp_ns and len(self._odometry) <= _MOST_WAITING:
                return
            for old_ns in [each for each in self._clouds if each < stamp_ns]:
                del self._clouds[old_ns]
            yield stamp_ns, self._odometry.pop(stamp_ns), self._clouds.pop(stamp_ns, None)
