"""Decides when the world's next tick is due: at once, by the wall clock, or by steps when paused."""

import time

from simbev_ros.foundation.units import NS_PER_S


class Pacer:
    """Paces the ticks of the world node.

    Args:
        max_real_time_factor: Simulated time per wall time is at most this; 0: ticks are due at once.

    Attributes:
        max_real_time_factor: The same.
        paused: Whether ticks start only when they are stepped.
        steps: Number of ticks requested while paused and not started yet.
    """

    def __init__(self, max_real_time_factor: float) -> None:
        self.max_real_time_factor = max_real_time_factor
        self._next_s = 0.0
        self.paused = False
        self.steps = 0

    def pause(self, paused: bool) -> None:
        """Pause or resume; requested steps are dropped."""
        self.paused, self.steps = paused, 0

    def start(self) -> None:
        """Start a scene; time counts from its first tick."""
        self._next_s, self.steps = 0.0, 0

    def take_due(self, tick_ns: int) -> bool:
        """Return whether the next tick may start now; if so, count it as started."""
        if self.paused:
            if self.steps == 0:
                return False
            self.steps -= 1
            return True
        if not self.max_real_time_factor:
            return True
        now_s, period_s = time.monotonic(), tick_ns / NS_PER_S / self.max_real_time_factor
        if now_s < self._next_s:
            return False
        # After a stall the pace continues from now, without rushing to catch up.
        self._next_s = (now_s if now_s - self._next_s > 0.5 else self._next_s) + period_s
        return True
