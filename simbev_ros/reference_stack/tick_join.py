"""Joins the messages of one tick: its odometry, sent at every tick, and its cloud, if one is due.

Messages of two topics are not synchronized: either may arrive first, and live some never arrive.
"""

from collections.abc import Callable, Iterator
from typing import Generic, TypeVar

Cloud = TypeVar("Cloud")
Odometry = TypeVar("Odometry")

_MAX_WAITING = 100
"""Maximum number of waiting ticks; beyond it, the oldest is released without its cloud."""


class TickJoin(Generic[Cloud, Odometry]):
    """Holds messages by stamp until their tick is complete."""

    def __init__(self) -> None:
        self._clouds: dict[int, Cloud] = {}
        self._odometry: dict[int, Odometry] = {}

    def clear(self) -> None:
        """Forget all messages."""
        self._clouds.clear()
        self._odometry.clear()

    def add_cloud(self, stamp_ns: int, cloud: Cloud) -> None:
        """Store a cloud."""
        self._clouds[stamp_ns] = cloud

    def add_odometry(self, stamp_ns: int, odometry: Odometry) -> None:
        """Store the odometry of a tick."""
        self._odometry[stamp_ns] = odometry

    def release_complete(self, is_due: Callable[[int], bool]) -> Iterator[tuple[int, Odometry, Cloud | None]]:
        """Release stamp, odometry and cloud of each complete tick, in order and once.

        Args:
            is_due: Whether a cloud is due at a stamp. A cloud counts as lost when a later one has arrived.
        """
        for stamp_ns in sorted(self._odometry):
            newest_ns = max(self._clouds, default=-1)
            if is_due(stamp_ns) and newest_ns < stamp_ns and len(self._odometry) <= _MAX_WAITING:
                return
            for old_ns in [each for each in self._clouds if each < stamp_ns]:
                del self._clouds[old_ns]
            yield stamp_ns, self._odometry.pop(stamp_ns), self._clouds.pop(stamp_ns, None)
