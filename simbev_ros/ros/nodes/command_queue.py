"""Holds stamped commands until the tick at which they act, so that a run does not depend on when they arrive. Pure."""

from collections import deque
from collections.abc import Iterator

from simbev_ros.simulation.world.driving.commands import DriverCommand


class CommandQueue:
    """Commands to one vehicle in one scene.

    Args:
        window_ticks: A command stamped with tick t acts at tick t + window_ticks; 0: at the next tick, if live.
        max_age_ticks: Age from which a command of a live graph is not used.
    """

    def __init__(self, window_ticks: int, max_age_ticks: int = 10) -> None:
        self._window_ticks, self._max_age_ticks = window_ticks, max_age_ticks
        self._newest_tick = -1
        self._waiting = deque[tuple[int, DriverCommand]]()

    def add(self, tick: int, command: DriverCommand, next_tick: int) -> None:
        """Add a command; those of the lead-in are ignored.

        Raises:
            ValueError: It is not newer than the one before it or, live, older than allowed at ``next_tick``.
        """
        if tick < 0:
            return
        if tick <= self._newest_tick:
            raise ValueError(f"a command for tick {tick} came after one for tick {self._newest_tick}; it is not used")
        if not self._window_ticks and next_tick - tick > self._max_age_ticks:
            raise ValueError(f"a command for tick {tick} came before tick {next_tick}, too late; it is not used")
        self._newest_tick = tick
        self._waiting.append((tick, command))

    def take(self, tick: int) -> Iterator[DriverCommand]:
        """Yield and remove the commands that act at a tick, in order."""
        while self._waiting and (not self._window_ticks or self._waiting[0][0] + self._window_ticks <= tick):
            yield self._waiting.popleft()[1]
