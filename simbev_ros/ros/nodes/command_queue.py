"""Holds stamped commands until the tick at which they act, so that a run does not depend on when they arrive. Pure."""

from collections import deque
from collections.abc import Iterator

from simbev_ros.simulation.world.driving.commands import VehicleCommand


class CommandQueue:
    """Commands to one vehicle in one scene.

    Args:
        window_ticks: A command stamped with tick t acts at tick t + window_ticks; 0: at the next tick, if live.
    """

    def __init__(self, window_ticks: int) -> None:
        self._window_ticks = window_ticks
        self._newest_tick = -1
        self._waiting = deque[tuple[int, VehicleCommand]]()

    def add(self, tick: int, command: VehicleCommand) -> None:
        """Add a command.

        Raises:
            ValueError: It is not newer than the one before it. Those of the lead-in are ignored.
        """
        if tick < 0:
            return
        if tick <= self._newest_tick:
            raise ValueError(f"a command for tick {tick} came after one for tick {self._newest_tick}; it is not used")
        self._newest_tick = tick
        self._waiting.append((tick, command))

    def take(self, tick: int) -> Iterator[VehicleCommand]:
        """Yield and remove the commands that act at a tick, in order."""
        while self._waiting and (not self._window_ticks or self._waiting[0][0] + self._window_ticks <= tick):
            yield self._waiting.popleft()[1]
